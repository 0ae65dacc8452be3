"""Colours, fonts, labels, axes and kinds of points of all figures. matplotlib is imported only where one is drawn."""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from typing import Any

import numpy as np

from problems.compiled import Objective
from transcription.trajectories.trajectory import PhaseTrajectory, ran_over

from ...evaluation.evaluator import CONVERGED
from ...io.text import label

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#882255", "#332288")
"""Colours that any colour vision can distinguish: of Okabe and Ito, but for black, which is for references, and two dark ones of Tol."""


GREY = "#666666"


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


@contextmanager
def styled() -> Iterator[None]:
    """A context in which figures have this style."""
    import matplotlib

    with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
        yield


def new_figure(width: float, height: float) -> Any:
    """A figure for `pyplot.show` if there is a display; otherwise one that can only be saved."""
    try:
        from matplotlib import pyplot

        return pyplot.figure(figsize=(width, height), layout="constrained")
    except ImportError:
        # The backend of the environment needs a display or a toolkit that is not available.
        return blank_figure(width, height)


def blank_figure(width: float = 5.5, height: float = 4.0) -> Any:
    """A figure without a window, for files."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def rendered(figure: Any, suffix: str, dpi: float) -> bytes:
    """A figure as the content of a file of a format."""
    picture = io.BytesIO()
    figure.savefig(picture, format=suffix, dpi=dpi)
    return picture.getvalue()


def check_no_path(given: Any) -> None:
    """Raise ValueError if the name of a file is given where a figure or axes belong."""
    if isinstance(given, str | PathLike):
        remedy = f"to write one, take that of the axes that are returned, as in front.plot().figure.savefig({str(given)!r})"
        raise ValueError(f"a picture is drawn into a figure, not into a file: {remedy}")


def axis_label(name: str, unit: str) -> str:
    """Label of an axis: `name [unit]`, with powers as print has them. Lines do not end within the unit."""
    return plain(label(name, raised(unit).replace(" ", "\N{NO-BREAK SPACE}")))


def time_label(phases: Iterable[PhaseTrajectory]) -> str:
    """Label of the axis of what phases run over, which their units say: mostly time."""
    units = [*dict.fromkeys(phase.time_unit for phase in phases)]
    return axis_label(" | ".join(dict.fromkeys(map(ran_over, units))), " | ".join(units))


def raised(unit: str) -> str:
    """A unit with powers as print has them: m², not m2."""
    return POWER.sub(lambda found: found[1] + found[2].translate(RAISED), unit)


def quantity(number: str, unit: str) -> str:
    """A number and its unit as print has them."""
    return f"{number} {raised(unit)}".replace("-", "\N{MINUS SIGN}", number.count("-")).rstrip()


def plain(text: str) -> str:
    """Words of the user for a picture: of two dollars matplotlib would make mathematics."""
    return text.replace("$", r"\$") if text.count("$") > 1 else text


def axis_number(value: float) -> str:
    """A number beside an axis: four digits, all of large ones, without powers of ten from a ten-thousandth to ten millions."""
    text = f"{value + 0.0:.4g}" if abs(value) < 1e4 or abs(value) >= 1e7 else f"{value:.0f}"
    digits, _, power = text.partition("e")
    rest = f"\N{MULTIPLICATION SIGN}10{str(int(power)).translate(RAISED)}" if power else ""
    return quantity(digits, "") + rest


def wrapped(text: str, width: float, size: float = 9.0) -> str:
    """Text in lines of at most `width` inches in letters of `size` points, as wide as they are on average."""
    # A letter is taken to be 0.6 of its size wide: more than in most words, so that lines end before the picture does.
    return textwrap.fill(text, max(int(72.0 * width / (0.6 * size)), 1))


def better(goal: Objective) -> str:
    """Label of an axis with an arrow towards better values; on a vertical axis, left means down."""
    text = axis_label(goal.name, goal.unit)
    return f"\N{LEFTWARDS ARROW} {text}" if goal.sense == "minimize" else f"{text}\N{NO-BREAK SPACE}\N{RIGHTWARDS ARROW}"


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


# Kinds of points


NOT_VERIFIED, NOT_FEASIBLE, NOT_SIMULATED = "not verified", "not feasible", "not simulated"
"""Words of legends."""


def kinds(front: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masks (n,) of the points that are drawn in full, of those that were simulated and are not verified, and of those not feasible."""
    feasible = front.status == CONVERGED
    apart = feasible & front.was_simulated & ~front.verified
    return feasible & ~apart, apart, ~feasible


def hollow(point: Any) -> bool:
    """Whether a point is drawn hollow: it is not feasible, or was simulated and is not verified."""
    return point.status != CONVERGED or point.verified is False


def remark(point: Any) -> str:
    """What a title says of a point: "not feasible", "not verified" or "not simulated"; empty if there is nothing to say."""
    if point.status != CONVERGED:
        return NOT_FEASIBLE
    if point.verified is None:
        return NOT_SIMULATED if point.trajectory is not None else ""
    return "" if point.verified else NOT_VERIFIED


def caption(point: Any) -> str:
    """The objectives of a point with units as print has them, and the remark on it."""
    values = ", ".join(f"{goal.name} {quantity(text, goal.unit)}" for goal, text in zip(point.goals, point.texts, strict=True))
    return "; ".join(filter(None, [values, remark(point)]))


