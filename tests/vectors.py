"""Products of single vectors in space, for rates that an integration asks for thousands of times: numpy's are made for long arrays."""

import math

import numpy as np


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The vector product of two vectors (3,)."""
    (a1, a2, a3), (b1, b2, b3) = a.tolist(), b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def norm(a: np.ndarray) -> float:
    """The length of a vector (3,)."""
    return math.hypot(*a)
