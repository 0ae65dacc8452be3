"""Pareto dominance of minimised objectives, their ranges, and comparisons up to rounding in these units: pure functions of arrays."""

from __future__ import annotations

from collections.abc import Sequence

import moocore
import numpy as np

from problems.compiled import Objective

from ..evaluation.evaluator import CONVERGED, Evaluation

CURVE = 2
"""Number of objectives up to which a front is a curve; with more it is a surface, and points far from it can be non-dominated for ever, see
`alpha_nondominated`."""


def nondominated(F: np.ndarray) -> np.ndarray:
    """Mask (n,) of the non-dominated rows of F (n, m). Of equal rows only the first is kept; a row with NaN never is."""
    keep = np.isfinite(F).all(axis=1)
    if keep.any():
        keep[keep] = moocore.is_nondominated(np.ascontiguousarray(F[keep]))
    return keep


def among(F: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Mask (n,) of the rows of F (n, m) that occur in `known` (k, m)."""
    return (F[:, None] == known).all(axis=2).any(axis=1)


def dominates(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Mask (...,): whether A (..., m) is no worse than B (..., m) in any objective and better in one; leading axes broadcast."""
    return np.all(A <= B, axis=-1) & np.any(A < B, axis=-1)


def alpha_nondominated(F: np.ndarray) -> np.ndarray:
    """Mask (n,) of the alpha-non-dominated rows of F (n, m), not far worse than another for a small gain in one objective, and of each
    objective's best.

    Each objective is charged a hundredth of the others, in ranges; points that are then dominated are left out (Ikeda, Kita and
    Kobayashi 2001). With more than two objectives such points are often far from the front, and others rarely dominate them.
    """
    span = np.ptp(F, axis=0)
    N = np.where(span > 0.0, F / np.where(span > 0.0, span, 1.0), 0.0)
    keep = nondominated((1.0 - 0.01) * N + 0.01 * N.sum(axis=1, keepdims=True))
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


SAME = 1e-7
"""Objectives that differ by less than this part of their ranges are equal."""
BETTER = 1e-6
"""An objective that is lower by this part of its range is clearly better."""
APART = 0.01
"""Least distance of the points of a front, in the distance of so many that are evenly spread over the range of an objective."""
CONSTANT = 1e-6
"""An objective that varies less, as a fraction of its size, is judged by its size."""


def feasible_and_no_worse(found: Evaluation, F: np.ndarray, violation: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Mask (k,) of the results that are feasible optima and no worse in any objective than points with F (k, m) and violation (k,)."""
    with np.errstate(invalid="ignore"):
        return (found.status == CONVERGED) & (F + slack(violation)[:, None] * ranges >= found.F).all(axis=1)


def slack(violation: np.ndarray) -> np.ndarray:
    """Fractions (k,) of the ranges by which an optimum may be worse than points with this violation (k,) and still count as no worse."""
    return SAME + 10.0 * violation


def ranges(F: np.ndarray) -> np.ndarray:
    """Range (m,) of each objective over points F (k, m), for spread and comparisons up to rounding; if that is zero, the size of the
    objective, at least 1. What an objective may be off is judged by `objective_units`."""
    span = np.ptp(F, axis=0)
    return np.where(span > 0.0, span, np.maximum(np.abs(F).max(axis=0), 1.0))


def stated_scales(goals: Sequence[Objective]) -> np.ndarray:
    """The scales (m,) that objectives state, 0 for none."""
    return np.array([goal.scale or 0.0 for goal in goals])


def objective_units(several: Sequence[np.ndarray], stated: np.ndarray, least: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """What counts as one in each objective (m,): the stated scale, 0 for none; else its range over the first of several sets of points
    F (k, m) over which it varies; else its size at the points of the last set or, if larger, those of its terms together, `sizes` (m,).
    At least `least` (m,), unless stated; 1 where all of these are 0."""
    found = np.maximum(np.abs(several[-1]).max(axis=0), sizes)
    for F in reversed(several):
        found = np.where(varies(F), np.ptp(F, axis=0), found)
    found = np.maximum(found, least)
    return np.where(stated > 0.0, stated, np.where(found > 0.0, found, 1.0))


def varies(F: np.ndarray) -> np.ndarray:
    """Mask (m,) of the objectives that vary over points F (k, m) by more than a small part of their size."""
    return np.ptp(F, axis=0) > CONSTANT * np.abs(F).max(axis=0)


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


def separate(F: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Mask (n,) of points F (n, m) of which each differs from every other in some objective by more than `APART`, the best of each
    objective before others. ranges (m,)."""
    kept, least = list[int](), APART / max(len(F), 1)
    for i in dict.fromkeys([*extremes(F).tolist(), *range(len(F))] if len(F) else []):
        if all((np.abs(F[i] - F[j]) > least * ranges).any() for j in kept):
            kept.append(i)
    return np.isin(np.arange(len(F)), kept)
