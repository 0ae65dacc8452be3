"""Figures of trajectories: states, controls and path constraints over time, then costates and the Hamiltonian of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Limit, Variable
from transcription.trajectories.costates import has_length

from ...io.text import html_block, html_table, per
from .style import (
    COLORS,
    GREY,
    beside,
    blank_figure,
    caption,
    draw_limits,
    figure_title,
    hollow,
    interval,
    note_above,
    panel_grid,
    plain,
    rendered,
    styled,
    time_label,
    wrapped,
)

if TYPE_CHECKING:
    from transcription.trajectories.costates import Costates, PhaseCostates
    from transcription.trajectories.trajectory import PhaseTrajectory, Trajectory

DENSE = np.linspace(-1.0, 1.0, 41)
"""Points in [-1, 1] of each element at which its polynomials are drawn."""
MOST_DOTS = 60
"""Most nodes of a phase that are drawn as dots: more would hide the line."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """A trajectory in a panel."""

    trajectory: Trajectory
    color: str = ""  # of all its phases, the ends of which are dots then. Default: a colour for each phase, and dots at nodes.
    hollow: bool = False  # whether the dots at nodes are hollow, and drawn in any case: of a trajectory that is not verified


def draw_flight(
    trajectory: Trajectory, title: str, figure: Any = None, costates: Costates | None = None, hollow: bool = False
) -> np.ndarray:
    """Axes, one for each panel, with all phases on one time axis: a panel for each state, control and path constraint; from a new row on,
    if there are any, one for each costate and one for the Hamiltonian.

    Lines are the polynomials of the transcription on each element, so that jumps are visible; dots are its nodes, unless there are many.
    Dashed lines are bounds and limits, if they are not too far from the values; the text above each panel always gives them. A constant is
    drawn within its bounds, or on a range about it. Costates and the Hamiltonian are of the sum of the objectives times their weights,
    which are above the latter.
    """
    with styled():
        panels = quantities(trajectory)
        least = {} if costates is None else costate_ranges(trajectory, costates)
        states = [name for name, kind in panels if kind == "state" and name in least]
        groups = [len(panels)] if costates is None else [len(panels), len(states) + 1]
        figure, axes = panel_grid(figure, groups)
        for ax, (name, kind) in zip(axes, panels, strict=False):
            draw_panel(ax, [Drawn(trajectory, hollow=hollow)], name, kind)
        if costates is not None:
            _draw_costates(axes[len(panels) :], trajectory, costates, least, states)
        for ax in axes:
            for phase in trajectory.phases[1:]:
                ax.axvline(phase.t0, color=GREY, lw=0.7, ls=":")
        _draw_time_axis(figure, axes, trajectory.phases)
        if len(trajectory) > 1:
            from matplotlib.lines import Line2D

            names = [phase.name if has_length(trajectory, phase) else f"{phase.name} (no length)" for phase in trajectory.phases]
            handles = [Line2D([], [], color=COLORS[k % len(COLORS)], marker=".", label=plain(name)) for k, name in enumerate(names)]
            figure.legend(handles=handles, loc="outside upper right", ncols=min(len(handles), 6), frameon=False)
        figure_title(figure, title)
    return axes


def draw_flights(points: Sequence[Any], figure: Any = None) -> np.ndarray:
    """Axes, one for each state, control and path constraint, with the trajectories of some points over time.

    Dashed lines are bounds and limits, as of one trajectory alone. A dot is the end of a phase that another one follows. Nodes are hollow
    dots where a trajectory is not verified. Shorter trajectories are above longer ones. The legend has each point's number and objectives.
    """
    from matplotlib.lines import Line2D

    if not 1 <= len(points) <= len(COLORS):
        raise ValueError(f"trajectories of one to {len(COLORS)} points can be told apart in a picture, not of {len(points)}")
    without = [point.index for point in points if point.trajectory is None]
    if without:
        raise ValueError(f"point {without[0]} has no trajectory: its problem has none, or its evaluation failed")
    drawn = [Drawn(point.trajectory, color, hollow(point)) for point, color in zip(points, COLORS, strict=False)]
    over = sorted(drawn, key=lambda one: one.trajectory.phases[-1].tf, reverse=True)
    panels = list(dict.fromkeys(panel for one in drawn for panel in quantities(one.trajectory)))
    with styled():
        figure, axes = panel_grid(figure, [len(panels)], above=0.4 + 0.2 * len(points))
        for ax, (name, kind) in zip(axes, panels, strict=True):
            draw_panel(ax, over, name, kind)
        _draw_time_axis(figure, axes, [phase for one in drawn for phase in one.trajectory.phases])
        named = [wrapped(plain(f"#{point.index}: {caption(point)}"), figure.get_figwidth() - 0.6, 8.0) for point in points]
        lines = [Line2D([], [], color=one.color, lw=1.5, label=words) for one, words in zip(drawn, named, strict=True)]
        figure.legend(handles=lines, loc="outside upper left", frameon=False)
    return axes


def _draw_time_axis(figure: Any, axes: np.ndarray, phases: Sequence[PhaseTrajectory]) -> None:
    """The label of the time axis, and its range over some phases."""
    figure.supxlabel(time_label(phases), fontsize=9)
    figure.align_ylabels()
    first, last = min(phase.t0 for phase in phases), max(phase.tf for phase in phases)
    margin = 0.015 * (last - first) or 1.0  # phases without duration are seen, too
    axes[0].set_xlim(first - margin, last + margin)


def _draw_costates(
    axes: np.ndarray, trajectory: Trajectory, costates: Costates, least: Mapping[str | None, float], states: Sequence[str]
) -> None:
    """Draw the costates of these states over time, one on each of the axes, and the Hamiltonian on the last one, in the `least` ranges at
    least. Those of phases without length are left out."""
    for ax, name in zip(axes, [*states, None], strict=True):
        everything: list[np.ndarray] = []
        units: list[str] = []
        for k, phase in enumerate(trajectory.phases):
            if not has_length(trajectory, phase):
                continue
            own, color = costates[phase.name], COLORS[k % len(COLORS)]
            if name is None:
                values = own.hamiltonian
                units.append(phase.time_unit)
                ax.plot(phase.time, values, color=color, lw=1.0)
            elif name in own:
                values = own[name]
                units.append(next(v.unit for v in phase.state_variables if v.name == name))
                times, line = _dense(own.polynomial.edges, own.polynomial.on_element, own.names.index(name), None)
                ax.plot(times, line, color=color, lw=1.3)
                everything.append(line[np.isfinite(line)])
            else:
                continue
            _dots(ax, phase.time, values, color)
            everything.append(values)
        drawn = np.concatenate(everything)
        middle, half = 0.5 * (drawn.max() + drawn.min()), 0.5 * max(float(np.ptp(drawn)), least[name], 1e-12)
        ax.set_ylim(middle - 1.12 * half, middle + 1.12 * half)
        unit = per(units[0]) if len(set(units)) == 1 else ""
        ax.set_ylabel(beside("Hamiltonian" if name is None else f"costate of {name}", unit))
    weights = ", ".join(f"{weight:.3g}" for weight in costates.weights)
    note_above(axes[-1], f"weights of the objectives: {weights}")
    left_out = [phase.name for phase in trajectory.phases if not has_length(trajectory, phase)]
    if left_out:
        words = f"no costates of {', '.join(left_out)}: without length"
        note_above(axes[0], plain(words))


def _dots(ax: Any, times: np.ndarray, values: np.ndarray, color: str, hollow: bool = False) -> None:
    """Nodes as dots, if there are not too many; hollow ones in any case, but no more than that."""
    if hollow:
        every = -(-len(values) // MOST_DOTS)
        ax.plot(times, values, "o", color=color, ms=3.2, mfc="white", mew=0.7, markevery=every, zorder=3)
    elif len(values) <= MOST_DOTS:
        ax.plot(times, values, ".", color=color, ms=3.5)


def _range_of(phase: PhaseTrajectory, name: str) -> np.ndarray:
    """Values of a state; two values a thousandth of its bounds apart if it moves less."""
    values, variable = phase[name], next(v for v in phase.state_variables if v.name == name)
    least = 1e-3 * variable.span
    return values if np.ptp(values) >= least else np.array([0.0, least])


def costate_ranges(trajectory: Trajectory, costates: Costates) -> dict[str | None, float]:
    """The least range in which the costate of each state is drawn, and the Hamiltonian (None): less is round-off."""
    phases = [phase for phase in trajectory.phases if has_length(trajectory, phase)]
    # Two hundredths of what all costates are worth: less is round-off.
    worth = 0.02 * max(_worth(phase, costates[phase.name]) for phase in phases)
    names = dict.fromkeys(name for phase in phases for name in costates[phase.name])
    ranges: dict[str | None, list[np.ndarray]] = {
        **{name: [_range_of(phase, name) for phase in phases if name in costates[phase.name]] for name in names},
        None: [phase.time for phase in phases],
    }
    spans = {name: float(np.ptp(np.concatenate(values))) for name, values in ranges.items()}
    return {name: worth / span if span > 0 else 0.0 for name, span in spans.items()}


def _worth(phase: PhaseTrajectory, costates: PhaseCostates) -> float:
    """How much the largest costate of each state is worth over the range of the state, all states together."""
    return float(np.abs(costates.at_nodes).max(axis=0, initial=0.0) @ np.ptp(phase.states, axis=0))


QUANTITIES = {"state": "state_variables", "control": "control_variables", "path": "path_limits"}
"""Kinds of quantities, and the attribute of a phase that has all of a kind."""


def quantities(trajectory: Trajectory) -> list[tuple[str, str]]:
    """Names of all states, then controls, then path constraints, each once, with their kind: "state", "control" or "path"."""
    found = [(one.name, kind) for kind, those in QUANTITIES.items() for phase in trajectory.phases for one in getattr(phase, those)]
    return list(dict.fromkeys(found))


def along(phase: PhaseTrajectory, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a state or control along every element, with gaps (NaN) between elements; of a path constraint at the nodes."""
    for variables, on_element in ((phase.state_variables, phase.state.on_element), (phase.control_variables, phase.controls_on)):
        for index, variable in enumerate(variables):
            if variable.name == name:
                return _dense(phase.state.edges, on_element, index, variable.period)
    return phase.time, phase[name]


