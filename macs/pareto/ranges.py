"""What counts as one in each objective, and which points are no worse within rounding."""

from __future__ import annotations

import numpy as np

from ..evaluation.evaluator import CONVERGED, Evaluation
from .dominance import nondominated

CURVE = 2
"""With so many objectives the front is a curve, with more it is a surface."""


SAME = 1e-7
"""Objectives that differ by less than this part of their ranges are equal."""
BETTER = 1e-6
"""An objective that is lower by this part of its range is clearly better."""
OPTIMISM = 10.0
"""A point that is feasible only within the tolerance may have too low objectives, by so many times its violation."""


def feasible_and_no_worse(found: Evaluation, F: np.ndarray, violation: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Which results (k,) are feasible optima, and in no objective worse than points with F (k, m) and a violation (k,)."""
    with np.errstate(invalid="ignore"):
        return (found.status == CONVERGED) & (F + slack(violation)[:, None] * ranges >= found.F).all(axis=1)


def slack(violation: np.ndarray) -> np.ndarray:
    """By what part of the ranges an optimum may be worse than points with a violation (k,), and still be as good."""
    return SAME + OPTIMISM * violation


def ranges(F: np.ndarray) -> np.ndarray:
    """What counts as much in each objective (m,): the range of points F (k, m); where that is nothing, the objective's size."""
    span = np.ptp(F, axis=0)
    return np.where(span > 0.0, span, np.maximum(np.abs(F).max(axis=0), 1.0))


def nearest(point: np.ndarray, F: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Rows of F (n, m), the nearest to a point first."""
    zero = np.zeros(len(ranges))
    return np.argsort(np.linalg.norm(normalised(F - point, zero, ranges), axis=1), kind="stable")


def normalised(F: np.ndarray, ideal: np.ndarray, nadir: np.ndarray) -> np.ndarray:
    """F (..., m) with the ideal point at 0 and the nadir at 1; an objective whose range is zero is only shifted."""
    span = nadir - ideal
    return (F - ideal) / np.where(span > 0.0, span, 1.0)


def distinct(F: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Which rows of F (n, m) no other row dominates, (n,) of bool, objectives rounded to `SAME` of their ranges (m,): of two points that
    differ less, only the first is kept."""
    return nondominated(np.round((F - F.min(axis=0)) / ranges / SAME))
