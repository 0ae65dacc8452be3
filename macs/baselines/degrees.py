"""Violation degrees: by how much a point misses its constraints altogether, in one number, for algorithms that rank by it.

After Chai, Savvaris, Tsourdos, Xia and Chai (IEEE Trans. Cybernetics 50, 2020), eqs. (16)-(18). There, g* is the limit of g, and
(g*, g_max) its tolerance range. Here a constraint's violation v is its largest residual in units of its scale: with a scale of g* that is
g / g* - 1, and of an equation |h - h*|.

- Eq. (16) as printed has (g - g*) / (g_max - g*) up to g_max, and 1 from 2 g* on: that is one function, and continuous, only where g_max is
  2 g*, so min(v, 1). Read so it depends on nothing but the point; read with the largest value of a population, it would leave values
  between g_max and 2 g* undefined or defined twice, and change from one population to the next.
- Cut off at 2 g* it is blind: among points that miss everything by more than that, a tournament is a coin. Hence, as corrected, v itself,
  or log(1 + v), which keeps their order and is not ruled by the one constraint that is missed most.

Each of them depends on its point alone, so that parents and offspring are always measured alike.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def total(v: np.ndarray) -> np.ndarray:
    """Eq. (18) of eq. (16) without its upper end: the sum (k,) of violations v (k, c)."""
    return v.sum(axis=1)


def logarithmic(v: np.ndarray) -> np.ndarray:
    """Eq. (18) of the logarithms: the sum (k,) of log(1 + v), for violations v (k, c)."""
    return np.log1p(v).sum(axis=1)


def printed(v: np.ndarray) -> np.ndarray:
    """Eqs. (16)-(18) as printed: the sum (k,) of violations v (k, c), each of which counts as 1 from 1 on, twice the limit."""
    return np.minimum(v, 1.0).sum(axis=1)


SUMS: dict[str, Callable[[np.ndarray], np.ndarray]] = {"sum": total, "log": logarithmic, "printed": printed}
DEGREES = ("largest", *SUMS)


def degree(name: str, violation: np.ndarray, violations: Callable[[], np.ndarray], tolerance: float) -> np.ndarray:
    """The degree of points.

    Parameters
    ----------
    name : str
        One of `DEGREES`; "largest" is the violation itself.
    violation : array (k,)
        Infinite where the evaluation failed.
    violations : callable
        Returns that of each constraint, (k, c); called only if it is needed.
    tolerance : float
        A constraint that is missed by no more counts as satisfied.

    Returns
    -------
    array (k,)
        Infinite where the evaluation failed, positive where the violation exceeds the tolerance.
    """
    if name == "largest":
        return violation
    v = np.nan_to_num(violations(), nan=np.inf, posinf=np.inf)
    return np.where(np.isfinite(violation), SUMS[name](np.where(v > tolerance, v, 0.0)), np.inf)
