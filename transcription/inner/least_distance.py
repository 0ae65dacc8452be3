"""The nearest point of a box that satisfies linear constraints, for many boxes at once."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

MOST_MISSED = 1e-6
"""Largest miss of constraints."""

Box = tuple[np.ndarray, np.ndarray]


def least_distance(
    center: np.ndarray,
    A: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    box: Box,
    multipliers: np.ndarray,
    exact: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Minimise |x - center|^2 subject to lower <= A x <= upper and box[0] <= x <= box[1].

    Newton's method on the dual, whose solution has x = center - A' multipliers, clipped to the box: which variables are clipped and which
    constraints are active follows from the multipliers, and with them the next ones (a primal-dual active set method, Hintermueller, Ito
    and Kunisch 2003). It ends when the constraints hold, and with them all conditions of a nearest point. Where it does not end,
    non-negative least squares decide (Lawson and Hanson, "Solving least squares problems", 1974, chapter 23). center (k, d), A (k, r, d),
    lower, upper (k, r), box (k, d), multipliers (k, r), exact (k,) -> (k, d), (k,), (k, r).
    """
    x, met, multipliers = _newton(center, A, lower, upper, box, multipliers)
    finite = np.isfinite(A).all(axis=(1, 2))
    if not finite.all():
        # Derivatives overflow where states are about to. Without them a step leads back to the center.
        x[~finite], met[~finite], multipliers[~finite] = np.clip(center, *box)[~finite], False, 0.0
    multipliers[~met] = 0.0
    exact = np.ones(len(x), dtype=int) if exact is None else exact
    for i in np.flatnonzero(~met & finite & (exact > 0)):
        exact[i] -= 1
        nearest = _exact(center[i], A[i], lower[i], upper[i], (box[0][i], box[1][i]))
        if nearest is not None:
            x[i], multipliers[i] = nearest
            values = A[i] @ x[i]
            met[i] = np.maximum(lower[i] - values, values - upper[i]).max() <= MOST_MISSED
    return x, met, multipliers


def _newton(
    center: np.ndarray, A: np.ndarray, lower: np.ndarray, upper: np.ndarray, box: Box, multipliers: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (k, d), whether (k,) they are the nearest ones, and multipliers (k, r)."""
    (low, high), (k, r, _), transposed = box, A.shape, A.transpose(0, 2, 1)
    size = np.einsum("krd,krd->kr", A, A) + 1e-300
    # A row is to be met exactly, in its size. One of which no more than a millionth is left, where variables are clipped, cannot be moved.
    exact, floor = 1e-10 * np.sqrt(size), 1e-6 * size
    equation = lower == upper
    only_equations = bool(equation.all())
    for iteration in range(8):
        shifted = center - (transposed @ multipliers[:, :, None])[:, :, 0]
        x = np.minimum(np.maximum(shifted, low), high)
        values = (A @ x[:, :, None])[:, :, 0]
        # Nothing where an active constraint holds exactly, and where another one holds and has no multiplier.
        pushed = values if only_equations else values + size * multipliers
        miss = values - (lower if only_equations else np.clip(pushed, lower, upper))
        met = np.abs(miss) <= exact
        if iteration == 7 or met.all():
            break
        gram = (A * (x == shifted)[:, None, :]) @ transposed  # over the variables that are not clipped
        diagonal = gram.reshape(k, r * r)[:, :: r + 1]
        # A row all of whose variables are clipped is moved as if none were; rows may be linearly dependent.
        diagonal[...] = np.where(diagonal > floor, diagonal * (1.0 + 1e-12), size)
        if not only_equations:
            active = equation | (pushed > upper) | (pushed < lower)
            gram, miss = np.where(active[:, :, None], gram, np.eye(r)), np.where(active, miss, -multipliers)
        multipliers = multipliers + np.linalg.solve(gram, miss[:, :, None])[:, :, 0]
    return x, met.all(axis=1), multipliers


def _exact(center: np.ndarray, A: np.ndarray, lower: np.ndarray, upper: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray] | None:
    """The nearest point (d,) of one box, and the multipliers (r,); None where there is none."""
    every, r = np.eye(len(center)), len(A)
    sides = np.vstack([A, -A, every, -every])
    limits = np.concatenate([lower, -upper, box[0], -box[1]])
    bounded = np.isfinite(limits)
    G, h = sides[bounded], limits[bounded] - sides[bounded] @ center
    target = np.zeros(len(center) + 1)
    target[-1] = 1.0
    u = np.zeros(len(sides))
    try:
        u[bounded] = nnls(np.vstack([G.T, h]), target)[0]
    except RuntimeError:  # its iterations ran out
        return None
    left = 1.0 - h @ u[bounded]
    if abs(left) < MOST_MISSED:
        return None
    return np.clip(center + sides.T @ u / left, *box), (u[r : 2 * r] - u[:r]) / left
