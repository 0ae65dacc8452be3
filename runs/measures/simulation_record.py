"""What the points of a run turn out to be in the air, as plain data for its record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from macs.front import Front

Ends = Mapping[str, Mapping[str, np.ndarray]]
"""Phase -> state -> its values (n,) at the end."""


def record(front: Front, tolerance: float) -> dict[str, Any]:
    """ "F" (n, m), all minimised, and "violation" (n,) of the points as flown, and "ends" of their flights; see `Front.simulate`."""
    flights = front.simulate(tolerance=tolerance)
    found = {phase: {name: values.tolist() for name, values in states.items()} for phase, states in ends(flights).items()}
    return {"F": flights.F.tolist(), "violation": flights.violation.tolist(), "ends": found}


def ends(front: Front) -> Ends:
    """The states at the end of each phase of a front's n trajectories; nothing where there are none."""
    flights = [point.trajectory for point in front if point.trajectory is not None]
    if not flights or len(flights) < len(front):
        return {}
    return {
        name: {v.name: np.array([flight[name].edge_states[-1, k] for flight in flights]) for k, v in enumerate(phase.state_variables)}
        for name, phase in flights[0].items()
    }
