"""The nearest point of a box that satisfies linear constraints, for many boxes at once."""

from __future__ import annotations

import numpy as np

ITERATIONS = 12
MET = 1e-6
REGULAR = 1e-12
"""Part of the largest diagonal entry that is added to it: rows may say the same thing twice."""


def least_distance(
    center: np.ndarray, A: np.ndarray, lower: np.ndarray, upper: np.ndarray, box: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Minimise |x - center|^2 subject to lower <= A x <= upper and box[0] <= x <= box[1].

    Newton's method on the dual, whose solution has x = center - A' multipliers, clipped to the box: which variables are clipped and
    which constraints are active follows from the multipliers, and with them the next ones (a primal-dual active set method, Hintermueller,
    Ito and Kunisch 2003). It ends when the sets repeat, or after a few iterations: then the constraints may contradict each other.

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
        Whether the constraints are met.
    """
    k, r, _ = A.shape
    multipliers, size = np.zeros((k, r)), np.einsum("krd,krd->kr", A, A) + 1e-300
    equation = lower == upper
    x = np.clip(center, *box)
    sets = None
    for _ in range(ITERATIONS):
        shifted = center - (multipliers[:, None, :] @ A)[:, 0]
        inside = (shifted > box[0]) & (shifted < box[1])
        values = (A @ x[:, :, None])[:, :, 0]
        above = equation | (multipliers * size + values > upper)
        active = above | (multipliers * size + values < lower)
        if sets is not None and np.array_equal(inside, sets[0]) and np.array_equal(active, sets[1]):
            break
        sets = inside, active
        # Where a variable is clipped, x stays at its bound; elsewhere x = center - A' multipliers.
        fixed = (A @ np.where(inside, center, x)[:, :, None])[:, :, 0]
        B = A * inside[:, None, :] * active[:, :, None]
        gram = B @ B.transpose(0, 2, 1)
        diagonal = np.einsum("kii->ki", gram)
        diagonal += np.where(active, REGULAR * diagonal.max(axis=1, keepdims=True) + 1e-300, 1.0)
        right = np.where(active, fixed - np.where(above, upper, lower), 0.0)
        multipliers = np.linalg.solve(gram, right[:, :, None])[:, :, 0]
        x = np.clip(center - (multipliers[:, None, :] @ A)[:, 0], *box)
    values = (A @ x[:, :, None])[:, :, 0]
    missed = np.maximum(np.maximum(lower - values, values - upper), 0.0).max(axis=1)
    return x, missed <= MET
