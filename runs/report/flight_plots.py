"""Figures of the states and controls of a few points of a front, beside known optimal laws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from textwrap import fill, wrap
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.evaluation.evaluator import CONVERGED
from macs.front import Front
from macs.fronts.pictures.flight_plot import along, quantities
from macs.fronts.pictures.style import COLORS, axis_label, title_and_legend
from macs.fronts.point import Point
from macs.pareto.spread import spread

from ..measures.indicators import normalised
from .plots import COLUMN, PAGE, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from transcription.trajectories.trajectory import Trajectory

Law = Mapping[str, np.ndarray]
"""A known optimal flight: "time" (n,) and values (n,) by name, in the units of the problem, as `goddard.optimal_flight` has it."""

Track = Callable[[Mapping[str, np.ndarray]], Mapping[str, np.ndarray]]
"""(values of a flight by name) -> {label: values across, label: values up}."""

Laws = Mapping[str, Sequence[Law | None]]
"""{name of a law: its flight for each point, None where it has none}."""

DASHES: Sequence[Any] = ((0, (4, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))
"""Of the first laws, the second, ..."""


LABEL = 14
"""Most characters on a line of a vertical label."""


def representatives(front: Front, count: int = 4) -> list[int]:
    """Numbers of `count` converged points that stand for a front: the best of each objective, and others spread evenly between them."""
    good = np.flatnonzero(front.status == CONVERGED)
    F = front.F[good]
    if len(F) <= count:
        return good.tolist()
    return sorted(good[spread(normalised(F, F)[0], count)].tolist())


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
            # A long label on one line would run into those above and below.
            ax.set_ylabel(fill(axis_label(name, units.get(name, "")), LABEL, break_long_words=False, break_on_hyphens=False))
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
