"""What an algorithm is told of points that violate constraints: three ways, each a pure function, and one for those that only compare F.

Only here, at the border, does a violation or a failure ever become part of an objective; what is kept and shown has its own numbers.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

HANDLINGS = ("feasible-first", "penalty", "objective")


HUGE = 1e30
"""Larger than any objective; its square is still a number."""


Told = tuple[np.ndarray, np.ndarray]
"""Objectives (n, m) that are numbers, and violations (n,): 0 where a point counts as feasible, infinite where the evaluation failed."""


def excess(F: np.ndarray, violation: np.ndarray, tolerance: float, degree: np.ndarray | None = None) -> np.ndarray:
    """The degree of violation (n,), by default the violation itself, that counts: none where this is within the tolerance, infinite where
    the evaluation failed."""
    failed = ~np.isfinite(F).all(axis=1) | ~np.isfinite(violation)
    return np.where(failed, np.inf, np.where(violation <= tolerance, 0.0, violation if degree is None else degree))


def problem_type(cv: np.ndarray) -> float:
    """What Algorithm 1 of Chai and others (2020) distinguishes: 0 if no point is feasible, 1 if all are, 0.5 otherwise.

    There it saves work, and decides nothing: where no point is feasible, ranks by constrained dominance are those by violation. `cv` is as
    from `excess`.
    """
    feasible = cv == 0.0
    return 1.0 if feasible.all() else 0.5 if feasible.any() else 0.0


def feasible_first(F: np.ndarray, cv: np.ndarray) -> Told:
    """Superiority of feasible solutions (Deb 2000): objectives decide among the feasible, the violation among the others.

    That is Definition 1 of Chai and others (2020), but for its third line: among feasible points it is Pareto dominance that counts, not
    that every single objective is better.

    Parameters
    ----------
    F : array (n, m)
        Objectives; NaN where the evaluation failed.
    cv : array (n,)
        See `excess`.
    """
    return _numbers(F, cv), cv


def penalty(F: np.ndarray, cv: np.ndarray, factor: float) -> Told:
    """Penalty function: `factor` times the violation is added to every objective. Arguments as for `feasible_first`."""
    finite = np.isfinite(cv)
    return _numbers(F + factor * np.where(finite, cv, 0.0)[:, None], cv), np.where(finite, 0.0, cv)


def objective(F: np.ndarray, cv: np.ndarray) -> Told:
    """Constraint as an objective: the violation is one more, the last. Arguments as for `feasible_first`."""
    return _numbers(np.hstack([F, cv[:, None]]), cv), np.where(np.isfinite(cv), 0.0, cv)


def told(handling: str, factor: float, F: np.ndarray, violation: np.ndarray, tolerance: float, degree: np.ndarray | None = None) -> Told:
    """What an algorithm is told of points with these objectives and violations, and degrees of violation if they are others."""
    cv = excess(F, violation, tolerance, degree)
    if handling == "penalty":
        return penalty(F, cv, factor)
    return objective(F, cv) if handling == "objective" else feasible_first(F, cv)


def by_objectives(F: np.ndarray, cv: np.ndarray) -> np.ndarray:
    """Objectives (n, m) that say all, for algorithms that know of nothing else: feasible-first by plain comparison.

    Every objective of an infeasible point is beyond any feasible one, by as much as its violation ranks it: less violated points dominate
    more violated ones, and are better in any Tchebycheff or boundary-intersection scalarisation.
    """
    share = np.divide(cv, 1.0 + cv, out=np.ones_like(cv), where=np.isfinite(cv))
    return np.where((cv > 0.0)[:, None], HUGE * (1.0 + share)[:, None], F)


def _numbers(F: np.ndarray, cv: np.ndarray) -> np.ndarray:
    """F with a number, that nobody is to look at, where the evaluation failed."""
    return np.where(np.isfinite(cv)[:, None], F, HUGE)


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
