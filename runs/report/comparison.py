"""Comparisons: all runs of a study on one problem and one transcription, by solver. Which of their points count, the reference that they
are measured against, their indicators and what they cost."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from macs.front import Front
from macs.fronts.points import by_first
from macs.fronts.verified import feasible_as_simulated
from macs.io.console import Steps
from macs.io.text import counted
from macs.pareto.dominance import nondominated

from ..batch.store import Store, StoredRun
from ..execution.task import COUNTS, CRASHED, MEMORY, TIMEOUT, FinalStates, final_states, record
from ..files import errors_begin_with
from ..measures.attainment import History
from ..measures.indicators import additive_epsilon, gd, hypervolume, igd, igd_plus
from ..measures.references import Reference, look_up, union

EACH = "each on its own"
"""Name of the transcription where each solver has its own."""
FAILED = (CRASHED, TIMEOUT, MEMORY)
"""Statuses that count as a failure of the solver. Killed, missing and unreadable runs are no evidence against it: they are left out, and
the report says how many."""


@dataclass(frozen=True, eq=False)
class Counting:
    """The points of a run that count: all of them, or in a study that verifies those that are feasible when simulated.

    Their objectives are those of the simulation, so that it does not matter what the solver said of these.
    """

    front: Front  # the n points that count
    ends: FinalStates  # their states at the end of each phase
    # claimed, verified, feasible: Number of points that the solver returned, of those verified, and of those feasible when simulated,
    # dominated ones included.
    claimed: int
    verified: int
    feasible: int

    @classmethod
    def of(cls, run: StoredRun, tolerance: float | None) -> Counting:
        """The points of a finished run of a study that verifies within a tolerance, or with None not at all.

        Points that were not verified within this tolerance, and final states that are not in the run's record, are simulated now. Raises
        ValueError if that cannot be, as their problem is not found.
        """
        front = run.front
        if tolerance is None or not len(front):
            return cls(front, final_states(front), len(front), len(front), len(front))
        final = run.simulated.get("ends", {})
        lengths = {len(values) for states in final.values() for values in states.values()}
        with errors_begin_with(f"the points of run {run.number} of {run.cell.name} cannot be simulated"):
            front = front if front.stats.get("verify") == tolerance else front.verify(tolerance)
            final = final if not front.dynamic or lengths == {len(front)} else record(front, tolerance)["ends"]
        feasible = feasible_as_simulated(front, tolerance)
        rows = np.flatnonzero(feasible)
        rows = rows[nondominated(front.simulated_F[rows])]
        rows = rows[by_first(front.simulated_F[rows] * front.signs)]
        kept = front[rows]
        kept = kept.replace(F=kept.simulated_F, violation=kept.simulated_violation, optimality=[None] * len(kept))
        places = {phase: {name: np.array(values)[rows] for name, values in states.items()} for phase, states in final.items()}
        return cls(kept, places, len(front), int(front.verified.sum()), int(feasible.sum()))


@dataclass(frozen=True, eq=False)
class Comparison:
    """All runs on one problem and one transcription."""

    problem: str  # problem, transcription: Labels
    transcription: str
    runs: Mapping[str, Sequence[StoredRun]]  # its finished runs
    fronts: Mapping[str, Sequence[Front]]  # the points of each finished run that count; also the given fronts of foreign solvers
    counting: Mapping[str, Sequence[Counting]]  # the same with the result of their verification
    failures: Mapping[str, int]  # how many of its runs failed
    left_out: Mapping[str, int]  # how many other runs have no front
    stated: Any = None  # the reference as the study states it
    verifies: bool = False  # whether only points that are feasible when simulated count

    @cached_property
    def against(self) -> Reference:
        """The reference that the study states, see `reference`."""
        return self.reference(self.stated)

    @property
    def shown(self) -> str:
        """The problem as captions name it: by its label or, where that is an address of code ("rocket.py:build"), by its own name."""
        source = self.known.source
        return source.name if source is not None and ".py:" in self.problem else self.problem

    @property
    def name(self) -> str:
        """Problem and transcription in one line."""
        return f"{self.shown}, {self.transcription}"

    def place(self, solver: str) -> str:
        """The transcription that a solver works on, by label."""
        runs = self.runs.get(solver)
        return runs[0].cell.transcription if runs else self.transcription

    @property
    def every(self) -> list[Front]:
        """All fronts."""
        return [front for fronts in self.fronts.values() for front in fronts]

    @property
    def known(self) -> Front:
        """A front with the names, units and senses of the objectives."""
        return self.every[0]

    def attaining(self) -> dict[str, list[Front]]:
        """The fronts of the solvers that found a point; a failed run attains nothing, as an empty front does."""
        nothing = self.known[:0]
        runs = {solver: [*fronts, *[nothing] * self.failures.get(solver, 0)] for solver, fronts in self.fronts.items()}
        return {solver: fronts for solver, fronts in runs.items() if any(map(len, fronts))}

    def merged(self, solver: str) -> Front | None:
        """The front of all runs of a solver together; None if it found no point."""
        fronts = [front for front in self.fronts[solver] if len(front)]
        return Front.merge(fronts) if len(fronts) > 1 else fronts[0] if fronts else None

    def only(self, solver: str) -> Comparison:
        """The same of one solver alone."""
        own: dict[str, Any] = {
            name: {solver: getattr(self, name)[solver]} for name in ("runs", "fronts", "counting", "failures", "left_out")
        }
        return replace(self, **own)

    def union(self) -> Reference:
        """The non-dominated points of all runs. Raises ValueError if there are none.

        In a study that verifies only those feasible when simulated, and so none of foreign solvers, whose points cannot be simulated.
        """
        counting = [one.front for ones in self.counting.values() for one in ones]
        fronts = counting if self.verifies else self.every
        together = union([front if front.source is not None else front.objectives for front in fronts])  # others have no trajectories
        assert isinstance(together, Front)  # as all of them are
        return Reference(together, f"the union of {counted(len(fronts), 'run')}", False, alone=len(fronts) == 1 or len(together) == 1)

    def reference(self, given: Any) -> Reference:
        """The reference that the study states for this problem; see `look_up`."""
        source = self.known.source
        address, data = (source.address, source.data) if source is not None else ("", {})
        return look_up(given, self.problem, address, data, self.known.goals) or self.union()


def compared(store: Store) -> dict[tuple[str, str], dict[str, list[StoredRun]]]:
    """All runs of a study by what they are compared on, the labels of a problem and a transcription, and by solver."""
    cells: dict[tuple[str, str], dict[str, list[StoredRun]]] = {}
    apart: dict[str, dict[str, list[StoredRun]]] = {}
    for run in store.runs():
        problem, transcription, solver = run.cell.labels
        here = apart.setdefault(problem, {}) if run.cell.apart else cells.setdefault((problem, transcription), {})
        here.setdefault(solver, []).append(run)
    for problem, solvers in apart.items():
        # Solvers on terms of their own are compared with the others wherever these are; if there are none, among themselves.
        for place in [place for place in cells if place[0] == problem] or [(problem, EACH)]:
            cells[place] = cells.get(place, {}) | solvers
    return cells


def comparisons(store: Store, others: Mapping[str, Sequence[Front]]) -> list[Comparison]:
    """The comparisons of a study that have a front."""
    found = []
    for (problem, transcription), solvers in compared(store).items():
        finished = {solver: [run for run in runs if run.finished] for solver, runs in solvers.items()}
        counting = {solver: [Counting.of(run, store.definition.get("verify")) for run in runs] for solver, runs in finished.items()}
        fronts: dict[str, Sequence[Front]] = {solver: [one.front for one in ones] for solver, ones in counting.items()}
        if not any(fronts.values()):
            continue
        goals = next(front for one in fronts.values() for front in one).goals
        fronts |= {name: given for name, given in others.items() if all(front.goals == goals for front in given)}
        failures = {solver: sum(run.status in FAILED for run in runs) for solver, runs in solvers.items()}
        left_out = {solver: len(runs) - len(finished[solver]) - failures[solver] for solver, runs in solvers.items()}
        stated, verifies = store.definition.get("reference"), store.definition.get("verify") is not None
        found.append(Comparison(problem, transcription, finished, fronts, counting, failures, left_out, stated, verifies))
    return found


def in_steps(title: str, found: Sequence[Comparison]) -> Iterator[Comparison]:
    """The comparisons one by one; the terminal shows which one is in progress."""
    with Steps(title, len(found), at_once=True) as steps:
        for comparison in found:
            steps.begin(comparison.name)
            yield comparison


INDICATORS: Mapping[str, Callable[..., float]] = {
    "GD": gd,
    "IGD": igd,
    "IGD+": igd_plus,
    "hypervolume": hypervolume,
    "additive epsilon": additive_epsilon,
}
CURVED = ("GD", "IGD", "IGD+")
"""Indicators that take a dense reference for a curve, unless `curve` is False."""
CHARGED, PROCESSOR, SEARCHED = "charged evaluations", "seconds of processor", "time of the search [s]"
AXES: Mapping[str, tuple[str, str]] = {
    "evaluations": ("evaluations", "evaluations"),
    CHARGED: ("evaluations", CHARGED),
    "inner iterations": ("inner_iterations", "inner iterations"),
    "time": ("elapsed", "time [s]"),
}
"""{cost: its column in a history, and the label of its axis}."""


def indicator(name: str, points: Front | np.ndarray, reference: Reference, *, curve: bool = True) -> float:
    """An indicator of a front, or of objectives (n, m) in the user's units and senses."""
    options = {"curve": curve} if name in CURVED else {}
    return INDICATORS[name](points, reference.front, **options)


