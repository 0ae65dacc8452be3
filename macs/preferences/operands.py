"""Functions that apply to numbers, to arrays and to symbols of CasADi, each by its own means."""

from __future__ import annotations

from typing import Any

import numpy as np

NUMERIC = (int, float, np.number, np.ndarray)


def exp(x: Any) -> Any:
    """e to the power x."""
    return np.exp(x) if isinstance(x, NUMERIC) else x.exp()


def log10(x: Any) -> Any:
    """Logarithm of x to base 10."""
    return np.log10(x) if isinstance(x, NUMERIC) else x.log10()


def greatest(x: Any, bound: float) -> Any:
    """The larger of x and a number."""
    return np.fmax(x, bound) if isinstance(x, NUMERIC) else x.fmax(bound)


def least(x: Any, bound: float) -> Any:
    """The smaller of x and a number."""
    return np.fmin(x, bound) if isinstance(x, NUMERIC) else x.fmin(bound)


def clipped(x: Any, lower: float, upper: float) -> Any:
    """x, but at least `lower` and at most `upper`."""
    return least(greatest(x, lower), upper)
