"""Figure of a dialogue: degrees as bars turn by turn, and the values of the objectives beside."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Objective

from ..fronts.pictures.style import COLORS, GREY, STYLE, axis_label, new_figure
from ..preferences import Preference, Ranges
from ..preferences.pictures import draw_degrees
from .choice import Choice

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDE, LINES = 20, 4
"""Characters in a line below a turn, and lines."""


def draw_history(
    goals: Sequence[Objective],
    ranges: Ranges,
    asked: Sequence[str],
    choices: Sequence[Choice],
    by: Preference | None = None,
    figure: Any = None,
) -> Sequence[Axes]:
    """Axes with the degrees of choices, a group of bars for each, and one for each objective with its values."""
    import matplotlib

    if not choices:
        raise ValueError("nothing was chosen yet: there is no history to draw")
    J = np.array([[*one.objectives.values()] for one in choices])
    kinds = [one.preference for one in choices]
    if by is None and len({one.SMALLER for one in kinds}) > 1:
        by = kinds[0]
    if by is not None:
        kinds = [by]
    degrees = np.array([[one.degrees[goal.name] for goal in goals] for one in choices]) if by is None else by.degrees(goals, ranges, J)
    heights = kinds[0].DEGREE if len({one.DEGREE for one in kinds}) == 1 else "degree (1: all that was asked for)"
    marks = kinds[0].MARKS if len({one.MARKS for one in kinds}) == 1 else ()
    with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
        left = max(3.6, 0.9 + len(choices) * max(1.25, 0.36 * len(goals)))
        figure = new_figure(1.0, 1.0) if figure is None else figure
        figure.set_size_inches(left + 3.4, max(3.6, 1.3 * len(goals) + 0.8))
        grid = figure.add_gridspec(len(goals), 2, width_ratios=(left, 3.0))
        bars = figure.add_subplot(grid[:, 0])
        groups = ["\n".join(textwrap.wrap(f"{k + 1}: {words}", WIDE, max_lines=LINES, placeholder=" …")) for k, words in enumerate(asked)]
        rows = dict(zip((goal.name for goal in goals), degrees.T, strict=True))
        if by is not None and len(choices) > 1:
            heights += f", all turns by {by.title}"
        entering = {name: row for name, row in rows.items() if not np.isnan(row).all()}
        draw_degrees(entering, groups, heights, marks, kinds[0].SMALLER, ax=bars)
        values = [figure.add_subplot(grid[k, 1]) for k in range(len(goals))]
        for k, (goal, ax) in enumerate(zip(goals, values, strict=True)):
            _draw_values(ax, goal, ranges, J[:, k], COLORS[k % len(COLORS)], last=k == len(goals) - 1)
    return [bars, *values]


def _draw_values(ax: Any, goal: Objective, ranges: Ranges, values: np.ndarray, color: str, last: bool) -> None:
    """The values of one objective, turn by turn, and the ends of its range."""
    turns = np.arange(1, len(values) + 1)
    for end, word in ((ranges.best[goal.name], "best"), (ranges.worst[goal.name], "worst")):
        ax.axhline(end, color=GREY, lw=0.8, ls="--", zorder=1)
        ax.annotate(
            word, (1.0, end), (3, 0), xycoords=("axes fraction", "data"), textcoords="offset points", va="center", fontsize=7, color=GREY
        )
    ax.plot(turns, values, color=color, marker="o", ms=4, lw=1.2, zorder=3)
    ax.set_xlim(0.6, len(values) + 0.4)
    ax.set_xticks(turns, [str(turn) for turn in turns] if last else [""] * len(turns))
    ax.margins(y=0.12)
    ax.set_title(f"{axis_label(goal.name, goal.unit)}, {goal.sense[:3]}", loc="left", color=color)
    if last:
        ax.set_xlabel("turn")
