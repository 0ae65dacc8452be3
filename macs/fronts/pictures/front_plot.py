"""Figures of fronts, by objectives and by variables. They need no display: pyplot is used only if the caller gives no Axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import cycle
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Objective

from ...io.atomic import write_whole
from ...io.text import counted
from ..curve import curve_of
from .style import (
    COLORS,
    GREY,
    NOT_FEASIBLE,
    NOT_SIMULATED,
    NOT_VERIFIED,
    about,
    axis_label,
    axis_number,
    better,
    blank_figure,
    check_no_path,
    draw_hollow,
    draw_limits,
    figure_title,
    interval,
    kinds,
    new_figure,
    note_above,
    panel_grid,
    quantity,
    rendered,
    styled,
    title_and_legend,
    wrapped,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes


EQUAL_OBJECTIVES = 1e-9
"""Objectives that differ by less, of their size, are the same but for round-off."""


def save_front(front: Any, path: str | PathLike[str]) -> None:
    """Draw a front into a file; the suffix gives the format."""
    _write(front_figure(front), path)


def save_picture(what: Any, path: str | PathLike[str], **how: Any) -> None:
    """Draw what has a `plot(figure=)`, such as the trajectory of a point, into a file; the suffix gives the format."""
    figure = blank_figure()
    what.plot(figure=figure, **how)
    _write(figure, path)


def _write(figure: Any, path: str | PathLike[str]) -> None:
    write_whole(path, rendered(figure, Path(path).suffix.lstrip(".").lower(), 200))


def front_figure(front: Any) -> Any:
    """A figure without a window of a front."""
    figure = blank_figure()
    figure.set_size_inches(*_size(front))
    draw_front(front, figure.add_subplot())
    return figure


def _size(front: Any) -> tuple[float, float]:
    return (7.0 if len(front.goals) > 3 else 5.5, 4.0)


def draw_front(front: Any, ax: Axes | None = None, marked: Sequence[int] = (), beside: Mapping[str, Any] | None = None) -> Axes:
    """Axes with the objectives of a front.

    One objective is drawn against the number of the point, two as points on a curve, three with the third as colour (or in space, on 3-D
    Axes), more as parallel coordinates. Points that did not converge, and those that a simulation did not confirm, are hollow or broken
    lines; none of them is marked as best.
    """
    check_no_path(ax)
    if len(marked) > len(COLORS):
        raise ValueError(f"at most {len(COLORS)} points can be marked in a picture, not {len(marked)}")
    if beside and len(front.goals) != 2:
        raise ValueError(f"other points are drawn beside those of two objectives, not of {len(front.goals)}")

    with styled():
        if ax is None:
            ax = new_figure(*_size(front)).add_subplot()
        if len(front.goals) > 3:
            _parallel(front, ax, marked)
        else:
            _draw_beside(ax, beside or {})
            _scatter(front, ax, marked)
        title_and_legend(ax, _title(front))
    return ax


def _draw_beside(ax: Any, beside: Mapping[str, Any]) -> None:
    """Draw other points: dots so small that many make a line, which may have gaps, or crosses if there are few."""
    for (name, values), color in zip(beside.items(), cycle(("black", GREY))):
        many = len(values) > 100
        look: dict[str, Any] = {"marker": "o", "ms": 0.9, "mew": 0.0} if many else {"marker": "x", "ms": 5.0}
        ax.plot(*np.asarray(values, dtype=float).T, ls="none", color=color, zorder=1, **look)
        ax.plot([], [], "-" if many else "x", color=color, lw=1.0, ms=5.0, label=name)


def _title(front: Any) -> str:
    name = front.source.name if front.source else front.solver.get("name", "")
    if not len(front):
        return f"{name}: no feasible point" if name else "no feasible point"
    said = f", {NOT_SIMULATED}" if front.dynamic and not front.was_simulated.any() else ""
    return f"{name}, {counted(len(front), 'point')}{said}".lstrip(", ")


def _scatter(front: Any, ax: Any, marked: Sequence[int]) -> None:
    from matplotlib.ticker import MaxNLocator

    if not len(front):
        words = wrapped(front.message, 0.8 * ax.bbox.width / ax.figure.dpi)
        ax.text(0.5, 0.9, words, transform=ax.transAxes, ha="center", va="top", color=GREY)
        front = front if front.closest is None else front.closest.alone()
    values, (good, apart, _) = front.objectives, kinds(front)
    if values.shape[1] == 1:
        values = np.column_stack([np.arange(len(values)), values])
    goals = front.goals if len(front.goals) > 1 else (Objective("point"), *front.goals)
    if len(front.goals) == 1:
        ax.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        ax.set_xlim(-0.5, max(len(values), 1) - 0.5)
    third = values.shape[1] == 3 and ax.name != "3d"
    axes = values.T[:2] if third else values.T
    color: dict[str, Any] = {"c": values[good, 2], "cmap": "viridis"} if third else {"color": COLORS[0]}
    shades = _shades(values[good | apart, 2]) if third and (good | apart).any() else None
    if len(front.goals) == 2:
        _draw_curve(front, ax)
    ax.scatter(*axes[:, good], s=26, linewidths=0.4, edgecolors="white", zorder=3, **color, norm=shades and shades.norm)
    draw_hollow(ax, axes, front, 26, shades.to_rgba(values[apart, 2]) if shades else COLORS[0])
    if shades:
        ax.figure.colorbar(shades, ax=ax, label=better(goals[2]), pad=0.02).outline.set_visible(False)
    for axis, goal in zip("xyz" if not third else "xy", goals, strict=False):
        getattr(ax, f"set_{axis}label")(better(goal) if goal in front.goals else goal.name)
    for axis, column in zip("xyz", axes, strict=False):
        ends = _about(column) if len(column) > 1 else None
        if ends:
            getattr(ax, f"set_{axis}lim")(*ends)
    for i, edge in zip(marked, COLORS, strict=False):
        ax.scatter(*axes[:, [i]], zorder=4, label=_named(front, i), s=80, facecolors="none", edgecolors=edge, linewidths=1.5)
    if len(front.goals) == 2 and good.sum() > 1 and not len(marked):
        _mark_extremes(front, ax)


def _draw_curve(front: Any, ax: Any) -> None:
    """Draw the curve through points with known slopes, if there is one, where it is known; its gaps are gaps."""
    with suppress(ValueError):
        ax.plot(*curve_of(front).within().sample(400).T, color=COLORS[0], lw=1.1, alpha=0.6, zorder=2)


def _shades(values: np.ndarray) -> Any:
    """Colours of the values of a third objective, of points that are not verified, too."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(*(_about(values) or (values.min(), values.max()))), "viridis")


