"""Sensitivity: points of a front under other data than those that they were found with.

Changed data: points of the nominal front simulated under the data of other problems, beside the fronts found under those data, as in
section VI B of Chai et al., "Solving multiobjective constrained trajectory optimization problem by an extended evolutionary algorithm",
IEEE Transactions on Cybernetics 50(4), 2020. Dispersions: points through many cases with random data, as their case flies them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.evaluation.evaluator import CONVERGED
from macs.front import Front
from macs.fronts.pictures.style import COLORS, better
from macs.fronts.verified import check_alike
from problems.checks import unknown

from ..files import errors_begin_with
from ..measures.references import module_of
from .comparison import Comparison
from .flights import representatives
from .plots import COLUMN, PAGE, new_figure, style
from .tables import Cell, Head, Table, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from problems.compiled import CompiledProblem, Objective
    from problems.vector import CompiledVectorProblem

SIMULATED_POINTS, DISPERSED_POINTS = 60, 12
"""Number of points of a front that are simulated under changed data, and flown under dispersions: each point takes many flights."""
LOOKS: Mapping[str, Mapping[str, Any]] = {
    "nominal front": {"marker": "o", "ms": 3.0, "mew": 0, "color": "black", "zorder": 3},
    "simulated under these data": {"marker": "o", "ms": 4.0, "mew": 0.7, "mfc": "none", "color": COLORS[0], "zorder": 4},
    "those not feasible": {"marker": "x", "ms": 3.0, "mew": 0.6, "color": COLORS[0], "zorder": 4},
    "found under these data": {"marker": "o", "ms": 3.0, "mew": 0, "color": COLORS[1], "zorder": 2},
}


def check_nominal(nominal: Any, problems: Mapping[str, CompiledProblem | CompiledVectorProblem]) -> None:
    """Raise ValueError unless `nominal` is the label of one of several problems whose points can be simulated under all the others."""
    if not isinstance(nominal, str) or nominal not in problems:
        raise ValueError(f"nominal: {unknown('problem', nominal, problems)}")
    if len(problems) == 1:
        raise ValueError(f"nominal: '{nominal}' is the only problem; there are no other data to simulate its front under")
    for name, problem in problems.items():
        with errors_begin_with(f"nominal: problem '{name}'"):
            check_alike(problems[nominal], problem)


@dataclass(frozen=True, eq=False)
class Change:
    """The result of one solver on one transcription."""

    transcription: str
    solver: str
    found: Mapping[str, Front]  # by label of the problem, the union of all runs; of the nominal problem first
    # Representative points of the nominal front as simulated under the data of each problem, in one order; of the nominal problem first.
    # Empty if there is no nominal front or its problem cannot be loaded; `note` gives the reason.
    simulated: Mapping[str, Front] = field(default_factory=dict)
    note: str = ""

    @classmethod
    def of(cls, comparisons: Sequence[Comparison], transcription: str, solver: str, labels: Sequence[str], tolerance: float) -> Change:
        """The change of a solver's front; the nominal problem is the first of the labels."""
        here = {one.problem: one.fronts[solver] for one in comparisons if one.runs.get(solver) and one.place(solver) == transcription}
        union = {label: Front.merge(here[label]) for label in labels if label in here}
        own = union[labels[0]]
        if not len(own):
            note = "nothing feasible was found under the nominal data, so there is nothing to simulate"
            return cls(transcription, solver, union, note=note)
        try:
            # A problem that a script stated cannot be loaded.
            problems = {label: next(one for one in comparisons if one.problem == label).known.stated() for label in labels}
        except ValueError as error:
            return cls(transcription, solver, union, note=f"nothing was simulated: {error}")
        some = own[representatives(own, SIMULATED_POINTS)]
        simulated = {label: some.simulate(problem, tolerance=tolerance) for label, problem in problems.items()}
        return cls(transcription, solver, union, simulated)

    @property
    def nominal(self) -> Front:
        """The nominal points as simulated under their own data."""
        return next(iter(self.simulated.values()))

    def shifts(self, problem: str) -> np.ndarray:
        """By how much each objective (n, m) of the nominal points is more under other data, in the user's units, where both are numbers."""
        shifts = self.simulated[problem].objectives - self.nominal.objectives
        return shifts[np.isfinite(shifts).all(axis=1)]


