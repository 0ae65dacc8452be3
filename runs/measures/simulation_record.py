"""Objectives, violations and final states of a run's points after independent simulation, as plain data for its record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypedDict

import numpy as np

from macs.front import Front


class SimulationRecord(TypedDict, total=False):
    """Objectives "F" (n, m), all minimised, and "violation" (n,) of a front's points as simulated, and "ends" of their trajectories:
    {phase: {state: final values (n,)}}. Empty if they were not simulated."""

    F: list[list[float]]
    violation: list[float]
    ends: dict[str, dict[str, list[float]]]


Ends = Mapping[str, Mapping[str, np.ndarray]]
"""{phase: {state: its final values (n,)}}."""


def record(front: Front, tolerance: float) -> SimulationRecord:
    """The points of a front as simulated; see `Front.simulate`."""
    simulated = front.simulate(tolerance=tolerance)
    final = {phase: {name: values.tolist() for name, values in states.items()} for phase, states in ends(simulated).items()}
    return {"F": simulated.F.tolist(), "violation": simulated.violation.tolist(), "ends": final}


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
