"""How far the conditions of Pareto optimality determine the weights of the objectives: at a corner of a front, several do as well."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .optimality import Conditions

FIRST, FASTER = 1e-3, 4.0
"""The first part by which a ratio is changed, and by how many times the next."""
STEPS, HALVINGS = 12, 12
"""Most such changes, after which nothing is taken to bound it; and how often the last is halved."""


def ratio_bounds(conditions: Conditions, i: int, j: int, residual: float) -> tuple[float, float]:
    """The least and the largest ratio of the weights of objectives j and i, in scales, with which no more than `residual` is left of the
    conditions; not numbers where neither has a weight. All that lies between does as well. Each takes up to 24 solves of least squares.
    """
    if conditions.scaled is None or conditions.scaled[0][[i, j]].max() <= 0.0:
        return np.nan, np.nan
    one, other = conditions.scaled[0][[i, j]]

    def good(ratio: float) -> bool:
        return ratio_residual(conditions, i, j, ratio) <= residual

    def inverse(ratio: float) -> bool:
        return ratio_residual(conditions, j, i, ratio) <= residual

    if one <= 0.0:
        return 1.0 / _largest(inverse, 0.0), np.inf
    least = 1.0 / _largest(inverse, one / other) if other > 0.0 else 0.0
    return least, _largest(good, other / one)


def ratio_residual(conditions: Conditions, i: int, j: int, ratio: float) -> float:
    """What is left of the conditions by the best weights of which that of objective j is so many times that of i; infinity: i has none."""
    mixed = np.eye(conditions.scaled[0].size if conditions.scaled else 0)
    share = 1.0 if np.isinf(ratio) else ratio / (1.0 + ratio)
    mixed[:, i] = (1.0 - share) * mixed[:, i] + share * mixed[:, j]
    return conditions.residual_of(np.delete(mixed, j, axis=1))


def _largest(good: Callable[[float], bool], ratio: float) -> float:
    """The largest ratio that is good, from one that is; infinite where all larger ones are."""
    if good(np.inf):
        return float("inf")
    last, change = ratio, FIRST
    for _ in range(STEPS):
        ahead = last * (1.0 + change) if last > 0.0 else change
        if not good(ahead):
            break
        last, change = ahead, FASTER * change
    low, high = last, ahead
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return low
