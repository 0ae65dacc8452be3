"""Style of figures for papers: widths, fonts and legends."""

from __future__ import annotations

from typing import Any

from macs.fronts.pictures.style import STYLE, blank_figure

COLUMN, PAGE = 3.5, 7.2
"""Inches: the width of a column, and of a page of two."""
PAPER: dict[str, Any] = {
    **STYLE,
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), 8.0),
    **dict.fromkeys(("legend.fontsize", "xtick.labelsize", "ytick.labelsize"), 7.0),
    **dict.fromkeys(("axes.linewidth", "xtick.major.width", "ytick.major.width"), 0.6),
    "legend.handlelength": 1.6,
}


def style() -> Any:
    """A context in which figures are drawn as papers want them."""
    import matplotlib

    return matplotlib.rc_context(PAPER)  # type: ignore[arg-type]


def new_figure(width: float, height: float) -> Any:
    """A figure of no window."""
    figure = blank_figure()
    figure.set_size_inches(width, height)
    return figure


def legend(figure: Any, ax: Any, place: str | None, title: str = "") -> None:
    """The legend of the axes: inside them at `place` if it has few entries and no line is behind it, else above them."""
    handles, names = ax.get_legend_handles_labels()
    look = {"frameon": False, "title": title or None, "title_fontsize": 7, "alignment": "left"}
    within = ax.legend(handles, names, loc=place, **look) if place and len(names) <= 4 else None
    if within is not None and _covers(figure, ax, within):
        within.remove()
        within = None
    if within is None:
        for columns in range(min(len(names), 6), 0, -1):
            above = figure.legend(handles, names, loc="outside upper left", ncols=columns, **look)
            if columns == 1 or above.get_window_extent().width <= figure.bbox.width:
                break
            above.remove()
        rows = -(-len(names) // columns) + bool(title)
        figure.set_figheight(figure.get_figheight() + 0.16 * rows)


def _covers(figure: Any, ax: Any, within: Any) -> bool:
    """Whether lines, markers or areas of the axes are behind their legend."""
    # That lays it out, and does not draw it.
    figure.get_layout_engine().execute(figure)
    box = within.get_window_extent()
    for line in ax.get_lines():
        path = line.get_path().transformed(line.get_transform())
        joined = line.get_linestyle() != "None"
        if path.intersects_bbox(box, filled=False) if joined else box.count_contains(path.vertices):
            return True
    for area in (*ax.collections, *ax.patches):
        paths = area.get_paths() if hasattr(area, "get_paths") else [area.get_path()]
        if any(path.transformed(area.get_transform()).intersects_bbox(box, filled=True) for path in paths if len(path.vertices)):
            return True
    return False
