"""Final states of a run's points after independent simulation, as plain data for its record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypedDict

import numpy as np

from macs.front import Front
from macs.fronts.verified import accuracy


class SimulationRecord(TypedDict, total=False):
    """The "ends" of the simulated trajectories of a front's n points: {phase: {state: final values (n,)}}. Empty if they were not
    simulated."""

    ends: dict[str, dict[str, list[float]]]


Ends = Mapping[str, Mapping[str, np.ndarray]]
"""{phase: {state: its final values (n,)}}."""


def record(front: Front, tolerance: float) -> SimulationRecord:
    """The final states of a front's points when they are simulated as finely as to verify them within a tolerance."""
    rtol, atol = accuracy(tolerance)
    final = ends(front.simulate(rtol=rtol, atol=atol))
    return {"ends": {phase: {name: values.tolist() for name, values in states.items()} for phase, states in final.items()}}


def ends(front: Front) -> Ends:
    """The final states of each phase of a front's n trajectories; empty where a point has none."""
    trajectories = [point.trajectory for point in front if point.trajectory is not None]
    if not trajectories or len(trajectories) < len(front):
        return {}
    return {
        name: {
            v.name: np.array([trajectory[name].edge_states[-1, k] for trajectory in trajectories])
            for k, v in enumerate(phase.state_variables)
        }
        for name, phase in trajectories[0].items()
    }
