"""Figures of re-entries: states and angles, what the air does, and the ground track, for one flight or a whole population."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees
from typing import TYPE_CHECKING, Any

import numpy as np

from ..winged import STATES
from .statement import ANGLES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .statement import Zone

PHASE = "entry"
SAMPLES = 801
GREY, RED = "#666666", "#D55E00"
ALONG = (*STATES, *ANGLES, *(f"{angle} command" for angle in ANGLES))
UNITS = {
    "altitude": ("km", 1e-3),
    "speed": ("km/s", 1e-3),
    "heating rate": ("Btu/ft2/s", 1.0),
    "dynamic pressure": ("lbf/ft2", 1.0),
    "load factor": ("g", 1.0),
}
"""Unit of a panel, and its size in that of the quantity; the others are in degrees."""


def plot(flights: Sequence[Any], zones: Sequence[Zone] = ()) -> dict[str, Figure]:
    """Both figures by name; parameters as of `flights_figure`."""
    return {"population": flights_figure(flights), "ground-track": track_figure(flights, zones)}


def track(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Longitude and latitude in degrees, of a flight's states by name."""
    return {f"{name} [deg]": degrees(1.0) * values[name] for name in ("longitude", "latitude")}


def flights_figure(flights: Sequence[Any]) -> Figure:
    """Panels over time: states, commands, and limited quantities with their limits. A line for each flight, coloured by its cross-range.

    Parameters
    ----------
    flights : Front, Points, Simulations
        Whatever has a `trajectory`. Of Simulations, the simulated trajectory is drawn; of Points, that of the transcription.
    """
    phases = _phases(flights)
    limits = phases[0].path_limits
    panels = [*ALONG, *(limit.name for limit in limits)]
    figure, (shades, colors) = new_figure(7.2, 1.45 * -(-len(panels) // 3) + 0.3), _colors(phases)
    grid = figure.subplots(-(-len(panels) // 3), 3, sharex=True).ravel()
    for ax, name in zip(grid, panels, strict=False):
        unit, size = UNITS.get(name, ("deg", degrees(1.0) if name in ALONG else 1.0))
        for phase, color in zip(phases, colors, strict=True):
            times, values = _along(phase, name) if name in ALONG else (phase.time, phase[name])
            ax.plot(times, size * values, color=color, lw=0.9 if len(phases) > 1 else 1.3)
        ax.set_title(f"{name} [{unit}]", loc="left")
        ax.margins(x=0.0)
    for ax, limit in zip(grid[len(ALONG) :], limits, strict=False):
        for bound in (limit.lower, limit.upper):
            if np.isfinite(bound):
                ax.axhline(bound, color=RED, lw=0.9, ls=(0, (4, 2)))
    for ax in grid[len(panels) :]:
        ax.remove()
    for ax in grid[len(panels) - 3 : len(panels)]:
        ax.tick_params(labelbottom=True)
    figure.supxlabel("time [s]")
    bar(figure, shades, colors, grid[: len(panels)].tolist(), "cross-range [deg]")
    return figure


def track_figure(flights: Sequence[Any], zones: Sequence[Zone] = ()) -> Figure:
    """Latitude over longitude with the no-fly zones; parameters as of `flights_figure`."""
    phases = _phases(flights)
    figure, (shades, colors) = new_figure(5.0, 3.0), _colors(phases)
    ax = figure.subplots()
    around = np.linspace(0.0, 2 * np.pi, 181)
    for zone in zones:
        east, north = zone.longitude + zone.radius * np.cos(around), zone.latitude + zone.radius * np.sin(around)
        ax.fill(east, north, facecolor="#f3c9b3", edgecolor=RED, lw=0.9, zorder=1)
    for phase, color in zip(phases, colors, strict=True):
        east, north = (degrees(1.0) * _along(phase, name)[1] for name in ("longitude", "latitude"))
        ax.plot(east, north, color=color, lw=0.9 if len(phases) > 1 else 1.3, zorder=2)
        ax.plot(east[-1:], north[-1:], "o", color=color, ms=3.0, mec="white", mew=0.3, zorder=3)
    ax.set_xlabel("longitude [deg]")
    ax.set_ylabel("latitude [deg]")
    ax.set_aspect("equal", adjustable="datalim")
    bar(figure, shades, colors, [ax], "cross-range [deg]")
    return figure


def _phases(flights: Sequence[Any]) -> list[Any]:
    found = [flight.trajectory[PHASE] for flight in flights if flight.trajectory is not None]
    if not found:
        raise ValueError("there is no flight to draw")
    return found


def _along(phase: Any, name: str) -> tuple[np.ndarray, np.ndarray]:
    times = np.linspace(phase.t0, phase.tf, SAMPLES)
    return times, phase.at(times)[name]


def _colors(phases: Sequence[Any]) -> tuple[Any, list[Any]]:
    return colors(np.array([degrees(phase["latitude"][-1]) for phase in phases]))


def colors(values: np.ndarray) -> tuple[Any, list[Any]]:
    """A scale of colours for the values of flights (k,), and the colour of each."""
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    shown = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, 256))
    shades = ScalarMappable(Normalize(values.min(), values.max()), ListedColormap(shown))
    return shades, shades.to_rgba(values).tolist()


def bar(figure: Figure, shades: Any, colors: Sequence[Any], axes: Sequence[Any], label: str) -> None:
    """A colour bar, where there are several colours."""
    if len(colors) > 1:
        figure.colorbar(shades, ax=axes, label=label, shrink=0.5, aspect=30, pad=0.02).outline.set_visible(False)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")
