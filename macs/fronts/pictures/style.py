"""Colours, fonts and labels of all figures."""

from __future__ import annotations

import textwrap
from typing import Any

from problems.compiled import Objective

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#882255")
"""Colours of Okabe and Ito, which readers with any colour vision can distinguish; wine red instead of black, which is for references."""


GREY = "#666666"


LETTER = 0.6
"""Width of a letter, of its size: more than that of most words, so that lines end before the picture does."""


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
    "axes.formatter.limits": (-4, 6),
}


def new_figure(width: float, height: float) -> Any:
    """A figure for `pyplot.show` if there is a display; otherwise one that can only be saved."""
    try:
        from matplotlib import pyplot

        return pyplot.figure(figsize=(width, height), layout="constrained")
    except ImportError:
        # The backend of the environment needs a display or a toolkit that is not available.
        from matplotlib.figure import Figure

        return Figure(figsize=(width, height), layout="constrained")


def blank_figure() -> Any:
    """A figure without a window, for files."""
    from matplotlib.figure import Figure

    return Figure(figsize=(5.5, 4.0), layout="constrained")


def label(name: str, unit: str) -> str:
    """Label of an axis: `name [unit]`."""
    return f"{name} [{unit}]" if unit else name


def wrapped(text: str, width: float, size: float = 9.0) -> str:
    """Text in lines of at most `width` inches in letters of `size` points, as wide as they are on average."""
    return textwrap.fill(text, max(int(72.0 * width / (LETTER * size)), 1))


def better(goal: Objective) -> str:
    """Label of an axis with an arrow towards better values; on a vertical axis, left means down."""
    text = label(goal.name, goal.unit)
    return f"\N{LEFTWARDS ARROW} {text}" if goal.sense == "minimize" else f"{text} \N{RIGHTWARDS ARROW}"