def draw_panel(ax: Any, drawn: Sequence[Drawn], name: str, kind: str) -> None:
    """Draw a quantity of `quantities` of one trajectory or several over time, with its limits, label, and bounds as text."""
    values: list[np.ndarray] = []
    held: dict[tuple[float, float], list[PhaseTrajectory]] = {}
    owners: list[Variable | Limit] = []
    for one in drawn:
        for k, phase in enumerate(one.trajectory.phases):
            owner = next((owner for owner in getattr(phase, QUANTITIES[kind]) if owner.name == name), None)
            if owner is None:
                continue
            color = one.color or COLORS[k % len(COLORS)]
            nodes, (times, line) = phase[name], along(phase, name)
            ax.plot(times, line, color=color, lw=0.9 if kind == "path" and not one.color else 1.3)
            values += [line[np.isfinite(line)], nodes]
            if one.hollow or not one.color:
                _dots(ax, phase.time, nodes, color, one.hollow)
            if one.color and phase is not one.trajectory.phases[-1]:
                ax.plot(phase.time[-1:], nodes[-1:], "o", color=color, ms=4.0)
            held.setdefault((owner.lower, owner.upper), []).append(phase)
            owners.append(owner)
    limits = [
        ((min(phase.t0 for phase in phases), max(phase.tf for phase in phases)), lower, upper) for (lower, upper), phases in held.items()
    ]
    draw_limits(ax, np.concatenate(values), limits)
    ax.set_ylabel(beside(name, owners[0].unit))
    note_above(ax, "; ".join(dict.fromkeys(interval(owner.lower, owner.upper) for owner in owners)))


