"""Figures of skip entries: states, controls with their commands, what the air does, and the ground track, for one flight or many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..flight_figures import Population, track, trajectories
from ..winged import STATES
from .statement import COMMANDED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot", "track"]

ALONG = (*STATES, "mass", *COMMANDED)
UNITS = {
    "altitude": ("km", 1e-3),
    "speed": ("km/s", 1e-3),
    "mass": ("t", 1e-3),
    "thrust": ("MN", 1e-6),
    "heating rate": ("Btu/ft2/s", 1.0),
    "dynamic pressure": ("kPa", 1e-3),
    "load factor": ("g", 1.0),
}


def plot(flights: Sequence[Any]) -> dict[str, Figure]:
    """Both figures by name, the flights coloured by their flight time.

    Parameters
    ----------
    flights : Front, Points, Simulations
        Whatever has a `trajectory`. Of Simulations, the simulated trajectory is drawn; of Points, that of the transcription.
    """
    phases = [list(trajectory.values()) for trajectory in trajectories(flights)]
    flown = Population(phases, np.array([flight[-1].tf for flight in phases]), "flight time [s]")
    return {"population": flown.over_time(ALONG, UNITS), "ground-track": flown.on_the_map()[0]}