@dataclass(frozen=True, eq=False)
class ChangedData:
    """Tables and figures of all solvers and transcriptions. A simulated point is feasible within `tolerance`, in scales."""

    nominal: str  # label of the nominal problem
    changes: Sequence[Change]
    tolerance: float

    def tables(self) -> dict[str, Table]:
        """{name of a file: table}."""
        found = {"changed-data": self._shifts(), "changed-data-best": self._best()}
        return {name: one for name, one in found.items() if one.rows or one.notes}

    def figures(self) -> dict[str, Figure]:
        """{name of a file: figure}, one for each transcription and solver."""
        drawn = [one for one in self.changes if len(one.simulated) > 1 and len(self._goals) > 1]
        return {f"changed-data-{one.transcription}-{one.solver}": changed_figure(one) for one in drawn}

    @property
    def _goals(self) -> Sequence[Objective]:
        return next(iter(self.changes[0].found.values())).goals

    def _shifts(self) -> Table:
        heads: list[Head | str] = [*_WHOSE, "data", "points", "feasible"]
        for goal in self._goals:
            heads += [Head(f"{goal.name}: mean shift", goal.unit), Head(f"{goal.name}: largest", goal.unit)]
        rows: list[list[Cell]] = []
        for one in self.changes:
            for problem, front in one.simulated.items():
                shifts = one.shifts(problem)
                values: list[Cell] = [None] * (2 * shifts.shape[1])
                if problem != self.nominal and len(shifts):
                    largest = shifts[np.abs(shifts).argmax(axis=0), range(shifts.shape[1])]
                    values = np.column_stack([shifts.mean(axis=0), largest]).ravel().tolist()
                rows.append([one.transcription, one.solver, problem, len(front), int((front.status == CONVERGED).sum()), *values])
        notes = [
            f"Up to {SIMULATED_POINTS} representative points of the union of all runs on {self.nominal}, simulated with the same controls "
            f"by an independent integrator; feasible: no limit is violated by more than {self.tolerance:g} of its scale. A shift is "
            "against the same point under the nominal data."
        ]
        notes += [f"{one.solver}, {one.transcription}: {one.note}." for one in self.changes if one.note]
        return table(heads, rows, f"The front of {self.nominal} under changed data.", notes)

    def _best(self) -> Table:
        heads: list[Head | str] = [*_WHOSE, "optimised under", "points", *_heads(self._goals)]
        rows: list[list[Cell]] = []
        for one in self.changes:
            for problem, front in one.found.items():
                best = (front.F.min(axis=0) * front.signs).tolist() if len(front) else [None] * len(front.goals)
                rows.append([one.transcription, one.solver, problem, len(front), *best])
        return table(heads, rows, "The best of each objective that was found under each data, all runs together.")


_WHOSE = (Head("transcription", grouped=True), Head("solver", grouped=True))


def _heads(goals: Sequence[Objective], before: str = "") -> list[Head]:
    return [Head(f"{before}{goal.name}", goal.unit, digits=5) for goal in goals]


def changed_data(comparisons: Sequence[Comparison], study: Mapping[str, Any]) -> list[ChangedData]:
    """The nominal front of each solver and transcription, simulated under the data of all other problems of a study. Empty without a
    nominal problem. In a study that does not verify, a point may violate its limits by 1 % of their scales."""
    nominal, tolerance = study.get("nominal"), study.get("verify") or 1e-2
    if nominal is None:
        return []
    labels = [nominal, *dict.fromkeys(one.problem for one in comparisons if one.problem != nominal)]
    own = [one for one in comparisons if one.problem == nominal]
    cells = dict.fromkeys((one.place(solver), solver) for one in own for solver, runs in one.runs.items() if runs)
    found = [Change.of(comparisons, *cell, labels, tolerance) for cell in cells]
    return [ChangedData(nominal, found, tolerance)] if found else []