def samples(comparison: Comparison, reference: Reference, *, curve: bool = True) -> dict[str, dict[str, list[float]]]:
    """{indicator: {solver: a value for each run}}, NaN for a run that failed."""
    return {
        name: {
            solver: [indicator(name, front, reference, curve=curve) for front in fronts] + [np.nan] * comparison.failures.get(solver, 0)
            for solver, fronts in comparison.fronts.items()
            if len(fronts) + comparison.failures.get(solver, 0)
        }
        for name in INDICATORS
    }


@dataclass(frozen=True)
class Charge:
    """What gradient solves, and evaluations that take more than others, cost in evaluations of the cheapest kind.

    The charged evaluations of a run are what its counted work is charged, see `Counts`, divided by `unit`.
    """

    unit: float  # what an evaluation takes, in the mean of its runs, by the solver without gradient solves whose evaluations take least
    solver: str  # that solver

    @classmethod
    def of(cls, comparison: Comparison) -> Charge | None:
        """The charge of a comparison; None if every solver makes gradient solves, or work was not counted, as for black boxes."""
        stats = {solver: [run.front.stats for run in runs] for solver, runs in comparison.runs.items() if runs}
        if not all("charge" in one for ones in stats.values() for one in ones):
            return None
        taken = {
            solver: float(np.mean([one["charge"] / one["evaluations"] for one in ones]))
            for solver, ones in stats.items()
            if all(one["evaluations"] and one["charge"] and not one["gradient_solves"] for one in ones)
        }
        if not taken:
            return None
        solver = min(taken, key=lambda one: taken[one])
        return cls(taken[solver], solver)

    def __call__(self, counts: Mapping[str, Any]) -> Any:
        """Charged evaluations of the `charge` of a run so far, a number or an array."""
        return np.asarray(counts["charge"], dtype=float) / self.unit


