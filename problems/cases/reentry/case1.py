"""The re-entry within wide limits; see `statement`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...problem import Problem
from . import figures, front
from .statement import Limits, reentry

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LIMITS = Limits(heating_rate=200.0, dynamic_pressure=280.0, load_factor=2.5)
REFERENCE = front.REFERENCE


def problem(**data: Any) -> Problem:
    """The case; for `data` see `statement.reentry`."""
    return reentry("reentry_case1", LIMITS, **data)


def reference() -> np.ndarray:
    """The true front as far as gradients found it; see `front.known`."""
    return front.known("case1")


def plot(flights: Sequence[Any]) -> dict[str, Figure]:
    """Pictures of one flight or many, which may be a Front; see `figures`."""
    return figures.plot(flights)


def track(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Coordinates of a ground track by label."""
    return figures.track(values)
