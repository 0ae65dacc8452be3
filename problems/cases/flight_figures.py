"""Figures of flights of winged vehicles: what happens along them over time, and the ground track, for one flight or a whole population."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SAMPLES = 801
"""Of each phase."""
RED = "#D55E00"


def track(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Longitude and latitude in degrees, of a flight's states by name."""
    return {f"{name} [deg]": degrees(1.0) * values[name] for name in ("longitude", "latitude")}


def trajectories(flights: Sequence[Any]) -> list[Any]:
    """The trajectories of what has any. Raises ValueError if nothing has."""
    found = [flight.trajectory for flight in flights if flight.trajectory is not None]
    if not found:
        raise ValueError("there is no flight to draw")
    return found


@dataclass(frozen=True, eq=False)
class ColouredFlights:
    """Flights, each with a value that gives it its colour."""

    flights: Sequence[Sequence[Any]]  # The phases of each flight.
    values: np.ndarray
    label: str  # What the values are.

    def over_time(self, along: Sequence[str], units: Mapping[str, tuple[str, float]]) -> Figure:
        """Panels over time: states and controls, commands that have no panel of their own dashed beside what follows them, and limited
        quantities with their limits.

        `units` has for names of panels their unit, and its size in that of the quantity; the others are in degrees.
        """
        limits = self.flights[0][0].path_limits
        panels = [*along, *(limit.name for limit in limits)]
        figure, (shades, colors) = _figure(7.2, 1.45 * -(-len(panels) // 3) + 0.3), self._colors()
        grid = figure.subplots(-(-len(panels) // 3), 3, sharex=True).ravel()
        for ax, name in zip(grid, panels, strict=False):
            unit, size = units.get(name, ("deg", degrees(1.0) if name in along else 1.0))
            for flight, color in zip(self.flights, colors, strict=True):
                for phase in flight:
                    times, values = _along(phase)
                    if name in along:
                        ax.plot(times, size * values[name], color=color, lw=self._width)
                    else:
                        ax.plot(phase.time, size * phase[name], color=color, lw=self._width)
                    command = f"{name} command"
                    if command in phase.names and command not in along:
                        ax.plot(times, size * values[command], color=color, lw=0.5 * self._width, ls=(0, (4, 2)))
            ax.set_title(f"{name} [{unit}]", loc="left", fontsize="small")
            ax.margins(x=0.0)
        for ax, limit in zip(grid[len(along) :], limits, strict=False):
            for bound in (limit.lower, limit.upper):
                if np.isfinite(bound):
                    ax.axhline(units.get(limit.name, ("", 1.0))[1] * bound, color=RED, lw=0.9, ls=(0, (4, 2)))
        for ax in grid[len(panels) :]:
            ax.remove()
        for ax in grid[len(panels) - 3 : len(panels)]:
            ax.tick_params(labelbottom=True)
        figure.supxlabel("time [s]")
        self._bar(figure, shades, grid[: len(panels)].tolist())
        return figure

    def on_the_map(self) -> tuple[Figure, Axes]:
        """Latitude over longitude, with a dot at the end of each phase."""
        figure, (shades, colors) = _figure(5.0, 3.0), self._colors()
        ax = figure.subplots()
        for flight, color in zip(self.flights, colors, strict=True):
            for phase in flight:
                east, north = track(_along(phase)[1]).values()
                ax.plot(east, north, color=color, lw=self._width, zorder=2)
                ax.plot(east[-1:], north[-1:], "o", color=color, ms=3.0, mec="white", mew=0.3, zorder=3)
        ax.set_xlabel("longitude [deg]")
        ax.set_ylabel("latitude [deg]")
        ax.set_aspect("equal", adjustable="datalim")
        self._bar(figure, shades, [ax])
        return figure, ax

    @property
    def _width(self) -> float:
        return 0.9 if len(self.flights) > 1 else 1.3

    def _colors(self) -> tuple[Any, list[Any]]:
        """A scale of colours, and the colour of each flight."""
        import matplotlib
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import ListedColormap, Normalize

        colors = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, 256))
        shades = ScalarMappable(Normalize(self.values.min(), self.values.max()), ListedColormap(colors))
        return shades, shades.to_rgba(self.values).tolist()

    def _bar(self, figure: Figure, shades: Any, axes: Sequence[Any]) -> None:
        """A colour bar, where there are several colours."""
        if len(self.flights) > 1:
            figure.colorbar(shades, ax=axes, label=self.label, shrink=0.5, aspect=30, pad=0.02).outline.set_visible(False)


def _along(phase: Any) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times, and states and controls by name there."""
    times = np.linspace(phase.t0, phase.tf, SAMPLES)
    return times, phase.at(times)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")
