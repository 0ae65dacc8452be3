"""Ranges of objectives, by which they are normalised, and comparisons up to rounding in units of these."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from problems.compiled import Objective

from ..evaluation.evaluator import CONVERGED, Evaluation
from .dominance import nondominated

SAME = 1e-7
"""Objectives that differ by less than this part of their ranges are equal."""
BETTER = 1e-6
"""An objective that is lower by this part of its range is clearly better."""
CONSTANT = 1e-6
"""An objective that varies less, as a fraction of its size, is judged by its size."""
OPTIMISM = 10.0
"""A point that is feasible only within the tolerance may have objectives that are too low by so many times its violation."""


def feasible_and_no_worse(found: Evaluation, F: np.ndarray, violation: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Mask (k,) of the results that are feasible optima and in no objective worse than points with F (k, m) and violation (k,)."""
    with np.errstate(invalid="ignore"):
        return (found.status == CONVERGED) & (F + slack(violation)[:, None] * ranges >= found.F).all(axis=1)


def slack(violation: np.ndarray) -> np.ndarray:
    """Fractions (k,) of the ranges by which an optimum may be worse than points with this violation (k,) and still count as no worse."""
    return SAME + OPTIMISM * violation


def ranges(F: np.ndarray) -> np.ndarray:
    """Range (m,) of each objective over points F (k, m); if that is zero, the size of the objective, at least 1."""
    span = np.ptp(F, axis=0)
    return np.where(span > 0.0, span, np.maximum(np.abs(F).max(axis=0), 1.0))


def stated_scales(goals: Sequence[Objective]) -> np.ndarray:
    """The scales (m,) that objectives state, 0 for none."""
    return np.array([goal.scale or 0.0 for goal in goals])


def objective_units(F: np.ndarray, stated: np.ndarray, least: np.ndarray) -> np.ndarray:
    """What counts as one in each objective (m,): the scale that was stated, 0 for none; else its range over points F (k, m), or its size if
    it hardly varies, and at least `least` (m,); 1 where all that is 0."""
    span, size = np.ptp(F, axis=0), np.abs(F).max(axis=0)
    found = np.maximum(np.where(span > CONSTANT * size, span, size), least)
    return np.where(stated > 0.0, stated, np.where(found > 0.0, found, 1.0))


def nearest(point: np.ndarray, F: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Rows of F (n, m), sorted by their distance from a point (m,) in units of the ranges."""
    zero = np.zeros(len(ranges))
    return np.argsort(np.linalg.norm(normalised(F - point, zero, ranges), axis=1), kind="stable")


def normalised(F: np.ndarray, ideal: np.ndarray, nadir: np.ndarray) -> np.ndarray:
    """F (..., m) scaled so that the ideal point is at 0 and the nadir at 1; an objective with zero range is only shifted."""
    span = nadir - ideal
    return (F - ideal) / np.where(span > 0.0, span, 1.0)


def distinct(F: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Mask (n,) of the non-dominated rows of F (n, m), with objectives rounded to `SAME` of their ranges (m,): of two points that differ
    less, only the first is kept."""
    return nondominated(np.round((F - F.min(axis=0)) / ranges / SAME))
