"""Points that stand for a front: their trajectories, beside known optimal laws and each objective optimised alone, or their variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill, wrap
from types import MappingProxyType, SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.evaluation.evaluator import CONVERGED
from macs.front import Front
from macs.fronts.pictures.flight_plot import along, quantities
from macs.fronts.pictures.front_plot import draw_designs
from macs.fronts.pictures.style import COLORS, axis_label, blank_figure, title_and_legend
from macs.fronts.point import Point
from macs.gradient_tools import payoff
from macs.io.text import label
from macs.pareto.spread import spread
from macs.refinement.mesh_search import default_transcription
from problems import load
from transcription import SingleShooting, from_dict, word

from ..measures.indicators import normalised, pieces, truth
from ..measures.references import module_of
from .comparison import Comparison
from .plots import COLUMN, PAGE, front_figure, new_figure, style
from .tables import Cell, Head, Table, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from transcription.trajectories.trajectory import Trajectory

Law = Mapping[str, np.ndarray]
"""A known optimal flight: "time" (n,) and values (n,) by name, in the units of the problem, as `goddard.optimal_flight` has it."""
Laws = Mapping[str, Sequence[Law | None]]
"""{name of a law: its flight for each point, None where it has none}."""
Track = Callable[[Mapping[str, np.ndarray]], Mapping[str, np.ndarray]]
"""(values of a flight by name) -> {label: values across, label: values up}."""

KNOWN_LAW, ALONE = "known law", "single objective"
"""Names of the dashed and dotted lines; a case may have a `LAW` of its own."""
DASHES: Sequence[Any] = ((0, (4, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))
"""Of the first laws, the second, ..."""


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
    solver: str  # the first solver that found points; the front is that of all its runs together
    points: tuple[Point, ...]
    many: Sequence[Point]  # up to a hundred of that front, for pictures of a population
    case: SimpleNamespace | None  # the module of the problem, see `references.module_of`
    laws: Laws
    # The optimum of each objective alone, by gradients, on the same transcription unless it is unsuited to them; empty if there is none.
    ends: Front
    note: str  # why there are no ends; usually empty

    @classmethod
    def of(cls, comparison: Comparison) -> Flights | None:
        """The representatives of a comparison; None if no solver found a trajectory."""
        for solver in comparison.runs:
            front = comparison.merged(solver)
            if front is not None and front[0].trajectory is not None:
                points, many = (tuple(front[i] for i in representatives(front, count)) for count in (4, 100))
                address = front.source.address if front.source is not None else ""
                case = module_of(address) if address and not address.rpartition(":")[0].endswith(".py") else None
                known = _known_ends(comparison)
                ends, note = (known, "") if known is not None else _ends(front)
                laws = {getattr(case, "LAW", KNOWN_LAW): _laws(case, points), ALONE: _alone(points, ends)}
                return cls(comparison, solver, points, many, case, laws, ends, note)
        return None

    def table(self) -> Table:
        """Their objectives; with two of them, the best of the second that is known for the first; and each objective alone."""
        goals = self.comparison.known.goals
        R = truth(self.comparison.against.front)
        curve = R if len(pieces(R)) == 1 else None  # the reference, minimised, where it is one curve of two objectives
        heads: list[Head | str] = ["solution", *(Head(label(goal.name, goal.unit), digits=7) for goal in goals)]
        if curve is not None:
            heads += [Head(label(f"{goals[1].name} of {self._truth}", goals[1].unit), digits=7), "short of it, of the range"]
        names = [*(f"point {number}" for number in range(1, len(self.points) + 1)), *(f"{goal.name} alone" for goal in goals)]
        # There may be no ends.
        named = zip(names, (*self.points, *self.ends), strict=False)
        rows: list[list[Cell]] = [[name, *point.objectives.values(), *_beside(point, curve)] for name, point in named]
        notes = [f"Of {self.solver}, all runs together."]
        if len(self.ends):
            method = from_dict(self.ends[0].transcription or {})
            notes[0] += f" Alone: one objective optimised by gradients on {word(method) or 'the same mesh'}."
        if curve is not None and any(isinstance(row[-1], float) and row[-1] < -1e-6 for row in rows):
            notes.append(
                f"Negative: better than the {self._truth}, by the errors of the mesh and of the curve through it; see macs verify."
            )
        notes += [self.note] if self.note else []
        return table(heads, rows, f"{self.comparison.name}: representative solutions of the front.", notes)

    def figures(self) -> dict[str, Figure]:
        """{name of a file: figure}."""
        found = {
            "representatives": front_figure(
                {self.solver: self.comparison.fronts[self.solver]},
                goals=self.comparison.known.goals,
                reference=self.comparison.against.front,
                marked=np.array([list(point.objectives.values()) for point in self.points]),
                truth_name=self._truth,
            ),
            "flights": flights_figure(self.points, laws=self.laws, solver=self.solver),
        }
        plot, track = getattr(self.case, "plot", None), getattr(self.case, "track", None)
        if plot is not None and self.many:
            with style():
                found |= plot(self.many)
        if track is not None:
            laws = {name: flights for name, flights in self.laws.items() if name != ALONE}
            alike = _alike([track(time_histories(point)) for point in self.points])
            found["paths"] = paths_figure(self.points, track, laws=laws, equal=alike)
        return found

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


def _alike(tracks: Sequence[Mapping[str, np.ndarray]]) -> bool:
    """Whether tracks are to be drawn to one scale: sides of one unit, of which none is more than four times as long as the other."""
    lengths = [float(np.ptp(np.concatenate([one[side][np.isfinite(one[side])] for one in tracks]))) for side in tracks[0]]
    units = {side.rpartition("[")[2] for side in tracks[0]}
    return len(units) == 1 and max(lengths) <= 4.0 * min(lengths)


def time_histories(point: Point) -> dict[str, np.ndarray]:
    """States and controls of a point by name, and "time", from end to end; NaN between elements, and in phases that do not have them."""
    phases = point.trajectory.phases if point.trajectory is not None else ()
    names = list(dict.fromkeys(v.name for phase in phases for v in (*phase.state_variables, *phase.control_variables)))
    parts: dict[str, list[np.ndarray]] = {name: [] for name in ("time", *names)}
    for phase in phases:
        own = [v.name for v in (*phase.state_variables, *phase.control_variables)]
        times = along(phase, own[0])[0]
        parts["time"].append(times)
        for name in names:
            parts[name].append(along(phase, name)[1] if name in own else np.full(len(times), np.nan))
    return {name: np.concatenate(values) for name, values in parts.items()}


def _known_ends(comparison: Comparison) -> Front | None:
    """The ends that a solver of the comparison found, in the order of the objectives; none where all solvers are gradient tools, whose
    points are optima themselves; None where they are to be found."""
    found = [front for fronts in comparison.fronts.values() for front in fronts if len(front)]
    for front in found:
        if front.solver.get("name") == "payoff" and len(front) == len(front.goals):
            return front[front.F.argmin(axis=0)]
    return found[0][:0] if all(front.solver.get("name") in ("optimize", "payoff", "sweep") for front in found) else None


def _ends(front: Front) -> tuple[Front, str]:
    """Each objective optimised alone, on the transcription of a front or, if that is single shooting, on the case's own; or why not."""
    try:
        problem, method = front.compiled(), from_dict(front[0].transcription or {})
        if isinstance(method, SingleShooting):
            # Its derivatives are dense: with hundreds of nodes they take minutes, and lead nowhere where flights are unstable.
            source = front.source
            if source is None or not source.address:
                return front[:0], "Objectives were not optimised alone: single shooting is not suited to gradients."
            method = default_transcription(load(source.address, **source.data))
    except ValueError as error:
        return front[:0], f"Objectives were not optimised alone: {error}."
    found = payoff(problem, method)
    failed = [goal.name for goal, status in zip(front.goals, found.status, strict=True) if status != CONVERGED]
    return found, f"Alone, {', '.join(failed)} did not converge." if failed else ""


