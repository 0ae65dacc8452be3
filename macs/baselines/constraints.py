"""Constraint handling of the baselines: objectives and violations as they are presented to an algorithm.

There are three ways, each a pure function, and one more for algorithms that only compare objectives. Only here does a violation or a
failure become part of an objective; states and fronts keep the original values.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

HANDLINGS = ("feasible-first", "penalty", "objective")
BEYOND_ALL = 1e30
"""Larger than any objective; its square is still finite."""
Presented = tuple[np.ndarray, np.ndarray]
"""Finite objectives (n, m), and violations (n,): 0 for a point that counts as feasible, infinite if the evaluation failed."""


def excess(F: np.ndarray, violation: np.ndarray, tolerance: float, degree: np.ndarray | None = None) -> np.ndarray:
    """Degree of violation (n,), by default the violation itself: 0 if the violation is within the tolerance, infinite if the evaluation
    failed."""
    failed = ~np.isfinite(F).all(axis=1) | ~np.isfinite(violation)
    return np.where(failed, np.inf, np.where(violation <= tolerance, 0.0, violation if degree is None else degree))


def problem_type(cv: np.ndarray) -> float:
    """Type of a problem in Algorithm 1 of Chai and others (2020): 0 if no point is feasible, 1 if all are, 0.5 otherwise.

    The algorithm only saves work by it: if no point is feasible, ranks by constrained dominance equal those by violation. `cv` (n,) is that
    of `excess`.
    """
    feasible = cv == 0.0
    return 1.0 if feasible.all() else 0.5 if feasible.any() else 0.0


def feasible_first(F: np.ndarray, cv: np.ndarray) -> Presented:
    """Superiority of feasible solutions (Deb 2000): feasible points are compared by objectives, infeasible ones by violation.

    This is Definition 1 of Chai and others (2020) except for its third line: feasible points are compared by Pareto dominance, which does
    not require every single objective to be better. F (n, m), cv (n,).
    """
    return _finite(F, cv), cv


def penalty(F: np.ndarray, cv: np.ndarray, factor: float) -> Presented:
    """Penalty function: `factor` times the violation is added to every objective. Arguments as for `feasible_first`."""
    finite = np.isfinite(cv)
    return _finite(F + factor * np.where(finite, cv, 0.0)[:, None], cv), np.where(finite, 0.0, cv)


def objective(F: np.ndarray, cv: np.ndarray) -> Presented:
    """Violation as an additional objective, the last one. Arguments as for `feasible_first`."""
    return _finite(np.hstack([F, cv[:, None]]), cv), np.where(np.isfinite(cv), 0.0, cv)


def presented(
    handling: str, factor: float, F: np.ndarray, violation: np.ndarray, tolerance: float, degree: np.ndarray | None = None
) -> Presented:
    """Objectives and violations of points as presented to an algorithm with this `handling`; `degree` (n,) is by default the violation."""
    cv = excess(F, violation, tolerance, degree)
    if handling == "penalty":
        return penalty(F, cv, factor)
    return objective(F, cv) if handling == "objective" else feasible_first(F, cv)


def by_objectives(F: np.ndarray, cv: np.ndarray) -> np.ndarray:
    """Objectives (n, m) that include the violation, for algorithms that compare objectives only: feasible points come first.

    Every objective of an infeasible point exceeds that of any feasible one, and increases with the violation. So less violated points
    dominate more violated ones, and are better in any Tchebycheff or boundary-intersection scalarisation.
    """
    share = np.divide(cv, 1.0 + cv, out=np.ones_like(cv), where=np.isfinite(cv))
    return np.where((cv > 0.0)[:, None], BEYOND_ALL * (1.0 + share)[:, None], F)


def _finite(F: np.ndarray, cv: np.ndarray) -> np.ndarray:
    """F with a finite number, which is not used, where the evaluation failed."""
    return np.where(np.isfinite(cv)[:, None], F, BEYOND_ALL)


SUMS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "sum": lambda v: v.sum(axis=1),  # eq. (18) with eq. (16) without its upper bound
    "log": lambda v: np.log1p(v).sum(axis=1),
    "printed": lambda v: np.minimum(v, 1.0).sum(axis=1),  # each at most 1, twice the limit: eqs. (16)-(18) as printed
}
"""Degrees (k,) of violations v (k, c) by name, after Chai and others (2020)."""


DEGREES = ("largest", *SUMS)


def degree(name: str, violation: np.ndarray, violations: Callable[[], np.ndarray], tolerance: float) -> np.ndarray:
    """Degree of violation (k,) of points: infinite if the evaluation failed, positive if the violation exceeds the tolerance."""
    if name == "largest":
        return violation
    v = np.nan_to_num(violations(), nan=np.inf, posinf=np.inf)
    return np.where(np.isfinite(violation), SUMS[name](np.where(v > tolerance, v, 0.0)), np.inf)
