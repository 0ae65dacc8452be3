"""Pareto dominance of minimised objectives: pure functions of arrays."""

from __future__ import annotations

import moocore
import numpy as np

CURVE = 2
"""Number of objectives up to which a front is a curve; with more it is a surface, and points far from it can be non-dominated for ever, see
`worthwhile`."""


CHARGE = 0.01
"""Part of the other objectives, in ranges, that is added to each by `worthwhile`."""


def nondominated(F: np.ndarray) -> np.ndarray:
    """Mask (n,) of the non-dominated rows of F (n, m). Of equal rows only the first is kept; a row with NaN never is."""
    keep = np.isfinite(F).all(axis=1)
    if keep.any():
        keep[keep] = moocore.is_nondominated(np.ascontiguousarray(F[keep]))
    return keep


def among(F: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Mask (n,) of the rows of F (n, m) that are rows of `known` (k, m)."""
    return (F[:, None] == known).all(axis=2).any(axis=1)


def dominates(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Mask (...,): whether A (..., m) is no worse than B (..., m) in any objective and better in one; leading axes broadcast."""
    return np.all(A <= B, axis=-1) & np.any(A < B, axis=-1)


def worthwhile(F: np.ndarray) -> np.ndarray:
    """Mask (n,) of the non-dominated rows of F (n, m) that are not far worse than another for a little of one objective, and of the best of
    each objective.

    Each objective is charged the part `CHARGE` of the others, in ranges; points that are then dominated are left out (Ikeda, Kita and
    Kobayashi 2001). With more than two objectives such points are often far from the front, and others rarely dominate them.
    """
    span = np.ptp(F, axis=0)
    N = np.where(span > 0.0, F / np.where(span > 0.0, span, 1.0), 0.0)
    keep = nondominated((1.0 - CHARGE) * N + CHARGE * N.sum(axis=1, keepdims=True))
    keep[extremes(F)] = True
    return keep


def constrained_dominates(
    F: np.ndarray, violation: np.ndarray, others: np.ndarray, other_violation: np.ndarray, tolerance: float = 0.0
) -> np.ndarray:
    """Mask (...,): whether F dominates `others`, feasibility first (Deb 2000).

    A feasible point dominates any infeasible one. Of two infeasible points the one with less violation dominates. Two feasible points are
    compared by their objectives. F, others (..., m), violation, other_violation (...,).
    """
    feasible, other_feasible = violation <= tolerance, other_violation <= tolerance
    by_violation = ~other_feasible & (feasible | (violation < other_violation))
    return np.where(feasible & other_feasible, dominates(F, others), by_violation)


def extremes(F: np.ndarray) -> np.ndarray:
    """Rows (m,) of the best point of each objective: the lowest value; ties are broken by the other objectives in their order."""
    m = F.shape[1]
    order = [[k, *(j for j in range(m) if j != k)] for k in range(m)]
    return np.array([np.lexsort(F[:, columns[::-1]].T)[0] for columns in order], dtype=int)
