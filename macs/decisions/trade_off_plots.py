"""Figures of trade-offs: what one choice costs, and the rates along a front. They need no display."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from problems.compiled import Objective

from ..fronts.pictures.style import COLORS, GREY, STYLE, axis_label, better, new_figure, title_and_legend
from ..fronts.points import Points
from ..io.text import label

DASH = 0.05
"""Length of a dash that shows a slope, in widths of its axes."""
WIDE = 30.0
"""Ratio of the largest and the smallest rate from which on they are drawn on a logarithmic axis."""
BEYOND = 3.0
"""Multiple of the largest slope of a chord up to which slopes at points are drawn."""
STEPS = 0.1
"""How much better an objective gets, in ranges of the front, where a figure shows what that costs."""


def draw_rates(front: Points, rates: np.ndarray, figure: Any = None) -> Sequence[Any]:
    """See `plot_rates`; `rates` (n, m, m)."""
    import matplotlib

    m = len(front.goals)
    if m < 2:
        raise ValueError("a front of one objective has no trade-offs to draw")
    if not len(front) or np.isnan(rates).all(axis=0)[0, 1]:
        raise ValueError("no point of the front has weights: those of gradient solves and of searches that use gradients have")
    with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
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
        wide = usual.max() > WIDE * usual.min()
        # At the ends of a front slopes have no limit.
        low, high = np.array([usual.min(), usual.max() if len(chords) < 2 else min(usual.max(), BEYOND * np.nanmax(chords))])
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
    dx, dy = DASH * width * np.cos(tilt), DASH * height * np.sin(tilt) / shape
    ax.plot(np.array([x - dx, x + dx]), np.array([y - dy, y + dy]), color=COLORS[1], lw=1.0, solid_capstyle="round", zorder=2)
    known = ~np.isnan(slopes)
    ax.scatter(x[known], y[known], s=11, color=COLORS[0], linewidths=0.0, zorder=3)
    ax.scatter(x[~known], y[~known], s=11, facecolors="none", edgecolors=GREY, linewidths=0.8, zorder=3)


def draw_trade_offs(goals: Sequence[Objective], ranges: np.ndarray, tables: Mapping[str, np.ndarray], figure: Any = None) -> Sequence[Any]:
    """Axes with what all objectives change by when one gets better by a tenth of its range, or by one unit where it has none: a row for
    each that gets better, darker where the change is more of a range; see `TradeOffs.plot`. goals, ranges (m,)."""
    import matplotlib

    steps = np.array([_round(STEPS * size) if size > 0 else 1.0 for size in ranges])
    with matplotlib.rc_context(STYLE | {"axes.grid": False}):  # type: ignore[arg-type]
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
