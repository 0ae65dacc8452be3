"""Figure of a few trajectories of a front, one over the other, a colour each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .flight_plot import PANEL, Drawn, draw_panel, quantities
from .kinds import hollow, remark
from .style import COLORS, STYLE, axis_label, new_figure, plain, raised, wrapped


def draw_flights(points: Sequence[Any], figure: Any = None) -> np.ndarray:
    """Axes, one for each state, control and path constraint, with the trajectories of some points over time.

    Dashed lines are bounds and limits, as of one trajectory alone. A dot is the end of a phase that another one follows. Nodes are hollow
    dots where a trajectory is not verified. Shorter trajectories are above longer ones. The legend has each point's number and objectives.
    """
    import matplotlib
    from matplotlib.lines import Line2D

    if not 1 <= len(points) <= len(COLORS):
        raise ValueError(f"trajectories of one to {len(COLORS)} points can be told apart in a picture, not of {len(points)}")
    without = [point.index for point in points if point.trajectory is None]
    if without:
        raise ValueError(f"point {without[0]} has no trajectory: its problem has none, or its evaluation failed")
    drawn = [Drawn(point.trajectory, color, hollow(point)) for point, color in zip(points, COLORS, strict=False)]
    over = sorted(drawn, key=lambda one: one.trajectory.phases[-1].tf, reverse=True)
    panels = list(dict.fromkeys(panel for one in drawn for panel in quantities(one.trajectory)))
    columns = 1 if len(panels) < 3 else 2 if len(panels) < 9 else 3
    rows = -(-len(panels) // columns)
    size = (PANEL[0] * columns + 0.4, PANEL[1] * rows + 0.4 + 0.2 * len(points))
    with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
        if figure is None:
            figure = new_figure(*size)
        else:
            figure.set_size_inches(*size)
        grid = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
        for ax, (name, kind) in zip(grid, panels, strict=False):
            draw_panel(ax, over, name, kind)
        for ax in grid[len(panels) :]:
            ax.remove()
        for i, ax in enumerate(grid[: len(panels)]):
            ax.tick_params(labelbottom=i + columns >= len(panels))
        phases = [phase for one in drawn for phase in one.trajectory.phases]
        first, last = min(phase.t0 for phase in phases), max(phase.tf for phase in phases)
        margin = 0.015 * (last - first) or 1.0
        grid[0].set_xlim(first - margin, last + margin)
        figure.supxlabel(axis_label("time", " | ".join(dict.fromkeys(phase.time_unit for phase in phases))), fontsize=9)
        figure.align_ylabels()
        named = [wrapped(plain(_words(point)), figure.get_figwidth() - 0.6, 8.0) for point in points]
        lines = [Line2D([], [], color=one.color, lw=1.5, label=words) for one, words in zip(drawn, named, strict=True)]
        figure.legend(handles=lines, loc="outside upper left", frameon=False)
    return grid[: len(panels)]


def _words(point: Any) -> str:
    """The point's number, its objectives, and whether it is not feasible, not verified or not simulated."""
    named = zip(point.goals, point.objectives.values(), strict=True)
    values = ", ".join(f"{goal.name} {value:.5g} {raised(goal.unit)}".rstrip() for goal, value in named)
    said = remark(point)
    return f"#{point.index}: {values}{f'; {said}' if said else ''}"
