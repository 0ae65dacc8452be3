"""Points that stand for a front: their trajectories, beside optimal ones that are known, or their variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from textwrap import fill, wrap
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.evaluation.evaluator import CONVERGED
from macs.front import Front
from macs.fronts.pictures.flight_plot import along, quantities
from macs.fronts.pictures.front_plot import draw_designs
from macs.fronts.pictures.style import COLORS, axis_label, blank_figure, quantity, time_label
from macs.fronts.point import Point
from macs.io.text import label
from macs.pareto.spread import spread

from ..measures.indicators import normalised, pieces
from ..measures.references import module_of
from .comparison import Comparison
from .plots import COLUMN, PAGE, front_figure, legend, new_figure, style
from .tables import Cell, Head, Table, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from transcription.trajectories.trajectory import PhaseTrajectory

Derived = Callable[[Mapping[str, np.ndarray]], Mapping[str, np.ndarray]]
"""What a case makes of values (n,) by name of state: values by the label of an axis."""
Law = Mapping[str, np.ndarray]
"""A known optimal flight: "time" (n,) and values (n,) by name, in the units of the problem, as `goddard.optimal_flight` has it."""
NO_BREAK = "\N{NO-BREAK SPACE}"
LAW_LOOK: Mapping[str, Any] = {"color": "black", "lw": 0.9, "ls": (0, (4, 2))}


def representatives(front: Front, count: int = 4) -> list[int]:
    """Numbers of `count` converged points that stand for a front: the best of each objective, and others spread evenly between them."""
    good = np.flatnonzero(front.status == CONVERGED)
    F = front.F[good]
    if len(F) <= count:
        return good.tolist()
    return sorted(good[spread(normalised(F, F)[0], count)].tolist())


@dataclass(frozen=True, eq=False)
class Flights:
    """Representative trajectories of the front of one solver."""

    comparison: Comparison
    solver: str  # the first solver that found points
    front: Front  # that of all its runs together
    case: SimpleNamespace | None  # the module of the problem, see `references.module_of`

    @classmethod
    def of(cls, comparison: Comparison) -> Flights | None:
        """The representatives of a comparison; None if no solver found a trajectory."""
        for solver in comparison.runs:
            front = comparison.merged(solver)
            if front is not None and front[0].trajectory is not None:
                return cls(comparison, solver, front, _case_of(front[0]))
        return None

    @cached_property
    def points(self) -> list[Point]:
        """The representative points."""
        return [self.front[i] for i in representatives(self.front)]

    def table(self) -> Table:
        """Their objectives; with two of them, the best of the second that is known for the first."""
        goals = self.comparison.known.goals
        lines = pieces(self.comparison.against.front)
        curve = lines[0] if len(lines) == 1 else None
        heads: list[Head | str] = ["solution", *(Head(label(goal.name, goal.unit), digits=7) for goal in goals)]
        if curve is not None:
            heads += [Head(label(f"{goals[1].name} of {self._truth}", goals[1].unit), digits=7), "short of it, of the range"]
        rows: list[list[Cell]] = [[f"point {i}", *one.objectives.values(), *_beside(one, curve)] for i, one in enumerate(self.points, 1)]
        notes = [f"Of {self.solver}, all runs together."]
        if curve is not None and any(isinstance(row[-1], float) and row[-1] < -1e-6 for row in rows):
            notes.append(
                f"Negative: better than the {self._truth}, by the errors of the mesh and of the curve through it; see macs verify."
            )
        return table(heads, rows, f"{self.comparison.name}: representative solutions of the front.", notes)

    def figures(self) -> dict[str, Figure]:
        """{name of a file: figure}."""
        law: Callable[[float], Law] | None = getattr(self.case, "optimal_flight", None)
        laws = [law(float(point.trajectory.phases[-1].time[-1])) if law and point.trajectory else None for point in self.points]
        name, track = getattr(self.case, "LAW", "known law"), getattr(self.case, "track", None)
        derived: Derived | None = getattr(self.case, "derived", None)
        found = dict[str, Any]()
        if len(self.comparison.known.goals) > 1:
            found["representatives"] = front_figure(
                {self.solver: self.comparison.fronts[self.solver]},
                goals=self.comparison.known.goals,
                reference=None if self.comparison.against.alone else self.comparison.against.front,
                marked=np.array([list(point.objectives.values()) for point in self.points]),
                truth_name=self._truth,
            )
        if track is not None:
            found["paths"] = paths_figure(self.points, track, laws=laws, law_name=name)
        found["flights"] = flights_figure(self.points, laws=laws, law_name=name, solver=self.solver, derived=derived)
        return found | case_figures([self.front[i] for i in representatives(self.front, 100)])

    @property
    def _truth(self) -> str:
        return "truth" if self.comparison.against.true else "reference"


def _beside(point: Point, curve: np.ndarray | None) -> list[Cell]:
    """The second objective of a reference at the first of a point, and how much worse the point is, in ranges."""
    if curve is None:
        return []
    signs = [goal.sign for goal in point.goals]
    first, second = (sign * value for sign, value in zip(signs, point.objectives.values(), strict=True))
    known = float(np.interp(first, *curve.T))
    return [signs[1] * known, (second - known) / float(np.ptp(curve[:, 1]))]


def _case_of(point: Point) -> SimpleNamespace | None:
    """The module of a point's problem, if that is a case, see `references.module_of`."""
    address = point.source.address if point.source is not None else ""
    return module_of(address) if address and not address.rpartition(":")[0].endswith(".py") else None


