"""Colours, fonts and labels of all figures."""

from __future__ import annotations

import io
import re
import textwrap
from os import PathLike
from typing import Any

from problems.compiled import Objective

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#882255")
"""Colours of Okabe and Ito, which readers with any colour vision can distinguish; wine red instead of black, which is for references."""


GREY = "#666666"


LETTER = 0.6
"""Width of a letter, of its size: more than that of most words, so that lines end before the picture does."""


POWER = re.compile(r"\b(m|mm|cm|km|s|min|h|d|yr|ft|in|rad|deg|K|DU|TU|(?<!g )(?<!t )(?<!l )k?N|kg|J|W|Pa|kPa|V|A)\^?(-?\d)\b")
"""A unit with its power, as it is typed: m2, s^2, N2; but not what a mass or an amount is of, such as t N2."""


RAISED = str.maketrans("-0123456789", "\N{SUPERSCRIPT MINUS}⁰¹²³⁴⁵⁶⁷⁸⁹")


STYLE = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 7),
    "axes.formatter.use_mathtext": True,
}


def new_figure(width: float, height: float) -> Any:
    """A figure for `pyplot.show` if there is a display; otherwise one that can only be saved."""
    try:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=(width, height), layout="constrained")
    except ImportError:
        # The backend of the environment needs a display or a toolkit that is not available.
        return blank_figure(width, height)
    figure.add_axobserver(_number_plainly)
    return figure


def blank_figure(width: float = 5.5, height: float = 4.0) -> Any:
    """A figure without a window, for files."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    figure.add_axobserver(_number_plainly)
    return figure


def _number_plainly(figure: Any) -> None:
    """Let new axes of a figure have plain numbers: matplotlib sets each as a formula, which takes long."""
    from matplotlib.ticker import ScalarFormatter

    from .ticks import PlainNumbers

    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            if type(axis.get_major_formatter()) is ScalarFormatter:
                axis.set_major_formatter(PlainNumbers())


def rendered(figure: Any, suffix: str, dpi: float) -> bytes:
    """A figure as the content of a file of a format."""
    picture = io.BytesIO()
    figure.savefig(picture, format=suffix, dpi=dpi)
    return picture.getvalue()


def label(name: str, unit: str) -> str:
    """Name of a column or a line: `name [unit]`."""
    return f"{name} [{unit}]" if unit else name


def per(unit: str) -> str:
    """Unit of what is per unit of something, such as a costate; empty if it has none."""
    return f"per {unit}" if unit else ""


def check_no_path(given: Any, call: str) -> None:
    """Raise ValueError if the name of a file is given where a figure or axes belong; `call` is what is drawn into a file."""
    if isinstance(given, str | PathLike):
        raise ValueError(f"a picture is drawn into a figure, not into a file: to write one, {call}.figure.savefig({str(given)!r})")


def axis_label(name: str, unit: str) -> str:
    """Label of an axis: `name [unit]`, with powers as print has them. Lines do not end within the unit."""
    return plain(label(name, raised(unit).replace(" ", "\N{NO-BREAK SPACE}")))


def raised(unit: str) -> str:
    """A unit with powers as print has them: m², not m2."""
    return POWER.sub(lambda found: found[1] + found[2].translate(RAISED), unit)


def plain(text: str) -> str:
    """Words of the user for a picture: of two dollars matplotlib would make mathematics."""
    return text.replace("$", r"\$") if text.count("$") > 1 else text


def axis_number(value: float) -> str:
    """A number beside an axis: four digits, all of large ones, without powers of ten from a ten-thousandth to ten millions."""
    text = f"{value + 0.0:.4g}" if abs(value) < 1e4 or abs(value) >= 1e7 else f"{value:.0f}"
    digits, _, power = text.partition("e")
    rest = f"\N{MULTIPLICATION SIGN}10{str(int(power)).translate(RAISED)}" if power else ""
    return digits.replace("-", "\N{MINUS SIGN}") + rest


def wrapped(text: str, width: float, size: float = 9.0) -> str:
    """Text in lines of at most `width` inches in letters of `size` points, as wide as they are on average."""
    return textwrap.fill(text, max(int(72.0 * width / (LETTER * size)), 1))


def better(goal: Objective) -> str:
    """Label of an axis with an arrow towards better values; on a vertical axis, left means down."""
    text = axis_label(goal.name, goal.unit)
    return f"\N{LEFTWARDS ARROW} {text}" if goal.sense == "minimize" else f"{text} \N{RIGHTWARDS ARROW}"


def title_and_legend(ax: Any, title: str, columns: int = 3) -> None:
    """Write the title of axes and below it, above the axes, where no data can be, their legend in at most so many columns."""
    handles, names = ax.get_legend_handles_labels()
    pad = None
    if handles:
        room = ax.bbox.width / ax.figure.dpi
        names = [wrapped(plain(name), room - 0.4, 8.0) for name in names]
        for count in range(min(columns, len(names)), 0, -1):
            place = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
            legend = ax.legend(handles, names, frameon=False, ncols=count, handletextpad=0.4, **place)
            box = legend.get_window_extent()
            if box.width <= ax.bbox.width:
                break
        pad = 72.0 * box.height / ax.figure.dpi + 4.0
    if title:
        ax.set_title(plain(title), loc="left", color=GREY, pad=pad)
