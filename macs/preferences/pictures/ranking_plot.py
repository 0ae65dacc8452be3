"""Figure of a ranking: the front, its points coloured by their rank, the best marked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...fronts.pictures.style import COLORS, GREY, STYLE, axis_label, better, new_figure, title_and_legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BEST = COLORS[1]
EDGES = (GREY, COLORS[0])


def draw_ranking(front: Any, order: np.ndarray, apart: Mapping[str, np.ndarray], title: str, ax: Axes | None = None) -> Axes:
    """Axes with the objectives of a front, its points coloured by their place in an order: dark is good.

    One objective is drawn against the place, two as a scatter plot, more as parallel coordinates. The best point is marked. order (n,).
    """
    import matplotlib

    with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
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
    met = ~np.any([*apart.values()], axis=0)
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

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
    for k, goal in enumerate(front.goals):
        ax.plot([k, k], [0, 1], color="black", lw=0.8, zorder=0)
        ax.text(k, 1.015, f"{goal.sign * low[k] + 0.0:.5g}", ha="center", va="bottom", fontsize=8)
        ax.text(k, -0.015, f"{goal.sign * high[k] + 0.0:.5g}", ha="center", va="top", fontsize=8)
    ax.grid(False)
    ax.set_xlim(-0.3, len(front.goals) - 0.7)
    ax.set_ylim(-0.12, 1.12)
    ax.set_xticks(range(len(front.goals)), [f"{axis_label(goal.name, goal.unit)}\n{goal.sense[:3]}" for goal in front.goals])
    ax.set_yticks([0, 1], ["worst", "best"])
    ax.tick_params(length=0)
    for side in ("left", "bottom"):
        ax.spines[side].set_visible(False)


def _bar(drawn: Any, ax: Any) -> None:
    """The scale of ranks, the best at the top."""
    ticks = np.unique(np.linspace(drawn.norm.vmin, drawn.norm.vmax, 6).round())
    bar = ax.figure.colorbar(drawn, ax=ax, label="rank", pad=0.02, ticks=ticks)
    bar.outline.set_visible(False)
    bar.ax.invert_yaxis()