def changed_figure(change: Change) -> Figure:
    """The nominal front, its points as simulated under other data, and the front found under those data, for each of the other data.

    Of two objectives, a panel for each data; of more, a row of panels of the first objective with each of the others.
    """
    nominal = change.nominal
    goals = nominal.goals
    places = [(problem, k) for problem in [*change.simulated][1:] for k in range(1, len(goals))]
    others = len(goals) - 1
    columns = others if 1 < others <= 4 else min(3, len(places))
    rows = -(-len(places) // columns)
    shared = "all" if others == 1 else "col" if columns == others else "none"
    with style():
        figure = new_figure(COLUMN if columns == 1 else PAGE, (2.4 if others == 1 else 2.1) * rows + 0.4)
        grid = figure.subplots(rows, columns, squeeze=False, sharex="all", sharey=shared).ravel()
        for place, (ax, (problem, k)) in enumerate(zip(grid, places, strict=False)):
            front, again = change.simulated[problem], change.found.get(problem, nominal[:0])
            feasible, source = front.status == CONVERGED, front.source
            drawn = (
                nominal[nominal.status == CONVERGED],
                front[feasible],
                front[~feasible],
                again[representatives(again, SIMULATED_POINTS)],
            )
            for (name, look), points in zip(LOOKS.items(), drawn, strict=True):
                ax.plot(*points.objectives[:, [0, k]].T, ls="", label=name, **look)
            ax.set_title(source.name if source is not None and ".py:" in problem else problem, loc="left")
            if place % columns == 0 or shared != "all":
                ax.set_ylabel(better(goals[k]))
        for place, ax in enumerate(grid[: len(places)]):
            if place + columns >= len(places):  # the last of its column
                ax.set_xlabel(better(goals[0]))
                ax.tick_params(labelbottom=True)
        for ax in grid[len(places) :]:
            ax.remove()
        handles, names = grid[0].get_legend_handles_labels()
        look = {"loc": "outside upper left", "ncols": 2 if columns == 1 else 4, "frameon": False, "handletextpad": 0.3}
        figure.legend(handles, names, **look)
    return figure


def check_dispersions(given: Any, problems: Mapping[str, CompiledProblem | CompiledVectorProblem]) -> None:
    """Raise ValueError unless the cases of all problems know dispersions, with these settings."""
    for name, problem in problems.items():
        with errors_begin_with(f"dispersions: problem '{name}'"):
            _settings_of(given, problem.address)


def _settings_of(given: Any, address: str) -> Any:
    """The dispersions that a study states, for a case: see `references.module_of`."""
    case = module_of(address) if address and not address.rpartition(":")[0].endswith(".py") else None
    kind = getattr(case, "Dispersions", None)
    if kind is None or not hasattr(case, "dispersed"):
        raise ValueError("its case does not say what becomes of its points under dispersions")
    if not isinstance(given, Mapping):
        raise ValueError(f"must be a table of settings, not {given!r}")
    try:
        return kind(**given)
    except TypeError as error:
        raise ValueError(str(error)) from error


@dataclass(frozen=True, eq=False)
class DispersedFront:
    """Points of the front of one solver under dispersions."""

    name: str  # of the comparison
    solver: str
    points: Front  # n points that stand for the front of all its runs together
    settings: Any  # the dispersions, of the case's own kind
    # Of the nominal case first, then of all cases, for each way to fly them: the measures of each point.
    measures: Mapping[str, Sequence[Mapping[tuple[str, str], float | None]]]

    def tables(self) -> dict[str, Table]:
        """{name of a file: table}, one for each way to fly: a row for each point, its objectives as found and the measures of its cases."""
        return {f"{self.name}-{self.solver}-dispersed-{way}": self._table(way) for way in [*self.measures][1:]}

    def figures(self) -> dict[str, Figure]:
        """None: the tables have all."""
        return {}

    def _table(self, way: str) -> Table:
        measured = self.measures[way]
        heads: list[Head | str] = ["point", *_heads(self.points.goals, "nominal ")]
        heads += [Head(name, unit, digits=4) for name, unit in measured[0]]
        rows: list[list[Cell]] = [[number, *self.points.objectives[number].tolist(), *one.values()] for number, one in enumerate(measured)]
        note = (
            f"{self.settings}: standard deviations of normal distributions; the same draws for all points. Shares are of all cases; "
            "percentiles, P99 the 99th, are of those captured."
        )
        return table(heads, rows, f"{self.name}: the front of {self.solver} under dispersions, {way}.", [note])


def dispersed_fronts(comparisons: Sequence[Comparison], study: Mapping[str, Any]) -> list[DispersedFront]:
    """The fronts of all solvers on each problem under the dispersions that a study states. Empty if it states none."""
    given = study.get("dispersions")
    found = []
    for comparison in comparisons if given is not None else ():
        for solver in comparison.runs:
            whole = comparison.merged(solver)
            if whole is None:
                continue
            some = whole[representatives(whole, DISPERSED_POINTS)]
            address = some.source.address if some.source is not None else ""
            settings = _settings_of(given, address)
            flown = module_of(address).dispersed(some, settings)
            ways = {way: [one[way].measures() for one in flown] for way in flown[0]}
            found.append(DispersedFront(comparison.name, solver, some, settings, ways))
    return found
