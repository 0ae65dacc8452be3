"""Changed data: points of the nominal front simulated under the data of other problems, beside the fronts found under those data.

Section VI B of Chai et al., "Solving multiobjective constrained trajectory optimization problem by an extended evolutionary algorithm",
IEEE Transactions on Cybernetics 50(4), 2020, does so for another mass and another gravity.
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

from ...files import errors_begin_with
from ..comparison import Comparison
from ..flight_plots import representatives
from ..plots import COLUMN, PAGE, new_figure, style
from ..tables import Cell, Head, Table, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from problems.compiled import CompiledProblem
    from problems.vector import CompiledVectorProblem

TOLERANCE = 1e-2
"""Allowed violation of a simulated point, in scales, in a study without `verify`."""
MANY, FEW = 60, 4
"""Number of points of a front that are simulated and drawn, and of those listed in a table."""
NOMINAL: Mapping[str, Any] = {"marker": "o", "ms": 3.0, "mew": 0, "color": "black", "zorder": 3}
SIMULATED: Mapping[str, Any] = {"marker": "o", "ms": 4.0, "mew": 0.7, "mfc": "none", "color": COLORS[0], "zorder": 4}
INFEASIBLE: Mapping[str, Any] = {"marker": "x", "ms": 3.0, "mew": 0.6, "color": COLORS[0], "zorder": 4}
FOUND: Mapping[str, Any] = {"marker": "o", "ms": 3.0, "mew": 0, "color": COLORS[1], "zorder": 2}


def check(nominal: Any, problems: Mapping[str, CompiledProblem | CompiledVectorProblem]) -> None:
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

    transcription: str  # transcription, solver: Labels
    solver: str
    found: Mapping[str, Front]  # the union of all runs, of the nominal problem first
    # Up to `MANY` representative points of the nominal front, as simulated under the data of each problem, in one order; of the nominal
    # problem first. Empty if there is no nominal front or its problem cannot be loaded; `note` gives the reason.
    simulated: Mapping[str, Front] = field(default_factory=dict)
    note: str = ""

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
    """Tables and figures of all solvers and transcriptions.

    `nominal` is the label of the nominal problem. A simulated point is feasible if it violates nothing by more than `tolerance`, in scales.
    """

    nominal: str
    changes: Sequence[Change]
    tolerance: float

    def tables(self) -> dict[str, Table]:
        """{name of a file: table}."""
        found = {"changed-data": self._shifts(), "changed-data-points": self._points(), "changed-data-best": self._best()}
        return {name: one for name, one in found.items() if one.rows or one.notes}

    def figures(self) -> dict[str, Figure]:
        """{name of a file: figure}, one for each transcription and solver."""
        drawn = [one for one in self.changes if len(one.simulated) > 1 and len(self._goals) > 1]
        return {f"changed-data-{one.transcription}-{one.solver}": changed_figure(one) for one in drawn}

    @property
    def _goals(self) -> Any:
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
            f"Up to {MANY} representative points of the union of all runs on {self.nominal}, simulated with the same controls by an "
            f"independent integrator; feasible: no limit is violated by more than {self.tolerance:g} of its scale. A shift is against "
            "the same point under the nominal data."
        ]
        notes += [f"{one.solver}, {one.transcription}: {one.note}." for one in self.changes if one.note]
        return table(heads, rows, f"The front of {self.nominal} under changed data.", notes)

    def _points(self) -> Table:
        heads: list[Head | str] = [*_WHOSE, Head("point", grouped=True), "data", "feasible", *_columns(self._goals)]
        rows: list[list[Cell]] = []
        for one in self.changes:
            for number, k in enumerate(representatives(one.nominal, FEW) if one.simulated else [], 1):
                for problem, front in one.simulated.items():
                    feasible = "yes" if front.status[k] == CONVERGED else "no"
                    rows.append([one.transcription, one.solver, f"point {number}", problem, feasible, *front.objectives[k].tolist()])
        return table(heads, rows, f"Points of the front of {self.nominal}, each under changed data with the same controls.")

    def _best(self) -> Table:
        heads: list[Head | str] = [*_WHOSE, "optimised under", "points", *_columns(self._goals)]
        rows: list[list[Cell]] = []
        for one in self.changes:
            for problem, front in one.found.items():
                signs = np.array([goal.sign for goal in front.goals])
                best = (front.F.min(axis=0) * signs).tolist() if len(front) else [None] * len(signs)
                rows.append([one.transcription, one.solver, problem, len(front), *best])
        return table(heads, rows, "The best of each objective that was found under each data, all runs together.")


_WHOSE = (Head("transcription", grouped=True), Head("solver", grouped=True))


def _columns(goals: Sequence[Any]) -> list[Head]:
    return [Head(goal.name, goal.unit, digits=5) for goal in goals]


def changed_data(comparisons: Sequence[Comparison], study: Mapping[str, Any]) -> list[ChangedData]:
    """The nominal front of each solver and transcription, simulated under the data of all other problems of a study. Empty without a
    nominal problem."""
    nominal, tolerance = study.get("nominal"), study.get("verify") or TOLERANCE
    if nominal is None:
        return []
    labels = [nominal, *dict.fromkeys(comparison.problem for comparison in comparisons if comparison.problem != nominal)]
    cells = {
        (comparison.place(solver), solver): None
        for comparison in comparisons
        if comparison.problem == nominal
        for solver, runs in comparison.runs.items()
        if runs
    }
    found = [_change(comparisons, *cell, labels, tolerance) for cell in cells]
    return [ChangedData(nominal, found, tolerance)] if found else []


def _change(comparisons: Sequence[Comparison], transcription: str, solver: str, labels: Sequence[str], tolerance: float) -> Change:
    here = {
        comparison.problem: comparison.fronts[solver]
        for comparison in comparisons
        if comparison.runs.get(solver) and comparison.place(solver) == transcription
    }
    union = {label: Front.merge(here[label]) for label in labels if label in here}
    own = union[labels[0]]
    if not len(own):
        note = "nothing feasible was found under the nominal data, so there is nothing to simulate"
        return Change(transcription, solver, union, note=note)
    some = own[representatives(own, MANY)]
    try:
        # A problem that a script stated cannot be loaded.
        problems = {label: next(one for one in comparisons if one.problem == label).known.stated() for label in labels}
    except ValueError as error:
        return Change(transcription, solver, union, note=f"nothing was simulated: {error}")
    return Change(transcription, solver, union, {label: some.simulate(problem, tolerance=tolerance) for label, problem in problems.items()})


def changed_figure(change: Change) -> Figure:
    """The nominal front, its points as simulated under other data, and the front found under those data, for each of the other data.

    Of two objectives, a panel for each data; of more, a row of panels of the first objective with each of the others.
    """
    goals = change.nominal.goals
    pairs = [(0, k) for k in range(1, len(goals))]
    places = [(problem, pair) for problem in [*change.simulated][1:] for pair in pairs]
    columns = len(pairs) if 1 < len(pairs) <= 4 else min(3, len(places))
    rows = -(-len(places) // columns)
    with style():
        figure = new_figure(COLUMN if columns == 1 else PAGE, (2.4 if len(pairs) == 1 else 2.1) * rows + 0.4)
        shared = "all" if len(pairs) == 1 else "col" if columns == len(pairs) else "none"
        grid = figure.subplots(rows, columns, squeeze=False, sharex="all", sharey=shared).ravel()
        for place, (ax, (problem, (i, k))) in enumerate(zip(grid, places, strict=False)):
            _draw(ax, change, problem, [i, k])
            ax.set_title(_shown(change, problem), loc="left")
            if place + columns >= len(places):
                ax.set_xlabel(better(goals[i]))
                ax.tick_params(labelbottom=True)
            if place % columns == 0 or shared != "all":
                ax.set_ylabel(better(goals[k]))
        for ax in grid[len(places) :]:
            ax.remove()
        handles, names = grid[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper left", ncols=2 if columns == 1 else 4, frameon=False, handletextpad=0.3)
    return figure


def _shown(change: Change, problem: str) -> str:
    """The name of a problem whose label is an address of code; else the label."""
    source = change.simulated[problem].source
    return source.name if source is not None and ".py:" in problem else problem


def _draw(ax: Any, change: Change, problem: str, pair: Sequence[int]) -> None:
    """The fronts of one problem, in two objectives."""
    nominal, front = change.nominal, change.simulated[problem]
    feasible = front.status == CONVERGED
    again = change.found.get(problem, nominal[:0])
    for name, points, look in (
        ("nominal front", nominal[nominal.status == CONVERGED], NOMINAL),
        ("simulated under these data", front[feasible], SIMULATED),
        ("those not feasible", front[~feasible], INFEASIBLE),
        ("found under these data", again[representatives(again, MANY)], FOUND),
    ):
        ax.plot(*points.objectives[:, pair].T, ls="", label=name, **look)
