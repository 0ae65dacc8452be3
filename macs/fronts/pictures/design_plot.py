"""Figure of the variables of a black box or vector problem along a front, each over the first objective."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from problems.compiled import Variable

from .kinds import NOT_FEASIBLE, NOT_VERIFIED, kinds
from .limits import draw_limits
from .style import COLORS, GREY, STYLE, axis_label, axis_number, new_figure, plain, wrapped

MOST = 30
"""Variables that are drawn; of more, those that vary most within their bounds."""
NEAR = 0.6
"""Bounds are in the picture if this many times the range of the values contains them; the text above each panel always gives them."""


def draw_designs(front: Any, title: str, figure: Any = None, marked: Sequence[int] = ()) -> np.ndarray:
    """Axes, one for each variable, with its values over the first objective of all points.

    Dashed lines are its bounds. Colours are the second objective, if there is one. Points that are not feasible or not verified are hollow.
    """
    import matplotlib

    decisions, variables, goals, J = front.decision, front.variables, front.goals, front.objectives
    good, apart, infeasible = kinds(front)
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
        color: dict[str, Any] = {"c": J[good, 1], "cmap": "viridis"} if len(goals) > 1 else {"color": COLORS[0]}
        drawn = None
        for ax, k in zip(grid, names, strict=False):
            values, variable = decisions[:, k], variables[k]
            drawn = ax.scatter(J[good, 0], values[good], s=16, linewidths=0.3, edgecolors="white", zorder=3, **color)
            for hollow, name, edge in ((apart, NOT_VERIFIED, COLORS[0]), (infeasible, NOT_FEASIBLE, GREY)):
                if hollow.any():
                    ax.scatter(J[hollow, 0], values[hollow], s=16, facecolors="none", edgecolors=edge, linewidths=0.8, zorder=2, label=name)
            for i in marked:
                ax.scatter(J[i, 0], values[i], s=70, facecolors="none", edgecolors=COLORS[1], linewidths=1.4, zorder=4)
            draw_limits(ax, values, [(None, variable.lower, variable.upper)], NEAR, margin=0.08)
            ax.set_ylabel(wrapped(axis_label(variable.name, variable.unit), 1.5))
            ax.set_title(f"in [{axis_number(variable.lower)}, {axis_number(variable.upper)}]", loc="right", fontsize=7, color=GREY, pad=2)
        for ax in grid[len(names) :]:
            ax.remove()
        used = grid[: len(names)]
        for i, ax in enumerate(used):
            ax.tick_params(labelbottom=i + columns >= len(used))
        if len(goals) > 1 and good.any():
            figure.colorbar(drawn, ax=list(used), label=axis_label(goals[1].name, goals[1].unit)).outline.set_visible(False)
        handles, words = used[0].get_legend_handles_labels()
        if handles:
            figure.legend(handles, words, loc="outside upper right", ncols=len(handles), frameon=False)
        left_out = len(variables) - len(names)
        text = f"{title}; {left_out} variables that vary less are left out" if left_out else title
        figure.suptitle(wrapped(plain(text), figure.get_figwidth()), fontsize=9, x=0.01, ha="left")
        figure.supxlabel(axis_label(goals[0].name, goals[0].unit), fontsize=9)
    return used


def _drawn(decisions: np.ndarray, variables: Sequence[Variable]) -> list[int]:
    """The columns of the variables that are drawn, in their order."""
    spans = np.array([v.span for v in variables])
    varying = (np.ptp(decisions, axis=0) if len(decisions) else np.zeros(len(spans))) / spans
    return sorted(np.argsort(-varying, kind="stable")[:MOST].tolist())
