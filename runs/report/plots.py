"""Figures of studies for papers: collective fronts, attainment surfaces, convergence. At the width of a column, without a display.

Every function returns a matplotlib `Figure` of no window; `figure.savefig` writes it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.fronts.pictures.style import COLORS, GREY, STYLE, better, blank_figure, wrapped
from macs.io.text import counted
from problems.compiled import Objective

from ..measures.attainment import Attainment, History, band, staircase
from ..measures.indicators import Points, minimised, pieces, truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMN, PAGE = 3.5, 7.2
"""Inches: the width of a column, and of a page of two."""
PAPER: dict[str, Any] = {
    **STYLE,
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), 8.0),
    **dict.fromkeys(("legend.fontsize", "xtick.labelsize", "ytick.labelsize"), 7.0),
    **dict.fromkeys(("axes.linewidth", "xtick.major.width", "ytick.major.width"), 0.6),
    "legend.handlelength": 1.6,
}
MARKERS = "o^sDvPX*"
OVERLAID = 3
"""Most solvers in the same panels of a figure: the points of more hide each other."""


def style() -> Any:
    """A context in which figures are drawn as papers want them."""
    import matplotlib

    return matplotlib.rc_context(PAPER)  # type: ignore[arg-type]


def new_figure(width: float, height: float) -> Any:
    """A figure of no window."""
    figure = blank_figure()
    figure.set_size_inches(width, height)
    return figure


def legend(figure: Any, ax: Any, title: str = "") -> None:
    """The legend of the axes, above them, where no line is; the figure is higher by it."""
    handles, names = ax.get_legend_handles_labels()
    look = {"frameon": False, "title": title or None, "title_fontsize": 7, "alignment": "left"}
    for columns in range(min(len(names), 6), 0, -1):
        above = figure.legend(handles, names, loc="outside upper left", ncols=columns, **look)
        if columns == 1 or above.get_window_extent().width <= 0.97 * figure.bbox.width:
            figure.set_figheight(figure.get_figheight() + 0.16 * (-(-len(names) // columns) + bool(title)))
            return
        above.remove()


def front_figure(
    fronts: Mapping[str, Sequence[Points]],
    *,
    goals: Sequence[Objective],
    reference: Points | None = None,
    marked: Points | None = None,
    printed: Sequence[Sequence[float]] = (),
    truth_name: str = "truth",
) -> Figure:
    """All points of all runs, the truth as a line where it is a curve, and diamonds at points that a paper prints.

    Up to three solvers share panels, all planes of two objectives; of more each has its own, of the first objective and each other.
    """
    m, signs = len(goals), np.array([goal.sign for goal in goals])
    none = np.empty((0, m))
    every = {solver: [none, *(minimised(front, goals) * signs for front in runs if len(front))] for solver, runs in fronts.items() if runs}
    names = [_runs(solver, len(fronts[solver]), len(fronts[solver]) + 1 - len(found)) for solver, found in every.items()]
    points, places = [*map(np.vstack, every.values())], [[*fronts].index(solver) for solver in every]  # colours are those of all figures
    theirs = np.reshape(printed, (-1, m))
    behind = np.vstack([none, *points]) if reference is None else truth(reference, goals) * signs
    apart = len(every) > OVERLAID
    with style():
        figure, columns = _panels(names, goals, np.vstack([behind, theirs, *points])) if apart else _planes(goals)
        for number, column in enumerate(columns):
            for ax, pair in column:
                if reference is not None:
                    _draw_truth(ax, reference, goals, pair, truth_name)
                elif apart:
                    ax.plot(*behind[:, pair].T, ".", color=GREY, alpha=0.5, ms=3.0, mew=0.0, zorder=1, label="all solvers")
                for k in [number] if apart else range(len(points)):
                    look = {"ms": 2.4, "mew": 0.0} if apart else {"ms": 3.2, "mew": 0.3, "mec": "white", "label": names[k]}
                    marker, color = MARKERS[0 if apart else places[k] % len(MARKERS)], COLORS[places[k] % len(COLORS)]
                    ax.plot(*points[k][:, pair].T, marker, ls="", zorder=3, alpha=0.65, color=color, **look)
                if marked is not None:
                    _mark(ax, (minimised(marked, goals) * signs)[:, pair], signs[[*pair]])
                if len(theirs):
                    ax.plot(*theirs[:, pair].T, "D", color="black", mfc="none", mew=0.9, ms=4.5, zorder=5, label="printed in the paper")
        legend(figure, columns[0][0][0])
    return figure


def _planes(goals: Sequence[Objective]) -> tuple[Any, list[list[Any]]]:
    """A figure of all planes of two objectives: its axes, each with the numbers of the objectives across and up."""
    pairs = list(combinations(range(len(goals)), 2))
    columns = min(3, len(pairs))
    rows = -(-len(pairs) // columns)
    figure = new_figure(COLUMN if rows == columns == 1 else PAGE, 2.7 if len(pairs) == 1 else 2.3 * rows + 0.3)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, (i, j) in zip(grid, pairs, strict=False):
        # A label beside a panel leaves room for its neighbours and powers of ten.
        room = 0.6 * figure.get_figwidth() / columns
        ax.set(xlabel=wrapped(better(goals[i]), room, 8.0), ylabel=wrapped(better(goals[j]), room, 8.0))
    for ax in grid[len(pairs) :]:
        ax.remove()
    return figure, [[*zip(grid, pairs, strict=False)]]


def _panels(titles: Sequence[str], goals: Sequence[Objective], every: np.ndarray) -> tuple[Any, list[list[Any]]]:
    """A figure with a column of axes for each title, of the first objective and each other, as far as `every` point."""
    low, high = (every.min(axis=0), every.max(axis=0)) if len(every) else np.array([[0.0], [1.0]]) * np.ones(len(goals))
    margin = 0.04 * np.where(high > low, high - low, 1.0)
    others = range(1, len(goals))
    blocks = -(-len(titles) // (3 if len(others) == 1 else 5))
    columns = -(-len(titles) // blocks)
    width, height = COLUMN if columns == 1 else PAGE, 2.0 if len(others) == 1 else 1.15
    figure = new_figure(width, (height * len(others) + 0.35) * blocks + 0.2)
    grid = figure.subplots(len(others) * blocks, columns, squeeze=False)
    found = list[list[Any]]()
    for k, title in enumerate(titles):
        block, column = divmod(k, columns)
        found.append([(grid[len(others) * block + j - 1, column], (0, j)) for j in others])
        for ax, (_, j) in found[-1]:
            ax.set(xlim=(low[0] - margin[0], high[0] + margin[0]), ylim=(low[j] - margin[j], high[j] + margin[j]))
            lowest = j == others[-1] and k + columns >= len(titles)
            ax.tick_params(labelbottom=lowest, labelleft=column == 0)
            ax.set_xlabel(wrapped(better(goals[0]), 0.9 * width / columns, 8.0) if lowest else "")
            ax.set_ylabel(wrapped(better(goals[j]), 0.9 * height, 8.0) if column == 0 else "")
        found[-1][0][0].set_title(wrapped(title, 0.9 * width / columns, 8.0), loc="left")
    for ax in grid[-len(others) :, columns - -len(titles) % columns :].ravel():
        ax.remove()
    return figure, found


def attainment_figure(
    surfaces: Mapping[str, Attainment], *, goals: Sequence[Objective], reference: Points | None = None, truth_name: str = "truth"
) -> Figure:
    """Best, median and worst attainment surface of each solver, of two objectives: a panel a solver, all with the same axes.

    The area between best and worst is shaded. A surface that is empty, because runs are, is not drawn; the title names it.
    """
    signs = np.array([goal.sign for goal in goals])
    corners = [np.zeros((0, 2)), *(one for surface in surfaces.values() for one in surface.corners)]
    if reference is not None:
        corners.append(truth(reference, goals) * signs)
    with style():
        titles = [_runs(solver, one.runs, 0) + " (worst: not attained)" * (not len(one.worst)) for solver, one in surfaces.items()]
        figure, columns = _panels(titles, goals, np.vstack(corners))
        for k, (((ax, pair),), surface) in enumerate(zip(columns, surfaces.values(), strict=True)):
            if reference is not None:
                _draw_truth(ax, reference, goals, pair, truth_name)
            ends = np.array([limits[int(sign > 0)] for limits, sign in zip((ax.get_xlim(), ax.get_ylim()), signs, strict=True)])
            _draw_surfaces(ax, surface, ends, COLORS[k % len(COLORS)])
        legend(figure, columns[0][0][0])
        for line in figure.legends[0].get_lines()[-3:]:  # of all colours
            line.set_color(GREY)
    return figure


def convergence_figure(
    histories: Mapping[str, Sequence[History]], *, xlabel: str, ylabel: str, larger: bool = False, log: bool = True
) -> Figure:
    """An indicator over the cost of a run: the median of each solver's runs as a line, their quartiles as a band.

    Where half of the runs have nothing yet there is no line; where a quarter has nothing, the band is open towards the worse side.
    Costs of runs that are more than a factor of ten apart are drawn on a logarithmic axis.
    """
    with style():
        figure = new_figure(COLUMN if len(histories) <= OVERLAID + 1 else PAGE, 2.5)
        ax = figure.subplots()
        bands = {solver: band(runs, larger=larger) for solver, runs in histories.items()}
        values = np.concatenate([part for b in bands.values() for part in (b.lower, b.median, b.upper)])
        values = values[np.isfinite(values)]
        # Where nothing is positive, there is nothing to draw on a logarithmic axis.
        log = log and bool((values > 0).any())
        values = values[(values > 0) | (not log)]
        low, high = (values.min(), values.max()) if len(values) else (0.0, 1.0)
        first, last = (extreme(b.x[-1] for b in bands.values()) for extreme in (min, max))
        start = min(x for b in bands.values() for x in b.x if x > 0) if last > 10 * first > 0 else 0
        for k, (solver, b) in enumerate(bands.items()):
            color = COLORS[k % len(COLORS)]
            # A run that has ended keeps its front: its line goes on as far as the longest.
            x = np.append(b.x, last)
            lower, median, upper = (np.append(part, part[-1]) for part in (b.lower, b.median, b.upper))
            outside = (low / 10, high * 10) if log else (2 * low - high - 1, 2 * high - low + 1)
            edges = (np.nan_to_num(part, neginf=outside[0], posinf=outside[1]) for part in (lower, upper))
            ax.fill_between(x, *edges, step="post", color=color, alpha=0.2, lw=0)
            drawn = np.where(np.isfinite(median), median, np.nan)
            label = _runs(solver, b.runs, sum(not np.isfinite(y).any() for _, y in histories[solver]))
            ax.plot(x, drawn, drawstyle="steps-post", color=color, lw=1.3, ls=("-", "--", "-.", ":")[k % 4], label=label)
        if log:
            _log_axis(ax, high / low)
            ax.set_ylim(low / (high / low) ** 0.05, high * (high / low) ** 0.05 if high > low else 2 * high)
        else:
            ax.set_ylim(low - 0.05 * (high - low or 1.0), high + 0.05 * (high - low or 1.0))
        ax.set(xscale="log" if start else "linear", xlim=(start, last or 1.0), xlabel=xlabel, ylabel=wrapped(ylabel, 2.0, 8.0))
        legend(figure, ax, "median, quartiles")
    return figure


def _log_axis(ax: Any, ratio: float) -> None:
    """Of less than two decades, plain numbers at 1, 2 and 5 of each; powers of ten otherwise."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.set_yscale("log")
    if ratio < 100:
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if ratio > 5 else tuple(range(1, 10))))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _runs(solver: str, runs: int, empty: int) -> str:
    """MACS, 30 runs (2 empty)."""
    return f"{solver}, {counted(runs, 'run')}{f' ({empty} empty)' if empty else ''}"


