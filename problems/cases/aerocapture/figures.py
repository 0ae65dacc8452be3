"""Figures of flights through the air: states and bank over time, as figures 14 to 17 of the paper, and the ground track."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..flight_figures import Population, track, trajectories
from ..winged import STATES
from .mars import circularisation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot", "track"]

ALONG = (*STATES, "bank angle", "bank rate", "heat load")
UNITS = {"altitude": ("km", 1e-3), "speed": ("km/s", 1e-3), "heat load": ("kJ/cm2", 1.0), "bank rate": ("deg/s", float(np.degrees(1.0)))}


def plot(flights: Sequence[Any]) -> dict[str, Figure]:
    """Both figures by name, the flights coloured by their delta v.

    Parameters
    ----------
    flights : Front, Points, Simulations
        Whatever has a `trajectory`. Of Simulations, the simulated trajectory is drawn; of Points, that of the transcription.
    """
    phases = [list(trajectory.values()) for trajectory in trajectories(flights)]
    speeds = np.array([float(flight[-1].at(flight[-1].tf)["speed"]) for flight in phases])
    flown = Population(phases, circularisation(speeds), "delta v [m/s]")
    return {"population": flown.over_time(ALONG, UNITS), "ground-track": flown.on_the_map()[0]}