def case_figures(points: Sequence[Point]) -> dict[str, Figure]:
    """{name of a file: figure} that the case of some points draws of them; none if it draws nothing."""
    plot = getattr(_case_of(points[0]), "plot", None)
    with style():
        return {} if plot is None else plot(points)


@dataclass(frozen=True, eq=False)
class VariablesAlongFront:
    """The variables along the front of one solver on a vector problem."""

    solver: str  # the first solver that found points
    front: Front  # that of all its runs together

    @classmethod
    def of(cls, comparison: Comparison) -> VariablesAlongFront | None:
        """The front of a comparison; None if no solver found a point of a vector problem."""
        for solver in comparison.runs:
            front = comparison.merged(solver)
            if front is not None and front.source is not None and front.source.vector:
                return cls(solver, front)
        return None

    def table(self) -> Table:
        """Objectives and variables of six points."""
        names = [label(goal.name, goal.unit) for goal in self.front.goals] + [label(one.name, one.unit) for one in self.front.variables]
        heads: list[Head | str] = ["solution", *(Head(name, digits=5) for name in names)]
        numbers = representatives(self.front, 6)
        rows: list[list[Cell]] = [[f"point {i}", *self.front.objectives[i].tolist(), *self.front.decision[i].tolist()] for i in numbers]
        return table(heads, rows, f"Points that stand for the front of {self.solver}.")

    def figures(self) -> dict[str, Figure]:
        """{name of a file: figure}: each variable along the front."""
        figure = blank_figure()
        draw_designs(self.front, f"{self.solver}: variables along the front of all runs", figure)
        return {"variables": figure}


