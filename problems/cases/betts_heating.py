"""The re-entry of `betts` with a limit to the heating rate."""

from __future__ import annotations

import numpy as np

from ..problem import Problem
from .betts import betts

HEATING_RATE = 70.0
"""The most, Btu/ft2/s."""
CROSS_RANGE, FINAL_TIME = 30.6255, 2198.67
"""Of the optimum, in degrees and seconds."""


def problem() -> Problem:
    """The case."""
    return betts("betts_heating", HEATING_RATE)


def reference() -> np.ndarray:
    """The optimal cross-range in degrees, shape (1, 1)."""
    return np.array([[CROSS_RANGE]])