def _about(values: np.ndarray) -> tuple[float, float] | None:
    """Ends of a range about values that are all the same but for round-off; None for others."""
    finite = values[np.isfinite(values)]
    size = float(np.abs(finite).max(initial=0.0))
    if not len(finite) or np.ptp(finite) > EQUAL_OBJECTIVES * size:
        return None
    return about(float(finite.min()), float(finite.max()))


def _values(front: Any, number: int) -> list[str]:
    """The objectives of a point with their units, as tables have them."""
    return [quantity(text, goal.unit) for text, goal in zip(front.texts(front.objectives[number]), front.goals, strict=True)]


def _named(front: Any, number: int) -> str:
    """The number of a point and its objectives, for a legend."""
    return f"#{range(len(front))[number]}: {', '.join(_values(front, number))}"


def _mark_extremes(front: Any, ax: Any) -> None:
    """Mark the best point of each of two objectives; the legend has its value."""
    F = np.where(kinds(front)[0][:, None], front.F, np.inf)
    for k, goal in enumerate(front.goals):
        best = int(np.lexsort([F[:, 1 - k], F[:, k]])[0])
        x, y = front.objectives[best]
        text = f"best {goal.name}: {_values(front, best)[k]} (#{best})"
        marker = {"marker": "os"[k], "s": 80, "facecolors": "none", "edgecolors": COLORS[1 + k], "linewidths": 1.3}
        ax.scatter([x], [y], zorder=4, label=text, **marker)


def _parallel(front: Any, ax: Any, marked: Sequence[int]) -> None:
    """Draw parallel coordinates: a vertical axis for each objective, better at the top, and a line for each point. Points that are not
    feasible or not verified may lie beyond the ends of the axes, which are those of the others, if there are two or more."""
    import matplotlib

    F, (good, apart, infeasible) = front.F, kinds(front)
    finite = np.where(np.isfinite(F) & (good | (good.sum() < 2))[:, None], F, np.nan)
    if len(front) and not np.isnan(finite).all():
        best, worst = np.nanmin(finite, axis=0), np.nanmax(finite, axis=0)
    else:
        best = worst = np.zeros(F.shape[1])
    same = worst - best <= EQUAL_OBJECTIVES * np.maximum(np.abs(worst), np.abs(best))
    height = np.where(same & np.isfinite(F), 1.0, 1.0 - (F - best) / np.where(same, 1.0, worst - best))
    shade = matplotlib.colormaps["viridis"]
    for row in height[good]:
        ax.plot(row, color=shade(0.85 * row[0]), lw=1.0, alpha=0.85)
    for rows, name, look in ((apart, NOT_VERIFIED, "--"), (infeasible, NOT_FEASIBLE, ":")):
        for k, row in enumerate(height[rows]):
            ax.plot(row, color=GREY, lw=1.0, alpha=0.85, ls=look, label="" if k else name)
    for i, color in zip(marked, COLORS, strict=False):
        dashes = "--" if apart[i] else ":" if infeasible[i] else "-"
        ax.plot(height[i], color=color, lw=2.2, ls=dashes, zorder=4, label=_named(front, i))
    parallel_axes(ax, front.goals, best, worst)