def _dense(
    edges: np.ndarray, on_element: Callable[[int, np.ndarray], np.ndarray], index: int, period: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """Times and values along every element, with gaps (NaN) between elements and where a periodic value wraps around."""
    gap = np.array([np.nan])
    times: list[np.ndarray] = []
    values: list[np.ndarray] = []
    for j, (left, right) in enumerate(pairwise(edges)):
        line = on_element(j, DENSE)[:, index]
        if period:
            line = np.where(np.append(np.abs(np.diff(line)) > 0.5 * period, False), np.nan, line)
        times += [0.5 * (left + right) + 0.5 * (right - left) * DENSE, gap]
        values += [line, gap]
    return np.concatenate(times), np.concatenate(values)


# For notebooks


def point_html(point: Any) -> str:
    """HTML of a point: a row for each objective, as found and as simulated, and its states, controls and path constraints over time."""
    simulated = point.simulated
    heads = ["objective", "", "value", *(["simulated"] if simulated is not None else [])]
    rows = [
        [goal.name, f"{goal.sense[:3]} [{goal.unit or '-'}]", *values]
        for goal, *values in zip(point.goals, point.texts, *([point._points.texts(simulated.values())] if simulated else []), strict=True)
    ]
    state = {None: "not simulated", True: "verified", False: "not verified"}[point.verified]
    about = [f"{point.status}, {state}; violation {point.violation:.1e}"]
    if point.parameters and point.trajectory is not None:
        about.append("parameters: " + ", ".join(f"{name} {value:.6g}" for name, value in point.parameters.items()))
    about += [point.note] if point.note else []
    picture, figure = b"", blank_figure()
    # A point with more panels is shown by its table alone.
    if point.trajectory is not None and len(quantities(point.trajectory)) <= 24:
        draw_flight(point.trajectory, "", figure, hollow=hollow(point))
        picture = rendered(figure, "png", 55)
    elif not point.dynamic:
        point.plot(figure)
        picture = rendered(figure, "png", 55)
    table = html_table([heads], rows, [True, True, *[False] * (len(heads) - 2)])
    return html_block(f"Point {point.index}", table, about, picture, f"point {point.index}: {point.title}")