def _laws(place: SimpleNamespace | None, points: Sequence[Point]) -> list[Law | None]:
    """The best flights of the same durations, where the case knows them."""
    law: Callable[[float], Law] | None = getattr(place, "optimal_flight", None)
    if law is None:
        return [None] * len(points)
    return [law(float(point.trajectory.phases[-1].time[-1])) if point.trajectory is not None else None for point in points]


def _alone(points: Sequence[Point], ends: Front) -> list[Law | None]:
    """Beside the best point of each objective, that objective optimised alone."""
    found: list[Law | None] = [None] * len(points)
    for k, end in enumerate(ends):
        if end.status == CONVERGED:
            found[int(np.argmin([point.F[k] for point in points]))] = time_histories(end)
    return found


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


def flights_figure(points: Sequence[Point], *, laws: Laws = MappingProxyType({}), solver: str = "", names: Sequence[str] = ()) -> Figure:
    """A column for each point, a row for each state and control over time; the point's number, from 1, and its objectives above."""
    from matplotlib.ticker import MaxNLocator

    flights = _flights(points, laws)
    rows = [name for name, kind in quantities(flights[0]) if kind != "path"]
    units = {v.name: v.unit for phase in flights[0].phases for v in (*phase.state_variables, *phase.control_variables)}
    with style():
        figure = new_figure(PAGE, 1.0 * len(rows) + 0.75)
        grid = figure.subplots(len(rows), len(points), squeeze=False, sharex="col", sharey="row")
        for column, (point, flight) in enumerate(zip(points, flights, strict=True)):
            for ax, name in zip(grid[:, column], rows, strict=True):
                for k, phase in enumerate(flight.phases):
                    if name in phase.names:
                        ax.plot(*along(phase, name), color=COLORS[k % len(COLORS)], lw=1.3)
                for dashes, beside in zip(DASHES, laws.values(), strict=False):
                    if (law := beside[column]) is not None and name in law:
                        ax.plot(law["time"], law[name], color="black", lw=0.9, ls=dashes, zorder=3)
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
        unit = " | ".join(dict.fromkeys(phase.time_unit for phase in flights[0].phases))
        figure.supxlabel(axis_label("time", unit), fontsize=8)
        _legend(figure, flights[0], [name for name, beside in laws.items() if any(law is not None for law in beside)], solver)
    return figure


