"""Figures of preferences: rankings, preference functions with a front on them, degrees side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Objective

from ..fronts.pictures.front_plot import parallel_axes
from ..fronts.pictures.style import COLORS, GREY, axis_label, better, new_figure, styled, title_and_legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHADES = ("#d9efdf", "#e9f5e3", "#f9f7dc", "#fdeccf", "#fbdcc8", "#f3c9c4")
"""From ideal to unacceptable: light, so that curves and bars stand out; readers of any colour vision tell them by their order."""


def draw_degrees(
    degrees: Mapping[str, np.ndarray],
    groups: Sequence[str],
    label: str,
    levels: Sequence[tuple[float, str]],
    smaller: bool,
    ax: Axes | None = None,
) -> Axes:
    """Axes with groups of bars, usually one for each objective, with one bar for each choice."""
    values = np.array([*degrees.values()], dtype=float)
    shown = ~np.isnan(values).all(axis=0)
    values, names = values[:, shown], [name for name, one in zip(groups, shown, strict=True) if one]
    with styled():
        if ax is None:
            ax = new_figure(max(4.6, 1.2 + 0.45 * values.size), 3.4).add_subplot()
        width, upright = 0.8 / len(values), 90 * (len(values) > 4)  # numbers are wider than so many bars
        top = float(np.nanmax(values, initial=0.0))
        bottom = float(np.nanmin(values, initial=0.0))
        for k, (name, row) in enumerate(zip(degrees, values, strict=True)):
            places = np.arange(len(names)) + (k - 0.5 * (len(values) - 1)) * width
            color = COLORS[k % len(COLORS)]
            ax.bar(places, row, 0.9 * width, color=color, label=name, zorder=3, hatch="" if k < len(COLORS) else "//")
            for x, degree in zip(places, row, strict=True):
                if np.isfinite(degree):
                    text, place = f"{round(degree, 2) + 0.0:.2f}", (x, max(degree, 0.0))
                    ax.annotate(text, place, (0, 2), textcoords="offset points", ha="center", fontsize=7, rotation=upright)
        ax.set_xticks(range(len(names)), names)
        ax.tick_params(axis="x", length=0)
        ax.set_ylabel(label)
        ax.grid(False, axis="x")
        if smaller:
            for k, shade in enumerate(SHADES):
                ax.axhspan(k, k + 1 if k < 5 else max(1.1 * top, 6.0), color=shade, lw=0, zorder=0)
            ax.set_ylim(0.0, max(6.0, 1.1 * top))
            ax.grid(False)
            ax.set_yticks(range(6))
        else:
            ax.set_ylim(1.1 * bottom, max(1.1, 1.1 * top))
            ax.axhline(0.0, color="black", lw=0.8)
        if any(word for _, word in levels):
            right = ax.secondary_yaxis("right")
            right.set_yticks([degree for degree, _ in levels], [word for _, word in levels])
            right.tick_params(length=0, colors=GREY)
            right.spines["right"].set_visible(False)
        ax.set_xlim(-0.55, len(names) - 0.45)
        ax.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=min(len(values), 4))
    return ax


@dataclass(frozen=True)
class Curve:
    """A function of one objective."""

    goal: Objective
    place: int
    # The first one is drawn in full, with the points; the others are broken lines.
    functions: tuple[tuple[str, Callable[[np.ndarray], np.ndarray]], ...]
    low: float  # low, high: Between which it is drawn
    high: float
    boundaries: tuple[float, ...] = ()  # between ranges of preference; shaded by `degree`
    degree: Callable[[np.ndarray], np.ndarray] | None = None
    directed: bool = True  # whether the objective's sense says what is better


def draw_functions(
    curves: Sequence[Curve], title: str, heights: str, logarithmic: bool, points: np.ndarray, best: int | None, figure: Any = None
) -> np.ndarray:
    """Axes, one for each objective, with functions of it, the points (n, m) of a front on them, and the best of these marked."""
    with styled():
        columns = min(len(curves), 2 if len(curves) in (2, 4) else 3)
        rows = -(-len(curves) // columns)
        if figure is None:
            figure = new_figure(3.4 * columns + 0.4, 2.7 * rows + 0.4)
        axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
        for k, (curve, ax) in enumerate(zip(curves, axes.flat, strict=False)):
            _draw(curve, ax, points, best, logarithmic)
            if k % columns == 0:
                ax.set_ylabel(heights)
        for ax in axes.flat[len(curves) :]:
            ax.set_visible(False)
        handles, names = axes.flat[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=min(len(names), 4), frameon=False)
        figure.suptitle(title, x=0.01, ha="left", color=GREY, fontsize=9)
    return axes.ravel()[: len(curves)]


def _draw(curve: Curve, ax: Any, points: np.ndarray, best: int | None, logarithmic: bool) -> None:
    x = np.union1d(np.linspace(curve.low, curve.high, 801), [b for b in curve.boundaries if curve.low <= b <= curve.high])
    if curve.degree is not None:
        for low, high in pairwise([curve.low, *(b for b in sorted(curve.boundaries) if curve.low < b < curve.high), curve.high]):
            level = float(curve.degree(np.array([0.5 * (low + high)]))[0])
            ax.axvspan(low, high, color=SHADES[int(np.clip(np.floor(level), 0, 5))], lw=0, zorder=0)
    for k, (name, function) in enumerate(curve.functions):
        style = {"color": COLORS[0], "lw": 1.5} if not k else {"color": GREY, "lw": 1.1, "ls": "--"}
        ax.plot(x, function(x), label=name, zorder=3 - 0.1 * k, **style)
    first = curve.functions[0][1]
    J = points[:, curve.place]
    seen = np.isfinite(J) & (curve.low <= J) & (curve.high >= J)
    if seen.any():
        dots = {"linewidths": 0.4, "edgecolors": "white", "color": COLORS[0]}
        ax.scatter(J[seen], first(J[seen]), s=22, zorder=4, label="points of the front", **dots)
    if best is not None and seen[best]:
        ring = {"facecolors": "none", "edgecolors": COLORS[1], "linewidths": 1.6}
        ax.scatter(J[[best]], first(J[[best]]), s=110, zorder=5, label="best", **ring)
    if logarithmic:
        ax.set_yscale("log")
    ax.set_xlim(curve.low, curve.high)
    ax.set_xlabel(better(curve.goal) if curve.directed else axis_label(curve.goal.name, curve.goal.unit))


BEST = COLORS[1]
EDGES = (GREY, COLORS[0])


def draw_ranking(front: Any, order: np.ndarray, apart: Mapping[str, np.ndarray], title: str, ax: Axes | None = None) -> Axes:
    """Axes with the objectives of a front, its points coloured by their place in an order: dark is good.

    One objective is drawn against the place, two as a scatter plot, more as parallel coordinates. The best point is marked. order (n,).
    """
    with styled():
        if ax is None:
            ax = new_figure(7.0 if len(front.goals) > 2 else 5.5, 4.0).add_subplot()
        place = np.empty(len(order), dtype=int)
        place[order] = np.arange(len(order))
        draw = _parallel if len(front.goals) > 2 else _scatter
        draw(front, place, apart, ax)
        title_and_legend(ax, title)
    return ax


def _scatter(front: Any, place: np.ndarray, apart: Mapping[str, np.ndarray], ax: Any) -> None:
    met = ~np.any([*apart.values()], axis=0)
    J = front.objectives
    x, y = (place + 1.0, J[:, 0]) if J.shape[1] == 1 else J.T
    shade = {"c": place[met] + 1, "cmap": "viridis", "vmin": 1, "vmax": max(int(place[met].max(initial=0)) + 1, 2)}
    drawn = ax.scatter(x[met], y[met], s=26, linewidths=0.4, edgecolors="white", zorder=3, **shade)
    for (name, rows), color in zip(apart.items(), EDGES, strict=True):
        if rows.any():
            ax.scatter(x[rows], y[rows], s=26, facecolors="none", edgecolors=color, linewidths=0.9, zorder=2, label=name)
    best = int(np.argmin(place))
    ax.scatter(x[best], y[best], s=130, facecolors="none", edgecolors=BEST, linewidths=1.6, zorder=4, label=f"best (#{best})")
    if met.any():
        _bar(drawn, ax)
    ax.set_xlabel("rank" if J.shape[1] == 1 else better(front.goals[0]))
    ax.set_ylabel(better(front.goals[-1]))


def _parallel(front: Any, place: np.ndarray, apart: Mapping[str, np.ndarray], ax: Any) -> None:
    """Parallel coordinates, better at the top."""
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    met = ~np.any([*apart.values()], axis=0)
    F = np.where(np.isfinite(front.F), front.F, np.nan)
    low, high = np.nanmin(F, axis=0), np.nanmax(F, axis=0)
    height = 1.0 - (F - low) / np.where(high > low, high - low, 1.0)
    shade, norm = matplotlib.colormaps["viridis"], Normalize(1, max(int(place[met].max(initial=0)) + 1, 2))
    best = int(np.argmin(place))
    for (name, rows), color, line in zip(apart.items(), EDGES, (":", "--"), strict=True):
        for k, i in enumerate(np.flatnonzero(rows)):
            ax.plot(height[i], color=color, lw=0.8, ls=line, label=None if k else name)
    for i in np.argsort(-place):
        if met[i] and i != best:
            ax.plot(height[i], color=shade(norm(place[i] + 1)), lw=1.0, alpha=0.85)
    ax.plot(height[best], color=BEST, lw=2.2, marker="o", ms=4, label=f"best (#{best})", zorder=4)
    _bar(ScalarMappable(norm, shade), ax)
    parallel_axes(ax, front.goals, low, high)


def _bar(drawn: Any, ax: Any) -> None:
    """The scale of ranks, the best at the top."""
    ticks = np.unique(np.linspace(drawn.norm.vmin, drawn.norm.vmax, 6).round())
    bar = ax.figure.colorbar(drawn, ax=ax, label="rank", pad=0.02, ticks=ticks)
    bar.outline.set_visible(False)
    bar.ax.invert_yaxis()