def flights_figure(
    points: Sequence[Point],
    *,
    laws: Sequence[Law | None] = (),
    law_name: str = "",
    solver: str = "",
    names: Sequence[str] = (),
    derived: Derived | None = None,
) -> Figure:
    """A column for each point, a row for each state, what is derived of them, and each control over time, with the optimal law of each as a
    dashed line where there is one; the point's number, from 1, and its objectives above."""
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MaxNLocator

    flights = [point.trajectory for point in points if point.trajectory is not None]
    kinds, lines_of = dict(quantities(flights[0])), [[_lines(phase, derived) for phase in flight.phases] for flight in flights]
    more = [name for name in lines_of[0][0] if name not in kinds]
    rows = [*(name for name, kind in kinds.items() if kind == "state"), *more, *(name for name, kind in kinds.items() if kind == "control")]
    units = {v.name: v.unit for phase in flights[0].phases for v in (*phase.state_variables, *phase.control_variables)}
    with style():
        figure = new_figure(PAGE, 1.0 * len(rows) + 0.75)
        grid = figure.subplots(len(rows), len(points), squeeze=False, sharex="col", sharey="row")
        for column, (point, phases, law) in enumerate(zip(points, lines_of, laws or [None] * len(points), strict=True)):
            known = None if law is None else {**law, **(derived(law) if derived else {})}
            for ax, name in zip(grid[:, column], rows, strict=True):
                for k, found in enumerate(phases):
                    if name in found:
                        ax.plot(*found[name], color=COLORS[k % len(COLORS)], lw=1.3)
                if known is not None and name in known:
                    ax.plot(known["time"], known[name], **LAW_LOOK, zorder=3)
                ax.margins(x=0.0)
            title = _title(names[column] if names else f"point {column + 1}", point, min(round(75 / len(points)) + 10, 110 // len(points)))
            grid[0, column].set_title(title, loc="left", fontsize=6.5)
        for ax, name in zip(grid[:, 0], rows, strict=True):
            # A long label on one line would run into those above and below: at most 14 characters.
            ax.set_ylabel(fill(axis_label(name, units.get(name, "")), 14, break_long_words=False, break_on_hyphens=False))
            ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        for ax in grid[-1]:
            ax.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        figure.align_ylabels(grid[:, 0])
        figure.supxlabel(time_label(flights[0].phases), fontsize=8)
        lawful = any(law is not None for law in laws)
        lines = list(flights[0]) if len(flights[0]) > 1 else [solver or "found"] if solver or lawful else []
        handles = [Line2D([], [], color=COLORS[k % len(COLORS)], lw=1.3, label=name) for k, name in enumerate(lines)]
        handles += [Line2D([], [], **LAW_LOOK, label=law_name)] if lawful else []
        if handles:
            figure.legend(handles=handles, loc="outside upper right", ncols=len(handles), frameon=False)
    return figure


def paths_figure(points: Sequence[Point], track: Derived, *, laws: Sequence[Law | None] = (), law_name: str = "") -> Figure:
    """The paths of points in a plane: the first of what `track` makes of their states over the second, by label; with the optimal law of
    each as a dashed line where there is one."""
    with style():
        figure = new_figure(COLUMN, 2.6)
        ax = figure.subplots()
        for number, (point, color) in enumerate(zip(points, COLORS, strict=False), 1):
            for k, phase in enumerate(point.trajectory.phases if point.trajectory is not None else ()):
                labels, places = zip(*track({name: values for name, (_, values) in _lines(phase).items()}).items(), strict=True)
                # The first above those that go on.
                ax.plot(*places, color=color, lw=1.8, zorder=3.0 - 0.1 * number, label=None if k else f"point {number}")
                ax.plot(*(values[np.isfinite(values)][-1:] for values in places), "o", color=color, ms=3.5, zorder=4)
        for law in filter(None, laws):
            ax.plot(*track(law).values(), **LAW_LOOK, zorder=3, label=law_name if law is laws[0] else None)
        ax.set(xlabel=labels[0], ylabel=labels[1])
        wide, high = np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())
        if max(wide, high) < 3.0 * min(wide, high):  # where directions can be seen
            ax.set_aspect("equal", adjustable="datalim")
        legend(figure, ax)
    return figure


def _lines(phase: PhaseTrajectory, derived: Derived | None = None) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """{name: times and values} of states, controls and what is derived of states, along every element."""
    found = {one.name: along(phase, one.name) for one in (*phase.state_variables, *phase.control_variables)}
    times = found[phase.state_variables[0].name][0]
    states = {one.name: found[one.name][1] for one in phase.state_variables}
    return found | {name: (times, values) for name, values in (derived(states) if derived else {}).items()}


def _title(name: str, point: Point, width: int) -> str:
    """The point's name and objectives, in lines of at most `width` characters."""
    lines = [f"{goal.name} {quantity(text, goal.unit).replace(' ', NO_BREAK)}" for goal, text in zip(point.goals, point.texts, strict=True)]
    return "\n".join(part for line in [name, *lines] for part in wrap(line, width))