def draw_hollow(ax: Any, places: np.ndarray, front: Any, size: float, rims: Any = COLORS[0]) -> None:
    """Draw the points that are not verified or not feasible as hollow dots at `places` (2 or 3, n)."""
    _, apart, infeasible = kinds(front)
    for rows, name, edge in ((apart, NOT_VERIFIED, rims), (infeasible, NOT_FEASIBLE, GREY)):
        if rows.any():
            look = {"facecolors": "none", "edgecolors": edge, "linewidths": 0.9}
            ax.scatter(*places[:, rows], s=size, zorder=2, label=name, **look)


# Panels, one above the other


PANEL = (3.6, 1.75)
"""Inches: width and height of a panel."""


def panel_grid(
    figure: Any, groups: Sequence[int], *, panel: tuple[float, float] = PANEL, columns: int | None = None, above: float = 0.6
) -> tuple[Any, np.ndarray]:
    """A figure, and the axes of its panels, which share the horizontal axis. Each group of so many panels begins a row; `above` are the
    inches for titles and labels."""
    check_no_path(figure)
    columns = columns or (1 if groups[0] < 3 else 2 if groups[0] < 9 else 3)
    rows = [-(-count // columns) for count in groups]
    size = panel[0] * columns + 0.4, panel[1] * sum(rows) + above
    if figure is None:
        figure = new_figure(*size)
    else:
        figure.set_size_inches(*size)
    grid = figure.subplots(sum(rows), columns, sharex=True, squeeze=False).ravel()
    used = [sum(rows[:k]) * columns + i for k, count in enumerate(groups) for i in range(count)]
    for ax in np.delete(grid, used):
        ax.remove()
    for i in used:
        grid[i].tick_params(labelbottom=i + columns not in used)
    return figure, grid[used]


def figure_title(figure: Any, title: str) -> None:
    """Write the title of a figure of several panels."""
    figure.suptitle(wrapped(plain(title), figure.get_figwidth()), fontsize=9, x=0.01, ha="left")


def note_above(ax: Any, text: str) -> None:
    """Write a small remark above a panel, at its right."""
    ax.set_title(text, loc="right", fontsize=7, color=GREY, pad=2)


def beside(name: str, unit: str) -> str:
    """The label of a vertical axis, in lines no longer than a panel is high."""
    return wrapped(axis_label(name, unit), PANEL[1] - 0.25)


def interval(lower: float, upper: float) -> str:
    """Bounds as text: in [0, 40], = 3, or the finite one alone."""
    low, high = axis_number(lower), axis_number(upper)
    if np.isinf(lower):
        return f"\N{LESS-THAN OR EQUAL TO} {high}"
    if np.isinf(upper):
        return f"\N{GREATER-THAN OR EQUAL TO} {low}"
    return f"= {low}" if lower == upper else f"in [{low}, {high}]"


ROUND_OFF = 1e-6
"""A quantity that varies by less than this part of the span of its bounds is constant."""

Limits = tuple[tuple[float, float] | None, float, float]
"""Between which places across they hold (None: all), and the lower and upper limit; infinite where there is none."""


def draw_limits(ax: Any, values: np.ndarray, limits: Sequence[Limits], reach: float = 1.0, margin: float = 0.06) -> None:
    """Set the vertical range of axes and draw dashed lines at limits in it."""
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    spans = [upper - lower for _, lower, upper in limits if np.isfinite(upper - lower)]
    if is_constant(low, high, max(spans, default=0.0)):
        low, high = _around(low, high, limits)
        reach = 0.0
    near = [
        (across, bound)
        for across, lower, upper in limits
        for bound in dict.fromkeys((lower, upper))
        if np.isfinite(bound) and low - reach * (high - low) <= bound <= high + reach * (high - low)
    ]
    for across, bound in near:
        look: dict[str, Any] = {"color": GREY, "lw": 0.8, "ls": (0, (5, 3)), "zorder": 1}
        if across is None:
            ax.axhline(bound, **look)
        else:
            ax.plot(across, [bound, bound], **look)
    ends = [low, high, *(bound for _, bound in near)]
    room = margin * (max(ends) - min(ends))
    ax.set_ylim(min(ends) - room, max(ends) + room)


def is_constant(low: float, high: float, span: float) -> bool:
    """Whether values between these are those of a constant whose bounds have this span (0: none)."""
    return high - low <= max(1e-4 * max(abs(low), abs(high)), ROUND_OFF * span)


def _around(low: float, high: float, limits: Sequence[Limits]) -> tuple[float, float]:
    """The range in which a constant is drawn."""
    size = max(abs(low), abs(high))
    both = [(lower, upper) for _, lower, upper in limits if np.isfinite(upper - lower) and lower < upper]
    span = max((upper - lower for lower, upper in both), default=0.0)
    # One that is small beside its bounds could not be read within these, unless it is zero.
    if both and (size >= 0.05 * span or size <= ROUND_OFF * span):
        return min(low, *(lower for lower, _ in both)), max(high, *(upper for _, upper in both))
    return about(low, high)


def about(low: float, high: float) -> tuple[float, float]:
    """A range in which a constant, of values between these, looks constant."""
    half = 0.1 * max(abs(low), abs(high)) or 1.0
    return low - half, high + half
