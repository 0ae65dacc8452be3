"""Figures of re-entries: states and angles, what the air does, and the ground track, for one flight or a whole population."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from typing import TYPE_CHECKING, Any

import numpy as np

from ..flight_figures import RED, Population, track, trajectories
from ..winged import STATES
from .statement import ANGLES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .statement import Zone

__all__ = ["plot", "track"]

PHASE = "entry"
ALONG = (*STATES, *ANGLES, *(f"{angle} command" for angle in ANGLES))
UNITS = {
    "altitude": ("km", 1e-3),
    "speed": ("km/s", 1e-3),
    "heating rate": ("Btu/ft2/s", 1.0),
    "dynamic pressure": ("lbf/ft2", 1.0),
    "load factor": ("g", 1.0),
}


def plot(flights: Sequence[Any], zones: Sequence[Zone] = ()) -> dict[str, Figure]:
    """Both figures by name, the flights coloured by their cross-range.

    Parameters
    ----------
    flights : Front, Points, Simulations
        Whatever has a `trajectory`. Of Simulations, the simulated trajectory is drawn; of Points, that of the transcription.
    zones : sequence of Zone
        No-fly zones, on the map.
    """
    phases = [[trajectory[PHASE]] for trajectory in trajectories(flights)]
    flown = Population(phases, np.array([degrees(flight[0]["latitude"][-1]) for flight in phases]), "cross-range [deg]")
    figure, ax = flown.on_the_map()
    around = np.linspace(0.0, 2 * np.pi, 181)
    for zone in zones:
        east, north = zone.longitude + zone.radius * np.cos(around), zone.latitude + zone.radius * np.sin(around)
        ax.fill(east, north, facecolor="#f3c9b3", edgecolor=RED, lw=0.9, zorder=1)
    return {"population": flown.over_time(ALONG, UNITS), "ground-track": figure}
