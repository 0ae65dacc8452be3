"""What counts as one in each objective, and which points are no worse within rounding."""

from __future__ import annotations

import numpy as np

from ..evaluation.evaluator import CONVERGED, Evaluation
from .directions import normalised

CURVE = 2
"""With so many objectives the front is a curve, and with more a surface."""


SAME, PROMISE = 1e-7, 10.0
"""Objectives that differ by less than this part of their ranges are equal; so many times its violation more may be what a point, feasible
within the tolerance only, promises too much."""


def keeps_promise(found: Evaluation, F: np.ndarray, violation: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Which results (k,) are feasible optima that are nowhere worse than what points with F (k, m) and a violation (k,) promised."""
    with np.errstate(invalid="ignore"):
        return (found.status == CONVERGED) & (F + slack(violation)[:, None] * ranges >= found.F).all(axis=1)


def slack(violation: np.ndarray) -> np.ndarray:
    """By what part of the ranges an optimum may be worse than points with a violation (k,), and still be as good."""
    return SAME + PROMISE * violation


def ranges(F: np.ndarray) -> np.ndarray:
    """What counts as much in each objective (m,): the range of points F (k, m); where that is nothing, the objective's size."""
    span = np.ptp(F, axis=0)
    return np.where(span > 0.0, span, np.maximum(np.abs(F).max(axis=0), 1.0))


def nearest(point: np.ndarray, F: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Rows of F (n, m), the nearest to a point first."""
    zero = np.zeros(len(ranges))
    return np.argsort(np.linalg.norm(normalised(F - point, zero, ranges), axis=1), kind="stable")
