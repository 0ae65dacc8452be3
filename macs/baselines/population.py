"""Base of all solvers with a population: its state, constraint handling, first candidates, evaluation and statistics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np

from problems.checks import check_choice, check_count, check_interval

from ..evaluation.evaluator import Evaluator
from ..pareto.archive import Archive, least_violated
from ..pareto.dominance import nondominated
from ..solvers.solver import Solver

HANDLINGS = ("feasible-first", "penalty", "objective")
BEYOND_ALL = 1e30
"""Larger than any objective; its square is still finite."""
Presented = tuple[np.ndarray, np.ndarray]
"""Finite objectives (n, m), and violations (n,): 0 for a point that counts as feasible, infinite if the evaluation failed."""
SUMS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "sum": lambda v: v.sum(axis=1),  # eq. (18) with eq. (16) without its upper bound
    "log": lambda v: np.log1p(v).sum(axis=1),
    "capped": lambda v: np.minimum(v, 1.0).sum(axis=1),  # with g_max = 2 g*, with which eq. (16) does not jump
    # Eqs. (16)-(18) as printed: in parts of the largest of the generation, and 1 from twice the limit on.
    "printed": lambda v: np.where(v < 1.0, v / v.max(axis=0, initial=1e-300, where=np.isfinite(v)), 1.0).sum(axis=1),
}
"""Degrees (k,) of violations v (k, c) by name, after Chai and others (2020)."""
DEGREES = ("largest", *SUMS)


@dataclass(repr=False, kw_only=True)
class State:
    """State of a solver with a population between two iterations. Each solver adds its own fields."""

    CARRIED: ClassVar[dict[str, str]] = {}
    """Fields that pymoo's algorithm has, too, and its attribute: `Members` or arrays, and None before the algorithm has them."""

    members: Members  # the population
    archive: Archive  # the present front: feasible, mutually non-dominated and different points
    closest: Archive  # the least violated point evaluated, one row, as long as the archive is empty; no row afterwards
    iteration: int = 0  # generations after the first population
    # first_feasible, all_feasible: First generation with one feasible member, and with all members feasible; the first population is
    # generation 1. 0: none so far.
    first_feasible: int = 0
    all_feasible: int = 0
    rng: np.random.Generator

    @classmethod
    def of(cls, members: Members, rng: np.random.Generator, **more: Any) -> Self:
        """The state of a first population; `more` are the solver's own fields."""
        none = Archive.of(members, np.arange(0))
        return cls(members=members, archive=none, closest=none, rng=rng, **more)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: generation {self.iteration + 1}; {self.members}, {self.archive}>"

    def note(self, tolerance: float) -> None:
        """Update `first_feasible` and `all_feasible` by the population of this generation."""
        feasible = excess(self.members.F, self.members.violation, tolerance) == 0.0
        if feasible.any() and not self.first_feasible:
            self.first_feasible = self.iteration + 1
        if feasible.all() and not self.all_feasible:
            self.all_feasible = self.iteration + 1

    def show(self, tolerance: float, seen: Members, *groups: Members) -> None:
        """Update the archive to the front of the first group with feasible points; see `shown`.

        If no group has any, the archive stays; if it is empty, it becomes the front of the points just `seen`, or `closest` is updated.
        """
        found = shown(tolerance, *groups)
        if found is None and not len(self.archive):
            found = shown(tolerance, seen)
        if found is not None:
            self.archive, self.closest = found, self.closest.take(np.arange(0))
        elif not len(self.archive):
            self.closest = least_violated(self.closest, seen.Z, seen.F, seen.violation)


