"""Dispersions: points of a front through many cases with random data, as their case flies them, beside their nominal objectives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.front import Front
from macs.fronts.pictures.style import COLORS, axis_label

from ...files import errors_begin_with
from ...measures.references import module_of
from ..comparison import Comparison
from ..flight_plots import representatives
from ..plots import PAGE, new_figure, style
from ..tables import Cell, Head, Table, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from problems.compiled import CompiledProblem
    from problems.vector import CompiledVectorProblem

MANY = 100
"""Most points of a front that are flown."""
WIDE = 10.0
"""Ratio of the largest and the smallest value from which on an axis is logarithmic."""
LOOKS: Sequence[Mapping[str, Any]] = (
    {"marker": "o", "ms": 2.0, "mew": 0, "color": "black", "zorder": 3},
    {"marker": "v", "ms": 3.0, "mew": 0.6, "mfc": "none", "color": COLORS[1], "zorder": 2},
    {"marker": "o", "ms": 3.0, "mew": 0.6, "mfc": "none", "color": COLORS[0], "zorder": 2},
)


def settings_of(given: Any, address: str) -> Any:
    """The dispersions that a study states, for a case: see `references.module_of`."""
    place = address.rpartition(":")[0]
    case = module_of(address) if address and not place.endswith(".py") else None
    kind = getattr(case, "Dispersions", None)
    if kind is None or not hasattr(case, "dispersed"):
        raise ValueError("its case does not say what becomes of its points under dispersions")
    if not isinstance(given, Mapping):
        raise ValueError(f"must be a table of settings, not {given!r}")
    try:
        return kind(**given)
    except TypeError as error:
        raise ValueError(str(error)) from error


def check(given: Any, problems: Mapping[str, CompiledProblem | CompiledVectorProblem]) -> None:
    """Raise ValueError unless the cases of all problems know dispersions, with these settings."""
    for name, problem in problems.items():
        with errors_begin_with(f"dispersions: problem '{name}'"):
            settings_of(given, problem.address)


@dataclass(frozen=True, eq=False)
class DispersedFront:
    """Points of the front of one solver under dispersions."""

    name: str  # name, solver: Of the comparison, and of the solver; the points are of all its runs together
    solver: str
    points: Front  # n points that stand for the front
    settings: Any  # the dispersions, of the case's own kind
    # Of the nominal case first, then of all cases, for each way to fly them.
    measures: Mapping[str, Sequence[Mapping[tuple[str, str], float | None]]]

    def tables(self) -> dict[str, Table]:
        """{name of a file: table}, one for each way to fly: a row for each point, its objectives as found and the measures of its cases."""
        return {f"{self.name}-{self.solver}-dispersed-{way}": self._table(way) for way in [*self.measures][1:]}

    def figures(self) -> dict[str, Figure]:
        """{name of a file: figure} of each measure along the front."""
        return {f"{self.name}-{self.solver}-dispersed": dispersed_figure(self)}

    def _table(self, way: str) -> Table:
        goals, measured = self.points.goals, self.measures[way]
        heads: list[Head | str] = ["point", *(Head(f"nominal {goal.name}", goal.unit, digits=5) for goal in goals)]
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
    if given is None:
        return []
    found = []
    for comparison in comparisons:
        for solver in comparison.runs:
            fronts = [front for front in comparison.fronts[solver] if len(front)]
            if not fronts:
                continue
            whole = Front.merge(fronts) if len(fronts) > 1 else fronts[0]
            some = whole[representatives(whole, MANY)]
            address = some.source.address if some.source is not None else ""
            settings = settings_of(given, address)
            flown = module_of(address).dispersed(some, settings)
            ways = {way: [one[way].measures() for one in flown] for way in flown[0]}
            found.append(DispersedFront(comparison.name, solver, some, settings, ways))
    return found


def dispersed_figure(found: DispersedFront) -> Figure:
    """Each measure over the first objective, in a panel of its own: nominal, and of the cases flown in each way."""
    goal = found.points.goals[0]
    across = found.points.objectives[:, 0]
    panels = [*next(iter(found.measures.values()))[0]]
    columns = 3
    rows = -(-len(panels) // columns)
    with style():
        figure = new_figure(PAGE, 1.9 * rows + 0.4)
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
        for place, (ax, (name, unit)) in enumerate(zip(grid, panels, strict=False)):
            for (way, measured), look in zip(found.measures.items(), LOOKS, strict=False):
                values = np.array([np.nan if one[name, unit] is None else one[name, unit] for one in measured], dtype=float)
                ax.plot(across, values, ls="", label=way, **look)
            low, high = ax.dataLim.intervaly
            if low > 0.0 and high > WIDE * low:
                ax.set_yscale("log")
            ax.set_title(axis_label(name, unit), loc="left")
            if place + columns >= len(panels):
                ax.set_xlabel(axis_label(goal.name, goal.unit))
                ax.tick_params(labelbottom=True)
        for ax in grid[len(panels) :]:
            ax.remove()
        handles, names = grid[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper left", ncols=3, frameon=False, handletextpad=0.3)
    return figure
