"""Comparisons: all runs of a study on one problem and one transcription, by solver, and the reference that they are measured against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from macs.front import Front
from macs.fronts.points import by_first
from macs.fronts.verified import feasible_as_simulated
from macs.io.text import counted
from macs.pareto.dominance import nondominated

from ..batch.store import Store, StoredRun
from ..execution.task import CRASHED, MEMORY, TIMEOUT, FinalStates, final_states, record
from ..files import errors_begin_with
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

    def only(self, solver: str) -> Comparison:
        """The same of one solver alone."""
        return replace(
            self,
            runs={solver: self.runs[solver]},
            fronts={solver: self.fronts[solver]},
            counting={solver: self.counting[solver]},
            failures={solver: self.failures.get(solver, 0)},
            left_out={solver: self.left_out.get(solver, 0)},
        )

    def union(self) -> Reference:
        """The non-dominated points of all runs. Raises ValueError if there are none.

        In a study that verifies only those feasible when simulated, and so none of foreign solvers, whose points cannot be simulated.
        """
        counting = [one.front for ones in self.counting.values() for one in ones]
        fronts = counting if self.verifies else self.every
        together = union([front if front.source is not None else front.objectives for front in fronts])  # others have no trajectories
        assert isinstance(together, Front)  # as all of them are
        return Reference(together, f"the union of {counted(len(fronts), 'run')}", False)

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