def _draw_truth(ax: Any, reference: Points, goals: Sequence[Objective], pair: tuple[int, int], name: str) -> None:
    """A line for each piece of a reference that is a curve, else small points; beneath all else."""
    curves, signs = pieces(reference, goals), np.array([goal.sign for goal in goals])
    for k, curve in enumerate(curves):
        ax.plot(*(curve * signs).T, color="black", lw=0.9, zorder=2, label=name if k == 0 else None)
    if not curves:
        ax.plot(*(truth(reference, goals) * signs)[:, pair].T, ".", color=GREY, alpha=0.5, ms=2.5, zorder=1, label=name)


def _mark(ax: Any, places: np.ndarray, signs: np.ndarray) -> None:
    """Crosses at places (n, 2), and numbers on their better side, where no point can be in the way."""
    ax.plot(*places.T, "+", color="black", ms=7, mew=1.0, zorder=5)
    sides = {"ha": "right" if signs[0] > 0 else "left", "va": "top" if signs[1] > 0 else "bottom"}
    for number, place in enumerate(places, 1):
        ax.annotate(str(number), place, xytext=tuple(-3 * signs), textcoords="offset points", fontsize=7, zorder=6, **sides)
    ax.margins(0.07)


def _draw_surfaces(ax: Any, surface: Attainment, ends: np.ndarray, color: str) -> None:
    """Lines for the best, median and worst surface, and the area between the first and the last."""
    drawn = {}
    for name, corners, look in (
        ("best", surface.best, {"lw": 0.8, "ls": "--"}),
        ("median", surface.median, {"lw": 1.4, "ls": "-"}),
        ("worst", surface.worst, {"lw": 0.8, "ls": ":"}),
    ):
        if len(corners):
            drawn[name] = staircase(corners, surface.signs, ends)
        ax.plot(*drawn.get(name, np.empty((0, 2))).T, color=color, label=name, zorder=4, **look)
    if "best" in drawn and "worst" in drawn:
        border = np.vstack([drawn["best"], drawn["worst"][::-1]])
        ax.fill(*border.T, color=color, alpha=0.18, lw=0, zorder=3)
