"""Figure of degrees: how well each objective is satisfied by several choices, as bars side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...fronts.pictures.style import COLORS, GREY, STYLE, new_figure
from .bands import shade_degrees

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_degrees(
    degrees: Mapping[str, np.ndarray],
    groups: Sequence[str],
    label: str,
    levels: Sequence[tuple[float, str]],
    smaller: bool,
    title: str = "",
    ax: Axes | None = None,
) -> Axes:
    """Axes with groups of bars, usually one for each objective, with one bar for each choice."""
    import matplotlib

    values = np.array([*degrees.values()], dtype=float)
    shown = ~np.isnan(values).all(axis=0)
    values, names = values[:, shown], [name for name, one in zip(groups, shown, strict=True) if one]
    with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
        if ax is None:
            ax = new_figure(max(4.6, 1.2 + 0.45 * values.size), 3.4).add_subplot()
        width = 0.8 / len(values)
        top = float(np.nanmax(values, initial=0.0))
        bottom = float(np.nanmin(values, initial=0.0))
        for k, (name, row) in enumerate(zip(degrees, values, strict=True)):
            places = np.arange(len(names)) + (k - 0.5 * (len(values) - 1)) * width
            color = COLORS[k % len(COLORS)]
            ax.bar(places, row, 0.9 * width, color=color, label=name, zorder=3, hatch="" if k < len(COLORS) else "//")
            for x, degree in zip(places, row, strict=True):
                if np.isfinite(degree):
                    ax.annotate(
                        f"{round(degree, 2) + 0.0:.2f}", (x, max(degree, 0.0)), (0, 2), textcoords="offset points", ha="center", fontsize=7
                    )
        ax.set_xticks(range(len(names)), names)
        ax.tick_params(axis="x", length=0)
        ax.set_ylabel(label)
        ax.grid(False, axis="x")
        if smaller:
            shade_degrees(ax, 1.1 * top)
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
        if title:
            ax.set_title(title, loc="right", color=GREY)
    return ax