@dataclass(frozen=True, kw_only=True)
class PopulationSolver(Solver):
    """Solver with a population.

    `stats["population"]` of its fronts has the number of `generations`, the first population included; the `size` of the last population,
    and how many of its members were `feasible`, and of these `nondominated`; and the first generation with one feasible member,
    `first_feasible`, and with all members feasible, `all_feasible` (None if there was none).
    """

    handling: str = "feasible-first"
    penalty: float = 1000.0
    degree: str = "largest"

    RANGES: ClassVar[Mapping[str, int | str]] = {
        **dict.fromkeys(("population", "neighbors"), 2),
        **dict.fromkeys(("particles", "archive", "cells", "divisions"), 1),
        **dict.fromkeys(("crossover", "neighbor_mating", "search"), "[0, 1]"),
        **dict.fromkeys(("max_velocity", "adapt_every"), "(0, 1]"),
        **dict.fromkeys(("crossover_eta", "mutation_eta"), "[1, 100]"),
        **dict.fromkeys(("penalty", "alpha", "inertia", "final_inertia", "cognitive", "social", "settled"), "[0, inf)"),
    }
    """Of all settings of all solvers that are numbers: the least value of a count, the interval of others."""
    COMPARES_VIOLATIONS: ClassVar[bool] = True
    """Whether the algorithm compares violations itself; otherwise they are included in the objectives presented to it."""

    def __post_init__(self) -> None:
        kind = type(self).__name__
        for setting in fields(self):
            name, value, allowed = f"{kind}: {setting.name}", getattr(self, setting.name), self.RANGES.get(setting.name)
            if isinstance(allowed, int) and not (value is None and setting.default is None):
                check_count(name, value, allowed)
            elif isinstance(allowed, str):
                check_interval(name, value, allowed)
            elif isinstance(setting.default, bool) and not isinstance(value, bool | np.bool_):
                raise ValueError(f"{name} must be True or False, not {value!r}")
        check_choice(f"{kind}: handling", self.handling, HANDLINGS)
        check_choice(f"{kind}: degree", self.degree, DEGREES)

    def extra_stats(self, state: State, evaluator: Evaluator) -> dict[str, Any]:
        """See `SearchMethod.extra_stats`."""
        members = state.members
        feasible = members.take(excess(members.F, members.violation, evaluator.tolerance) == 0.0)
        return {
            "population": {
                "generations": state.iteration + 1,
                "size": len(members),
                "feasible": len(feasible),
                "nondominated": int(np.count_nonzero(nondominated(feasible.F))),
                "first_feasible": state.first_feasible or None,
                "all_feasible": state.all_feasible or None,
            }
        }

    def _presented(self, points: Members, tolerance: float) -> Presented:
        """Objectives and violations of points as presented to the algorithm."""
        F, cv = presented(self.handling, self.penalty, points.F, points.violation, tolerance, points.degree)
        return (F, cv) if self.COMPARES_VIOLATIONS else (by_objectives(F, cv), np.zeros(len(cv)))

    def _presented_count(self, m: int) -> int:
        """Number of objectives as presented to the algorithm, for a problem with m."""
        return m + (self.handling == "objective")

    def _draw(self, evaluator: Evaluator, count: int, rng: np.random.Generator) -> np.ndarray:
        """Candidates (count, d) drawn uniformly from the box, as pymoo does."""
        return evaluator.lower + (evaluator.upper - evaluator.lower) * evaluator.box.evenly(rng.random((count, len(evaluator.free))))

    def _candidates(self, evaluator: Evaluator, given: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """First full vectors (count, D): the given ones, then drawn ones."""
        Z = evaluator.first_guess(evaluator.opening(self._draw(evaluator, count, rng)))
        if len(given):
            Z[: len(given)] = given
        Z[:, evaluator.free] = evaluator.box.confine(Z[:, evaluator.free])
        return Z


def distinct(start: np.ndarray | None) -> np.ndarray:
    """The different vectors of a `start` (k, D), in their order; empty for None."""
    return np.empty((0, 0)) if start is None else start[np.sort(np.unique(start, axis=0, return_index=True)[1])]


def thinned(given: np.ndarray, size: int) -> np.ndarray:
    """The vectors `given` (k, D); if they are more than `size`, so many evenly spaced ones."""
    return given if len(given) <= size else given[np.linspace(0, len(given) - 1, size).round().astype(int)]


@dataclass(frozen=True, repr=False)
class Members(Archive):
    """Evaluated points of a population, feasible or not. Z (n, D), F (n, m), violation (n,)."""

    SHAPES: ClassVar[dict[str, str]] = Archive.SHAPES | {"degree": "n"}

    degree: np.ndarray  # (n,): Number by which infeasible points are ranked; see `violation_degree`


def evaluate(evaluator: Evaluator, Z: np.ndarray, by: str) -> Members:
    """The evaluated full vectors Z (k, D), with the degree of violation named `by`.

    Each has the position to which the evaluator moved it; after a failure without a result, its original position.
    """
    seen = evaluator.evaluate(Z)
    degree = violation_degree(by, seen.violation, lambda: seen.violations, evaluator.tolerance)
    return Members(np.where(np.isfinite(seen.Z), seen.Z, Z), seen.F, seen.violation, degree)


def full_vectors(evaluator: Evaluator, members: Members, X: np.ndarray) -> np.ndarray:
    """Full vectors (k, D) for candidates X (k, d); the other entries are those of the nearest member, in spans, that did not fail."""
    free = evaluator.free
    usable = np.flatnonzero(np.isfinite(members.violation))
    if members.Z.shape[1] == len(free) or not usable.size:
        return evaluator.first_guess(X)
    box, Z = evaluator.box, members.Z[usable]
    vectors = Z[box.squared_distances(box.to_unit(X), box.to_unit(Z[:, free])).argmin(axis=1)]
    vectors[:, free] = X
    return vectors


def shown(tolerance: float, *groups: Members) -> Archive | None:
    """The feasible, mutually non-dominated, different points of the first group with feasible points; None if no group has any."""
    for group in groups:
        feasible = group.take((group.violation <= tolerance) & np.isfinite(group.F).all(axis=1))
        if len(feasible):
            return Archive.of(feasible, nondominated(feasible.F))
    return None


# Constraint handling: only here does a violation or a failure become part of an objective; states and fronts keep the original values.


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


def violation_degree(name: str, violation: np.ndarray, violations: Callable[[], np.ndarray], tolerance: float) -> np.ndarray:
    """Degree of violation (k,) of points: infinite if the evaluation failed, positive if the violation exceeds the tolerance."""
    if name == "largest":
        return violation
    v = np.nan_to_num(violations(), nan=np.inf, posinf=np.inf)
    return np.where(np.isfinite(violation), SUMS[name](np.where(v > tolerance, v, 0.0)), np.inf)