def parallel_axes(ax: Any, goals: Sequence[Objective], best: np.ndarray, worst: np.ndarray) -> None:
    """Draw the vertical axes of parallel coordinates, with the best and the worst value (m,) of each objective, all minimised."""
    for k, goal in enumerate(goals):
        ax.plot([k, k], [0, 1], color="black", lw=0.8, zorder=0)
        for level, value in ((1.015, best[k] * goal.sign), (-0.015, worst[k] * goal.sign)):
            ax.text(k, level, axis_number(value), ha="center", va="bottom" if level > 0.5 else "top", fontsize=8)
    ax.grid(False)
    ax.set_xlim(-0.3, len(goals) - 0.7)
    ax.set_ylim(-0.12, 1.12)
    room = ax.bbox.width / ax.figure.dpi / len(goals)
    names = [f"{wrapped(axis_label(goal.name, goal.unit), room, 8.0)}\n{goal.sense[:3]}" for goal in goals]
    ax.set_xticks(range(len(goals)), names)
    ax.set_yticks([0, 1], ["worst", "best"])
    ax.tick_params(length=0)
    for side in ("left", "bottom"):
        ax.spines[side].set_visible(False)


def draw_designs(front: Any, title: str, figure: Any = None, marked: Sequence[int] = ()) -> np.ndarray:
    """Axes, one for each variable, with its values over the first objective of all points: of more than 30, those that vary most.

    Dashed lines are its bounds. Colours are the second objective, if there is one. Points that are not feasible or not verified are hollow.
    """
    decisions, variables, goals, J = front.decision, front.variables, front.goals, front.objectives
    varying = (np.ptp(decisions, axis=0) if len(decisions) else np.zeros(len(variables))) / np.array([v.span for v in variables])
    drawn = sorted(np.argsort(-varying, kind="stable")[:30].tolist())
    good = kinds(front)[0]
    color: dict[str, Any] = {"c": J[good, 1], "cmap": "viridis"} if len(goals) > 1 else {"color": COLORS[0]}
    with styled():
        figure, axes = panel_grid(figure, [len(drawn)], panel=(3.4, 1.8), columns=1 if len(drawn) < 3 else 2 if len(drawn) < 7 else 3)
        for ax, k in zip(axes, drawn, strict=True):
            values, variable = decisions[:, k], variables[k]
            shades = ax.scatter(J[good, 0], values[good], s=16, linewidths=0.3, edgecolors="white", zorder=3, **color)
            draw_hollow(ax, np.stack([J[:, 0], values]), front, 16)
            for i in marked:
                ax.scatter(J[i, 0], values[i], s=70, facecolors="none", edgecolors=COLORS[1], linewidths=1.4, zorder=4)
            draw_limits(ax, values, [(None, variable.lower, variable.upper)], 0.6, margin=0.08)
            ax.set_ylabel(wrapped(axis_label(variable.name, variable.unit), 1.5))
            note_above(ax, "" if variable.choices else interval(variable.lower, variable.upper))
            if variable.choices:
                ax.set_yticks(range(len(variable.choices)), [str(label) for label in variable.choices])
        if len(goals) > 1 and good.any():
            figure.colorbar(shades, ax=list(axes), label=axis_label(goals[1].name, goals[1].unit)).outline.set_visible(False)
        handles, words = axes[0].get_legend_handles_labels()
        if handles:
            figure.legend(handles, words, loc="outside upper right", ncols=len(handles), frameon=False)
        left_out = len(variables) - len(drawn)
        figure_title(figure, f"{title}; {left_out} variables that vary less are left out" if left_out else title)
        figure.supxlabel(axis_label(goals[0].name, goals[0].unit), fontsize=9)
    return axes
