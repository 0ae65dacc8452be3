"""Pareto dominance, of minimised objectives: pure functions of rows of numbers."""

from __future__ import annotations

import moocore
import numpy as np


def nondominated(F: np.ndarray) -> np.ndarray:
    """Which rows of F (n, m) no other row dominates, (n,) of bool. Of equal rows only the first is kept; a row with NaN never is."""
    keep = np.isfinite(F).all(axis=1)
    if keep.any():
        keep[keep] = moocore.is_nondominated(np.ascontiguousarray(F[keep]))
    return keep


def dominates(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Row by row (broadcast over leading axes): A (..., m) is nowhere worse than B (..., m), and somewhere better."""
    return np.all(A <= B, axis=-1) & np.any(A < B, axis=-1)


def constrained_dominates(
    F: np.ndarray, violation: np.ndarray, others: np.ndarray, other_violation: np.ndarray, tolerance: float = 0.0
) -> np.ndarray:
    """Row by row, dominance with feasibility first (Deb 2000): no penalty mixes what is not comparable.

    Parameters
    ----------
    F, others : arrays (..., m)
        Objectives; what they hold where a point is infeasible does not matter.
    violation, other_violation : arrays (...,)
        Infinite where the evaluation failed.
    tolerance : float
        A violation of at most this is feasible.

    Returns
    -------
    array (...,) of bool
        A feasible point dominates any infeasible one; of two infeasible ones the less violated dominates; two feasible ones are compared
        by their objectives.
    """
    feasible, other_feasible = violation <= tolerance, other_violation <= tolerance
    by_violation = ~other_feasible & (feasible | (violation < other_violation))
    return np.where(feasible & other_feasible, dominates(F, others), by_violation)


def extremes(F: np.ndarray) -> np.ndarray:
    """Row of the best point of each objective, (m,) of int: the lowest value, ties broken by the other objectives in their order."""
    m = F.shape[1]
    order = [[k, *(j for j in range(m) if j != k)] for k in range(m)]
    return np.array([np.lexsort(F[:, columns[::-1]].T)[0] for columns in order], dtype=int)
