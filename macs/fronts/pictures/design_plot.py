"""Figure of the variables of a black box or vector problem along a front, each over the first objective."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from problems.compiled import Objective, Variable

from .style import COLORS, GREY, STYLE, label, new_figure, wrapped

MOST = 30
"""Variables that are drawn; of more, those that vary most within their bounds."""
NEAR = 0.6
"""Bounds are in the picture if this many times the range of the values contains them; the text above each panel always gives them."""


def draw_designs(
    decisions: np.ndarray,
    variables: Sequence[Variable],
    objectives: np.ndarray,
    goals: Sequence[Objective],
    feasible: np.ndarray,
    title: str,
    figure: Any = None,
    marked: Sequence[int] = (),
) -> np.ndarray:
    """Axes, one for each variable, with its values over the first objective of all points.

    Dashed lines are its bounds. Colours are the second objective, if there is one. Points that are not feasible are hollow.

    Parameters
    ----------
    decisions : array (n, d)
    variables : d Variables
    objectives : array (n, m)
        In the user's units and senses.
    goals : m Objectives
    feasible : mask (n,)
    title : str
        Text above the panels.
    figure : matplotlib Figure, optional
        Empty figure to draw into. Default: a new one.
    marked : numbers of points
        Points that are circled.
    """
    import matplotlib

    names = _drawn(decisions, variables)
    columns = 1 if len(names) < 3 else 2 if len(names) < 7 else 3
    rows = -(-len(names) // columns)
    size = (3.4 * columns + 0.8, 1.8 * rows + 0.7)
    with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
        if figure is None:
            figure = new_figure(*size)
        else:
            figure.set_size_inches(*size)
        grid = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
        J, good = objectives, feasible
        color: dict[str, Any] = {"c": J[good, 1], "cmap": "viridis"} if len(goals) > 1 else {"color": COLORS[0]}
        drawn = None
        for ax, k in zip(grid, names, strict=False):
            values, variable = decisions[:, k], variables[k]
            drawn = ax.scatter(J[good, 0], values[good], s=16, linewidths=0.3, edgecolors="white", zorder=3, **color)
            if not good.all():
                ax.scatter(J[~good, 0], values[~good], s=16, facecolors="none", edgecolors=GREY, linewidths=0.8, zorder=2)
            for i in marked:
                ax.scatter(J[i, 0], values[i], s=70, facecolors="none", edgecolors=COLORS[1], linewidths=1.4, zorder=4)
            _bounds(ax, values[np.isfinite(values)], variable.lower, variable.upper)
            ax.set_ylabel(label(variable.name, variable.unit))
            ax.set_title(f"in [{variable.lower:.4g}, {variable.upper:.4g}]", loc="right", fontsize=7, color=GREY, pad=2)
        for ax in grid[len(names) :]:
            ax.remove()
        used = grid[: len(names)]
        for i, ax in enumerate(used):
            ax.tick_params(labelbottom=i + columns >= len(used))
        if len(goals) > 1 and good.any():
            figure.colorbar(drawn, ax=list(used), label=label(goals[1].name, goals[1].unit)).outline.set_visible(False)
        left_out = len(variables) - len(names)
        text = f"{title}; {left_out} variables that vary less are left out" if left_out else title
        figure.suptitle(wrapped(text, figure.get_figwidth()), fontsize=9, x=0.01, ha="left")
        figure.supxlabel(label(goals[0].name, goals[0].unit), fontsize=9)
    return used


def _drawn(decisions: np.ndarray, variables: Sequence[Variable]) -> list[int]:
    """The columns of the variables that are drawn, in their order."""
    spans = np.array([v.span for v in variables])
    varying = (np.ptp(decisions, axis=0) if len(decisions) else np.zeros(len(spans))) / spans
    return sorted(np.argsort(-varying, kind="stable")[:MOST].tolist())


def _bounds(ax: Any, values: np.ndarray, lower: float, upper: float) -> None:
    """Draw dashed lines at the bounds that are near the values."""
    low, high = (values.min(), values.max()) if len(values) else (lower, upper)
    reach = NEAR * max(high - low, 1e-3 * (upper - lower))
    for bound in (lower, upper):
        if low - reach <= bound <= high + reach:
            ax.axhline(bound, color=GREY, lw=0.8, ls=(0, (5, 3)), zorder=1)
            low, high = min(low, bound), max(high, bound)
    margin = 0.08 * max(high - low, 1e-3 * (upper - lower))
    ax.set_ylim(low - margin, high + margin)
