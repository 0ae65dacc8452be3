"""Fronts with closed forms, on which preferences are tested."""

import numpy as np

from macs.front import Front
from problems.compiled import Objective, Variable

FASTEST, SLOWEST = 1.2, 4.0
"""Ends of the front of a cart from rest to rest over a distance of one in time T: the effort is 12 / T^3."""


def plain_front(objectives: np.ndarray, goals: list[Objective], **columns) -> Front:
    """A front of these objectives (n, m), in the user's senses."""
    signs = np.array([goal.sign for goal in goals])
    n = len(objectives)
    given = {
        "F": np.asarray(objectives, dtype=float) * signs,
        "decision": np.zeros((n, 1)),
        "violation": np.zeros(n),
        "status": ["converged"] * n,
        "goals": goals,
        "variables": [Variable("x", 0.0, 1.0)],
    }
    return Front(**{**given, **columns})


def cart(n: int = 20_001, **columns) -> Front:
    """The front of the cart, dense; both objectives are minimised."""
    T = np.linspace(FASTEST, SLOWEST, n)
    return plain_front(np.column_stack([T, 12 / T**3]), [Objective("time", "s"), Objective("effort", "m²/s³")], **columns)


def turned_cart(n: int = 20_001) -> Front:
    """The same front in other units and senses: the time in milliseconds, the effort negative and maximised, in units of 10^-10."""
    T = np.linspace(FASTEST, SLOWEST, n)
    return plain_front(np.column_stack([1e3 * T, -12e10 / T**3]), [Objective("time", "ms"), Objective("effort", "", "maximize")])
