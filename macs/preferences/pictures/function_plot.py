"""Figure of what a preference makes of each objective, with the points of a front on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from problems.compiled import Objective

from ...fronts.pictures.style import COLORS, GREY, STYLE, axis_label, better, new_figure
from .bands import shade_ranges

SAMPLES = 801


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
    import matplotlib

    with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
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
    x = np.union1d(np.linspace(curve.low, curve.high, SAMPLES), [b for b in curve.boundaries if curve.low <= b <= curve.high])
    if curve.degree is not None:
        shade_ranges(ax, curve.boundaries, curve.degree, (curve.low, curve.high))
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
