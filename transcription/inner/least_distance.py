"""The nearest point of a box that satisfies linear constraints, for many boxes at once."""

from __future__ import annotations

import numpy as np

ITERATIONS = 12
STUCK = 1e-6
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
    low, high = box
    equation = lower == upper
    only_equations = bool(equation.all())
    transposed, size = A.transpose(0, 2, 1), np.einsum("krd,krd->kr", A, A) + 1e-300
    multipliers, shifted, x = np.zeros((k, r)), center, np.clip(center, low, high)
    values = _times(A, x)
    inside, above, active = None, equation, np.ones((k, r), dtype=bool)
    for _ in range(ITERATIONS):
        before = inside, active
        inside = (shifted > low) & (shifted < high)
        if not only_equations:
            above = equation | (multipliers * size + values > upper)
            active = above | (multipliers * size + values < lower)
        if before[0] is not None and np.array_equal(inside, before[0]) and np.array_equal(active, before[1]):
            break
        # A row all of whose variables are clipped could not be moved at all.
        stuck = (np.einsum("krd,krd,kd->kr", A, A, inside) < STUCK * size) & active
        inside = inside | stuck.any(axis=1, keepdims=True)
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
    missed = np.maximum(np.maximum(lower - values, values - upper), 0.0).max(axis=1)
    return x, missed <= MET


def _times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    return (A @ x[:, :, None])[:, :, 0]