def spent(comparison: Comparison, charge: Charge | None = None) -> dict[str, dict[str, list[float]]]:
    """{cost: {solver: a value for each finished run}}; charged evaluations and work of those that record it."""
    keys = {key.replace("_", " "): key for key in COUNTS if key != "charge"} | {SEARCHED: "wall_time"}
    found = {
        name: {solver: [float(run.front.stats[key]) for run in runs if key in run.front.stats] for solver, runs in comparison.runs.items()}
        for name, key in keys.items()
    }
    if charge is not None:
        found[CHARGED] = {solver: [float(charge(run.front.stats)) for run in runs] for solver, runs in comparison.runs.items()}
    found[PROCESSOR] = {
        solver: [run.history["cpu"][-1] for run in runs if run.history.get("cpu")] for solver, runs in comparison.runs.items()
    }
    return {name: {solver: values for solver, values in solvers.items() if values} for name, solvers in found.items()}


def histories(comparison: Comparison, reference: Reference, name: str, axis: str, charge: Charge | None = None) -> dict[str, list[History]]:
    """{solver: histories} of an indicator over a cost, of the runs whose history is known and had any of it: a sweep has no evaluations.
    Charged evaluations need a charge, and histories with work."""
    key, _ = AXES[axis]
    if axis == CHARGED and charge is None:
        return {}
    return {
        solver: known
        for solver, runs in comparison.runs.items()
        if (
            known := [
                _history(run, reference, name, charge(run.history) if axis == CHARGED and charge else run.history[key])
                for run in runs
                if run.history.get("F") and any(run.history[key]) and (axis != CHARGED or "charge" in run.history)
            ]
        )
    }


def _history(run: StoredRun, reference: Reference, name: str, moments: Any) -> History:
    signs = np.array([goal.sign for goal in reference.front.goals])
    values = [indicator(name, np.reshape(F, (-1, len(signs))) * signs, reference) for F in run.history["F"]]
    return np.maximum.accumulate(np.array(moments, dtype=float)), np.array(values)
