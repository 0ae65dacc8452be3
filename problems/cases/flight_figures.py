"""Figures of flights of winged vehicles: what happens along them over time, and the ground track, for one flight or a whole population."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES = 801
"""Of each phase."""
RED = "#D55E00"
POWERS = str.maketrans("23", "²³")
"""Of units, as print has them."""


def track(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Longitude and latitude in degrees, of a flight's states by name."""
    return {f"{name} [deg]": degrees(1.0) * values[name] for name in ("longitude", "latitude")}


def trajectories(flights: Sequence[Any]) -> list[Any]:
    """The trajectories of what has any. Raises ValueError if nothing has."""
    found = [flight.trajectory for flight in flights if flight.trajectory is not None]
    if not found:
        raise ValueError("there is no flight to draw")
    return found


def pictures(
    flights: Sequence[Sequence[Any]], values: np.ndarray, label: str, along: Sequence[str], units: Mapping[str, tuple[str, float]]
) -> dict[str, Figure]:
    """Both figures by name, "population" and "ground-track", of the phases of each flight.

    The flights are coloured by `values`, which the label explains. `along` names the states and controls that have a panel over time,
    `units` for names of panels their unit, and its size in that of the quantity; the others are in degrees.
    """
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    colors = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, 256))
    shades = ScalarMappable(Normalize(values.min(), values.max()), ListedColormap(colors))
    coloured = list(zip(flights, shades.to_rgba(values).tolist(), strict=True))
    figures = {"population": _over_time(coloured, along, units), "ground-track": _on_the_map(coloured)}
    if len(flights) > 1:
        for figure in figures.values():
            figure.colorbar(shades, ax=figure.axes, label=label, shrink=0.5, aspect=30, pad=0.02).outline.set_visible(False)
    return figures


def _over_time(coloured: Sequence[tuple[Sequence[Any], Any]], along: Sequence[str], units: Mapping[str, tuple[str, float]]) -> Figure:
    """Panels over time: states and controls, commands that have no panel of their own dashed beside what follows them, and limited
    quantities with their limits."""
    limits, width = coloured[0][0][0].path_limits, _width(coloured)
    panels = [*along, *(limit.name for limit in limits)]
    figure = _figure(7.2, 1.45 * -(-len(panels) // 3) + 0.3)
    grid = figure.subplots(-(-len(panels) // 3), 3, sharex=True).ravel()
    for ax, name in zip(grid, panels, strict=False):
        unit, size = units.get(name, ("deg", degrees(1.0) if name in along else 1.0))
        for flight, color in coloured:
            for phase in flight:
                times, values = _along(phase)
                if name in along:
                    ax.plot(times, size * values[name], color=color, lw=width)
                else:
                    ax.plot(phase.time, size * phase[name], color=color, lw=width)
                command = f"{name} command"
                if command in phase.names and command not in along:
                    ax.plot(times, size * values[command], color=color, lw=0.5 * width, ls=(0, (4, 2)))
        ax.set_title(f"{name} [{unit.translate(POWERS)}]", loc="left", fontsize="small")
        ax.margins(x=0.0)
    for ax, limit in zip(grid[len(along) :], limits, strict=False):
        for bound in (limit.lower, limit.upper):
            if np.isfinite(bound):
                ax.axhline(units.get(limit.name, ("", 1.0))[1] * bound, color=RED, lw=0.9, ls=(0, (4, 2)))
    for ax in grid[len(panels) :]:
        ax.remove()
    for ax in grid[len(panels) - 3 : len(panels)]:
        ax.tick_params(labelbottom=True)
    figure.supxlabel("time [s]", fontsize="medium")
    return figure


def _on_the_map(coloured: Sequence[tuple[Sequence[Any], Any]]) -> Figure:
    """Latitude over longitude, with a dot at the end of each phase."""
    figure = _figure(5.0, 3.0)
    ax = figure.subplots()
    for flight, color in coloured:
        for phase in flight:
            east, north = track(_along(phase)[1]).values()
            ax.plot(east, north, color=color, lw=_width(coloured), zorder=2)
            ax.plot(east[-1:], north[-1:], "o", color=color, ms=3.0, mec="white", mew=0.3, zorder=3)
    ax.set_xlabel("longitude [deg]")
    ax.set_ylabel("latitude [deg]")
    ax.set_aspect("equal", adjustable="datalim")
    return figure


def _width(flights: Sequence[Any]) -> float:
    """Of lines."""
    return 0.9 if len(flights) > 1 else 1.3


def _along(phase: Any) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times, and states and controls by name there."""
    times = np.linspace(phase.t0, phase.tf, SAMPLES)
    return times, phase.at(times)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")
