"""How far the conditions of Pareto optimality determine the weights of the objectives: at a corner of a front, several do as well."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from .optimality import Conditions

ACTIVE = 1e-4
"""Inequalities with more slack than this, in scales, are taken to have no multiplier: within any residual that counts, theirs are small."""
SOLVED, INFEASIBLE, UNBOUNDED = 0, 2, 3
"""Statuses of `linprog`."""
OTHERWISE = {INFEASIBLE: np.inf, UNBOUNDED: -np.inf}
"""Least values where there is none."""


def weight_bounds(conditions: Conditions, combination: np.ndarray, unit: np.ndarray, residual: float) -> tuple[float, float]:
    """The least and the largest value of a combination (m,) of weights in scales, where unit @ weights = 1.

    The weights are those for which there are multipliers that leave no derivative, and no product of a multiplier and its slack, larger
    than `residual` times their sum. Infinite where nothing bounds it; the least is positive and
    the largest negative infinity where there are no such weights; not numbers where that was not found out.

    Parameters
    ----------
    conditions : Conditions
        Of which all objectives are used.
    combination, unit : arrays (m,)
    residual : float
    """
    A, slack = conditions.reduced, conditions.linear.slack
    m = A.shape[1] - len(slack)
    near = slack <= ACTIVE
    A = np.hstack([A[:, :m], A[:, m:][:, near]]) / residual
    products = np.hstack([np.zeros((np.count_nonzero(near), m)), np.diag(slack[near] / residual)])
    # Those of inequalities without slack say nothing.
    products = products[slack[near] > residual * np.finfo(float).eps]
    sums = np.r_[np.ones(m), np.zeros(A.shape[1] - m)]
    limits = np.vstack([A - sums, -A - sums, products - sums])
    cost, fixed = (np.r_[values, np.zeros(A.shape[1] - m)] for values in (combination, unit))

    def least(sign: float) -> float:
        found = linprog(sign * cost, limits, np.zeros(len(limits)), fixed[None], [1.0], method="highs")
        return float(found.fun) if found.status == SOLVED else OTHERWISE.get(found.status, np.nan)

    return least(1.0), -least(-1.0)
