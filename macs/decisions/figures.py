"""Figures of decisions: the rates along a front, what one choice costs, and the turns of a dialogue. They need no display."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Objective

from ..fronts.pictures.style import COLORS, GREY, axis_label, better, new_figure, styled, title_and_legend
from ..fronts.points import Points
from ..io.text import label
from ..preferences.pictures import draw_degrees
from ..preferences.preference import Preference
from ..preferences.ranges import Ranges

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_rates(front: Points, rates: np.ndarray, figure: Any = None) -> Sequence[Any]:
    """See `plot_rates`; `rates` (n, m, m)."""
    m = len(front.goals)
    if m < 2:
        raise ValueError("a front of one objective has no trade-offs to draw")
    if not len(front) or np.isnan(rates).all(axis=0)[0, 1]:
        raise ValueError("no point of the front has weights: those of gradient solves and of searches that use gradients have")
    with styled():
        return _two(front, rates, figure) if m == 2 else _more(front, rates, figure)


def _two(front: Points, rates: np.ndarray, figure: Any) -> Sequence[Any]:
    """The front with its slopes above, the slopes below."""
    figure = _sized(figure, 5.5, 5.6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    (x, y), slopes, goals = front.objectives.T, rates[:, 1, 0], front.goals
    _dashes(above, x, y, slopes)
    above.set_ylabel(better(goals[1]))
    order = np.argsort(x)
    x, y, slopes = x[order], y[order], slopes[order]
    distances = np.diff(x)
    chords = np.abs(np.diff(y) / np.where(distances > 0, distances, np.nan))
    below.step(x, np.append(chords, chords[-1:] if len(chords) else np.nan), where="post", color=GREY, lw=0.8, label="between neighbours")
    sizes = np.abs(slopes)
    every = np.concatenate([chords, sizes])
    usual = every[np.isfinite(every) & (every > 0)]
    if len(usual):
        wide = usual.max() > 30.0 * usual.min()
        # At the ends of a front slopes have no limit.
        low, high = np.array([usual.min(), usual.max() if len(chords) < 2 else min(usual.max(), 3.0 * np.nanmax(chords))])
        sizes = np.clip(sizes, low, high)
        if wide:
            below.set_yscale("log")
    shown = np.abs(slopes) == sizes
    below.plot(x[shown], sizes[shown], "o", color=COLORS[1], ms=3.5, label="at the points")
    if (~shown & ~np.isnan(sizes)).any():
        for marker, beyond in (("^", np.abs(slopes) > sizes), ("v", np.abs(slopes) < sizes)):
            below.plot(x[beyond], sizes[beyond], marker, color=COLORS[1], ms=4.5, mfc="none", label="beyond" if marker == "^" else "")
    below.set_ylabel(_rate_label(goals[1], goals[0]))
    below.set_xlabel(better(goals[0]))
    title_and_legend(below, "")
    above.set_title(f"{_title(front)}; dashes: slopes at the points", loc="left", color=GREY)
    return [above, below]


def _more(front: Points, rates: np.ndarray, figure: Any) -> Sequence[Any]:
    """Panels for all pairs, the first of each upwards."""
    m = len(front.goals)
    figure = _sized(figure, 2.7 * (m - 1) + 0.4, 2.2 * (m - 1) + 0.5)
    grid = figure.subplots(m - 1, m - 1, sharex="col", sharey="row", squeeze=False)
    drawn = []
    for i, j in ((i, j) for j, i in combinations(range(m), 2)):
        ax = grid[i - 1, j]
        _dashes(ax, front.objectives[:, j], front.objectives[:, i], rates[:, i, j])
        drawn.append(ax)
        if j == 0:
            ax.set_ylabel(better(front.goals[i]))
        if i == m - 1:
            ax.set_xlabel(better(front.goals[j]))
    for i, j in combinations(range(m - 1), 2):
        grid[i, j].remove()
    figure.suptitle(f"{_title(front)}; dashes: slopes with the others held", x=0.01, ha="left", color=GREY, fontsize=9.0)
    return drawn


def _dashes(ax: Any, x: np.ndarray, y: np.ndarray, slopes: np.ndarray) -> None:
    """Points, and a dash of the same length on paper through each that has a slope, on axes that fit all points."""
    width, height = (float(np.ptp(values)) or 1.0 for values in (x, y))
    shape = ax.bbox.height / ax.bbox.width
    tilt = np.arctan2(slopes * width / height * shape, 1.0)
    tilt = np.where(np.isinf(slopes), 0.5 * np.pi, tilt)
    dash = 0.05  # its length in widths of the axes
    dx, dy = dash * width * np.cos(tilt), dash * height * np.sin(tilt) / shape
    ax.plot(np.array([x - dx, x + dx]), np.array([y - dy, y + dy]), color=COLORS[1], lw=1.0, solid_capstyle="round", zorder=2)
    known = ~np.isnan(slopes)
    ax.scatter(x[known], y[known], s=11, color=COLORS[0], linewidths=0.0, zorder=3)
    ax.scatter(x[~known], y[~known], s=11, facecolors="none", edgecolors=GREY, linewidths=0.8, zorder=3)


def draw_trade_offs(goals: Sequence[Objective], ranges: np.ndarray, tables: Mapping[str, np.ndarray], figure: Any = None) -> Sequence[Any]:
    """Axes with what all objectives change by when one gets better by a tenth of its range, or by one unit where it has none: a row for
    each that gets better, darker where the change is more of a range; see `TradeOffs.plot`. goals, ranges (m,)."""
    steps = np.array([_round(0.1 * size) if size > 0 else 1.0 for size in ranges])
    with styled():
        m = len(goals)
        figure = _sized(figure, 1.2 + len(tables) * (1.05 * m + 0.2) + 0.8, 0.55 * m + 1.5)
        axes = np.atleast_1d(figure.subplots(1, len(tables), sharey=True))
        signs = np.array([goal.sign for goal in goals])
        for ax, (title, by_one) in zip(axes, tables.items(), strict=True):
            changes = by_one * (-signs * steps)[:, None]
            worse = changes * signs / np.where(ranges > 0, ranges, np.abs(steps))
            ax.imshow(np.ma.masked_invalid(np.clip(worse, -0.5, 0.5)), cmap="PuOr_r", vmin=-0.5, vmax=0.5, aspect="auto", alpha=0.75)
            for (i, k), change in np.ndenumerate(changes):
                text = "-" if np.isnan(change) else f"{change + 0.0:+.3g}"
                ax.text(k, i, text, ha="center", va="center", fontsize=8.0, weight="bold" if i == k else "normal")
            ax.set_xticks(range(m), [label(goal.name, goal.unit).replace(" ", "\n") for goal in goals])
            ax.set_title(title, loc="left", color=GREY)
            ax.tick_params(length=0)
            ax.grid(False)
            for side in ax.spines.values():
                side.set_visible(False)
        figure.supxlabel(
            "orange: worse, blue: better; darker: more of the range of the front", x=0.99, ha="right", color=GREY, fontsize=8.0
        )
        axes[0].set_yticks(
            range(m), [f"{goal.name}\nbetter by {step:g} {goal.unit}".rstrip() for goal, step in zip(goals, steps, strict=True)]
        )
    return list(axes)


def _round(value: float) -> float:
    """A number to one significant digit."""
    return float(f"{value:.0e}")


def _rate_label(of: Objective, by: Objective) -> str:
    units = f"{of.unit or '1'} per {by.unit or '1'}" if of.unit or by.unit else ""
    return axis_label(f"rate of {of.name}\nby {by.name}", units)


def _title(front: Points) -> str:
    name = front.source.name if front.source else ""
    return f"{name}, {len(front)} points".lstrip(", ")


def _sized(figure: Any, width: float, height: float) -> Any:
    if figure is None:
        return new_figure(width, height)
    figure.set_size_inches(width, height)
    return figure


def draw_history(
    goals: Sequence[Objective],
    ranges: Ranges,
    asked: Sequence[str],
    choices: Sequence[Any],
    by: Preference | None = None,
    figure: Any = None,
) -> Sequence[Axes]:
    """Axes with the degrees of choices, a group of bars for each, and one for each objective with its values."""
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
    with styled():
        left = max(3.6, 0.9 + len(choices) * max(1.25, 0.36 * len(goals)))
        figure = new_figure(1.0, 1.0) if figure is None else figure
        figure.set_size_inches(left + 3.4, max(3.6, 1.3 * len(goals) + 0.8))
        grid = figure.add_gridspec(len(goals), 2, width_ratios=(left, 3.0))
        bars = figure.add_subplot(grid[:, 0])
        groups = ["\n".join(textwrap.wrap(f"{k + 1}: {words}", 20, max_lines=4, placeholder=" …")) for k, words in enumerate(asked)]
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
