"""The re-entry within wide limits, around three no-fly zones; see `statement`.

Every feasible flight passes south of all three, as far as gradients can tell: for one that passes north of the first, this zone would have
to lie 6.3 degrees farther south; of the second, south of the first, 1.5 degrees; of the third, south of both others, 8.0 degrees.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...problem import Problem
from . import figures, front
from .case1 import LIMITS
from .statement import Zone, reentry

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ZONES = (Zone(30.0, 7.5, 5.0), Zone(60.0, 15.0, 5.0), Zone(70.0, 20.0, 5.0))
REFERENCE = front.REFERENCE


def problem(**data: Any) -> Problem:
    """The case; for `data` see `statement.reentry`."""
    return reentry("reentry_case3", LIMITS, ZONES, **data)


def reference() -> np.ndarray:
    """The true front as far as gradients found it; see `front.known`."""
    return front.known("case3")


def plot(flights: Sequence[Any]) -> dict[str, Figure]:
    """Pictures of one flight or many, which may be a Front; see `figures`."""
    return figures.plot(flights, ZONES)


def track(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Coordinates of a ground track by label."""
    return figures.track(values)
