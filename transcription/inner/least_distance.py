"""The nearest point of a box that satisfies linear constraints, for many boxes at once."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

ITERATIONS = 8
REGULAR = 1e-12
"""Part of the largest diagonal entry that is added to it: rows may say the same thing twice."""
STUCK = 1e-6
"""A row of whose size no more than this is left, where variables are clipped, could not be moved."""
MET = 1e-6

Box = tuple[np.ndarray, np.ndarray]


def least_distance(center: np.ndarray, A: np.ndarray, lower: np.ndarray, upper: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Minimise |x - center|^2 subject to lower <= A x <= upper and box[0] <= x <= box[1].

    Newton's method on the dual, whose solution has x = center - A' multipliers, clipped to the box: which variables are clipped and
    which constraints are active follows from the multipliers, and with them the next ones (a primal-dual active set method, Hintermueller,
    Ito and Kunisch 2003). It ends when the sets repeat. Where they do not, which is rare, non-negative least squares decide (Lawson and
    Hanson, "Solving least squares problems", 1974, chapter 23).

    Parameters
    ----------
    center : array (k, d)
    A : array (k, r, d)
    lower, upper : arrays (k, r)
        Infinite where there is no limit, equal for equations.
    box : pair of arrays (k, d)

    Returns
    -------
    array (k, d)
    array (k,) of bool
        Whether the constraints are met. Where they contradict each other, the point is none in particular.
    """
    x, sure = _active_sets(center, A, lower, upper, box)
    for i in np.flatnonzero(~sure):
        exact = _exact(center[i], A[i], lower[i], upper[i], (box[0][i], box[1][i]))
        if exact is not None:
            x[i] = exact
    values = _times(A, x)
    missed = np.maximum(np.maximum(lower - values, values - upper), 0.0).max(axis=1)
    return x, missed <= MET


def _active_sets(center: np.ndarray, A: np.ndarray, lower: np.ndarray, upper: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, d), and where (k,) the sets repeated, so that these are the nearest ones."""
    k, r, _ = A.shape
    low, high = box
    equation = lower == upper
    only_equations = bool(equation.all())
    transposed, size = A.transpose(0, 2, 1), np.einsum("krd,krd->kr", A, A) + 1e-300
    multipliers, shifted, x = np.zeros((k, r)), center, np.clip(center, low, high)
    values = _times(A, x)
    side, above, active = np.zeros(x.shape, dtype=int), equation, np.ones((k, r), dtype=bool)
    sure = np.zeros(k, dtype=bool)
    for iteration in range(ITERATIONS):
        before = side, above, active
        side = (shifted >= high).astype(int) - (shifted <= low)
        inside = side == 0
        if not only_equations:
            above = equation | (multipliers * size + values > upper)
            active = above | (multipliers * size + values < lower)
        if iteration:
            sure = (side == before[0]).all(axis=1) & (above == before[1]).all(axis=1) & (active == before[2]).all(axis=1)
            if sure.all():
                break
        # A row all of whose variables are clipped could not be moved at all.
        stuck = (np.einsum("krd,krd,kd->kr", A, A, inside) < STUCK * size) & active
        freed = stuck.any(axis=1, keepdims=True) & ~inside
        inside, side = inside | freed, np.where(freed, 2, side)
        # Where a variable is clipped, x stays at its bound; elsewhere x = center - A' multipliers.
        B = A * inside[:, None, :]
        right = _times(A, np.where(inside, center, x)) - np.where(above, upper, lower)
        if not only_equations:
            B, right = B * active[:, :, None], np.where(active, right, 0.0)
        gram = B @ transposed if only_equations else B @ B.transpose(0, 2, 1)
        diagonal = np.einsum("kii->ki", gram)
        diagonal += np.where(active, REGULAR * diagonal.max(axis=1, keepdims=True) + 1e-300, 1.0)
        multipliers = np.linalg.solve(gram, right[:, :, None])[:, :, 0]
        shifted = center - _times(transposed, multipliers)
        x = np.clip(shifted, low, high)
        values = _times(A, x)
    return x, sure


def _exact(center: np.ndarray, A: np.ndarray, lower: np.ndarray, upper: np.ndarray, box: Box) -> np.ndarray | None:
    """The nearest point (d,) of one box; None where there is none."""
    every = np.eye(len(center))
    sides = np.vstack([A, -A, every, -every])
    limits = np.concatenate([lower, -upper, box[0], -box[1]])
    bounded = np.isfinite(limits)
    G, h = sides[bounded], limits[bounded] - sides[bounded] @ center
    target = np.zeros(len(center) + 1)
    target[-1] = 1.0
    try:
        u = nnls(np.vstack([G.T, h]), target)[0]
    except RuntimeError:  # its iterations ran out
        return None
    residual = np.append(G.T @ u, h @ u) - target
    if abs(residual[-1]) < MET:
        return None
    return np.clip(center - residual[:-1] / residual[-1], *box)


def _times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    return (A @ x[:, :, None])[:, :, 0]
