"""Figures of skip entries: states, controls with their commands, what the air does, and the ground track, for one flight or many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees
from typing import TYPE_CHECKING, Any

import numpy as np

from ..reentry import figures
from ..winged import STATES
from .statement import COMMANDED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES = 501
"""Of each phase."""
ALONG = (*STATES, "mass", *COMMANDED)
UNITS = {"altitude": ("km", 1e-3), "speed": ("km/s", 1e-3), "mass": ("t", 1e-3), "thrust": ("MN", 1e-6), "dynamic pressure": ("kPa", 1e-3)}
UNITS |= {"heating rate": ("Btu/ft2/s", 1.0), "load factor": ("g", 1.0)}
"""Unit of a panel, and its size in that of the quantity; the others are in degrees."""
track = figures.track


def plot(flights: Sequence[Any]) -> dict[str, Figure]:
    """Both figures by name; parameters as of `flights_figure`."""
    return {"population": flights_figure(flights), "ground-track": track_figure(flights)}


def flights_figure(flights: Sequence[Any]) -> Figure:
    """Panels over time: states, commands thinner and dashed, and limited quantities with their limits. A line for each flight, coloured by
    its flight time.

    Parameters
    ----------
    flights : Front, Points, Simulations
        Whatever has a `trajectory`. Of Simulations, the simulated trajectory is drawn; of Points, that of the transcription.
    """
    found = _trajectories(flights)
    limits = next(iter(found[0].values())).path_limits
    panels = [*ALONG, *(limit.name for limit in limits)]
    figure, (shades, colors) = figures.new_figure(7.2, 1.45 * -(-len(panels) // 3) + 0.3), _colors(found)
    grid = figure.subplots(-(-len(panels) // 3), 3, sharex=True).ravel()
    width = 0.9 if len(found) > 1 else 1.3
    for ax, name in zip(grid, panels, strict=False):
        unit, size = UNITS.get(name, ("deg", degrees(1.0)))
        for flight, color in zip(found, colors, strict=True):
            for phase in flight.values():
                times = np.linspace(phase.t0, phase.tf, SAMPLES)
                values = phase.at(times)
                ax.plot(*((times, size * values[name]) if name in ALONG else (phase.time, size * phase[name])), color=color, lw=width)
                if f"{name} command" in phase.names:
                    ax.plot(times, size * values[f"{name} command"], color=color, lw=0.5 * width, ls=(0, (4, 2)))
        ax.set_title(f"{name} [{unit}]", loc="left")
        ax.margins(x=0.0)
    for ax, limit in zip(grid[len(ALONG) :], limits, strict=False):
        ax.axhline(UNITS[limit.name][1] * limit.upper, color=figures.RED, lw=0.9, ls=(0, (4, 2)))
    for ax in grid[len(panels) :]:
        ax.remove()
    for ax in grid[len(panels) - 3 : len(panels)]:
        ax.tick_params(labelbottom=True)
    figure.supxlabel("time [s]")
    figures.bar(figure, shades, colors, grid[: len(panels)].tolist(), "flight time [s]")
    return figure


def track_figure(flights: Sequence[Any]) -> Figure:
    """Latitude over longitude, a dot at the lowest point and at the end of each flight; parameters as of `flights_figure`."""
    found = _trajectories(flights)
    figure, (shades, colors) = figures.new_figure(5.0, 3.0), _colors(found)
    ax = figure.subplots()
    for flight, color in zip(found, colors, strict=True):
        for phase in flight.values():
            values = phase.at(np.linspace(phase.t0, phase.tf, SAMPLES))
            east, north = track({name: np.asarray(values[name]) for name in ("longitude", "latitude")}).values()
            ax.plot(east, north, color=color, lw=0.9 if len(found) > 1 else 1.3)
            ax.plot(east[-1:], north[-1:], "o", color=color, ms=3.0, mec="white", mew=0.3, zorder=3)
    ax.set_xlabel("longitude [deg]")
    ax.set_ylabel("latitude [deg]")
    ax.set_aspect("equal", adjustable="datalim")
    figures.bar(figure, shades, colors, [ax], "flight time [s]")
    return figure


def _trajectories(flights: Sequence[Any]) -> list[Mapping[str, Any]]:
    found = [flight.trajectory for flight in flights if flight.trajectory is not None]
    if not found:
        raise ValueError("there is no flight to draw")
    return found


def _colors(flights: Sequence[Mapping[str, Any]]) -> tuple[Any, list[Any]]:
    return figures.colors(np.array([list(flight.values())[-1].tf for flight in flights]))