def paths_figure(points: Sequence[Point], track: Track, *, laws: Laws = MappingProxyType({}), equal: bool = False) -> Figure:
    """The paths of a few points in one picture: a quantity of the flight over another, a colour each."""
    flights = _flights(points, laws)
    with style():
        figure = new_figure(COLUMN, 2.7)
        ax = figure.subplots()
        for i, flight in enumerate(flights):
            for k, phase in enumerate(flight.phases):
                values = {v.name: along(phase, v.name)[1] for v in (*phase.state_variables, *phase.control_variables)}
                (across, x), (up, y) = track(values).items()
                name = f"point {i + 1}" if k == 0 else None
                # Where paths coincide the first are on top, and a dot marks the end of each.
                look = {"color": COLORS[i % len(COLORS)], "zorder": 3 - 0.1 * i}
                ax.plot(x, y, lw=1.3, label=name, **look)
                if k == len(flight.phases) - 1:
                    end = np.flatnonzero(np.isfinite(x) & np.isfinite(y))[-1]
                    ax.plot(x[end], y[end], "o", ms=4, mec="white", mew=0.4, **look)
        ax.set(xlabel=across, ylabel=up)
        if equal:
            ax.set_aspect("equal", adjustable="datalim")
        for dashes, (name, beside) in zip(DASHES, laws.items(), strict=False):
            lines = [line for law in beside if law is not None and (line := _track(track, law))]
            for i, line in enumerate(lines):
                ax.plot(*line.values(), color="black", lw=0.9, ls=dashes, zorder=4, label=name if i == 0 else None)
        title_and_legend(ax, "")
    return figure


def _track(track: Track, law: Law) -> Mapping[str, np.ndarray]:
    """The track of a law; empty if the law lacks a state or control that it needs."""
    try:
        return track(law)
    except KeyError:
        return {}


def _flights(points: Sequence[Point], laws: Laws) -> list[Trajectory]:
    """The trajectories of points. Raises ValueError if there is one without, or laws that do not fit."""
    if not 1 <= len(points) <= 6:
        raise ValueError(f"flights are drawn side by side of one to six points, not of {len(points)}")
    flights = [point.trajectory for point in points if point.trajectory is not None]
    if len(flights) < len(points):
        number = next(number for number, point in enumerate(points, 1) if point.trajectory is None)
        raise ValueError(f"point {number} of those to draw has no trajectory: it is of a black box or another program, or failed")
    if len(laws) > len(DASHES):
        raise ValueError(f"at most {len(DASHES)} laws are drawn beside points, not {len(laws)}")
    for name, beside in laws.items():
        if len(beside) != len(points):
            raise ValueError(f"{name}: {len(beside)} laws do not stand beside {len(points)} points; give None where there is none")
    return flights


def _title(name: str, point: Point, width: int) -> str:
    """The point's name and objectives, in lines of at most `width` characters."""
    values = {name: f"{value:.5g}".replace("-", "\N{MINUS SIGN}") for name, value in point.objectives.items()}
    lines = [f"{goal.name} {values[goal.name]} {goal.unit}".rstrip() for goal in point.goals]
    return "\n".join(part for line in [name, *lines] for part in wrap(line, width))


def _legend(figure: Any, flight: Any, laws: Sequence[str], solver: str) -> None:
    """Phases if there are several; else the solver, if it is named; and the laws."""
    from matplotlib.lines import Line2D

    named = list(flight) if len(flight) > 1 else [solver] if solver or laws else []
    handles = [Line2D([], [], color=COLORS[k % len(COLORS)], lw=1.3, label=name or "found") for k, name in enumerate(named)]
    handles += [Line2D([], [], color="black", lw=0.9, ls=dashes, label=law) for dashes, law in zip(DASHES, laws, strict=False)]
    if handles:
        figure.legend(handles=handles, loc="outside upper right", ncols=len(handles), frameon=False)
