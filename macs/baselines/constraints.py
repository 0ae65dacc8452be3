"""Constraint handling of the baselines: objectives and violations as they are presented to an algorithm.

Only here does a violation or a failure become part of an objective; states and fronts keep the original values.
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


def presented(
    handling: str, factor: float, F: np.ndarray, violation: np.ndarray, tolerance: float, degree: np.ndarray | None = None
) -> Presented:
    """Objectives and violations of points as presented to an algorithm with this `handling`; `degree` (n,) is by default the violation.

    "feasible-first": superiority of feasible solutions (Deb 2000), that is, feasible points are compared by objectives, infeasible ones by
    violation. This is Definition 1 of Chai and others (2020) except for its third line: feasible points are compared by Pareto dominance,
    which does not require every single objective to be better. "penalty": `factor` times the violation is added to every objective.
    "objective": the violation is an additional objective, the last one.
    """
    cv = excess(F, violation, tolerance, degree)
    finite = np.isfinite(cv)
    if handling == "penalty":
        F = F + factor * np.where(finite, cv, 0.0)[:, None]
    elif handling == "objective":
        F = np.hstack([F, cv[:, None]])
    # What failed has a finite number, which is not used.
    return np.where(finite[:, None], F, BEYOND_ALL), cv if handling == "feasible-first" else np.where(finite, 0.0, cv)


def by_objectives(F: np.ndarray, cv: np.ndarray) -> np.ndarray:
    """Objectives (n, m) that include the violation, for algorithms that compare objectives only: feasible points come first.

    Every objective of an infeasible point exceeds that of any feasible one, and increases with the violation. So less violated points
    dominate more violated ones, and are better in any Tchebycheff or boundary-intersection scalarisation.
    """
    share = np.divide(cv, 1.0 + cv, out=np.ones_like(cv), where=np.isfinite(cv))
    return np.where((cv > 0.0)[:, None], BEYOND_ALL * (1.0 + share)[:, None], F)


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
