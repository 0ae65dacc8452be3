"""What all solvers with a population share, whoever moves it: constraints and degrees, first candidates, and how feasible it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from problems.checks import check_count

from ..evaluation.evaluator import Evaluator
from ..pareto.archive import Archive, least_violated
from ..pareto.dominance import nondominated
from ..solvers.solver import Solver
from . import constraints as degrees
from . import constraints as handlings
from .constraints import DEGREES


@dataclass
class State:
    """What every such solver knows between two iterations; each adds what is its own.

    Attributes
    ----------
    members : Members
        The population.
    archive : Archive
        The front as it is now: feasible, mutually non-dominated, no two alike.
    closest : Archive
        The least violated point seen, one row, as long as the archive is empty; no row afterwards.
    iteration : int
        Generations done after the first population.
    first_feasible, all_feasible : int
        The first generation in which one member, and in which all were feasible; the first population is generation 1. 0: none so far.
    rng : numpy.random.Generator
    """

    members: Members
    archive: Archive
    closest: Archive
    iteration: int
    first_feasible: int
    all_feasible: int
    rng: np.random.Generator

    def note(self, tolerance: float) -> None:
        """Note how feasible the population of this generation is; see `handling.problem_type`."""
        kind = handlings.problem_type(handlings.excess(self.members.F, self.members.violation, tolerance))
        if kind > 0.0 and not self.first_feasible:
            self.first_feasible = self.iteration + 1
        if kind == 1.0 and not self.all_feasible:
            self.all_feasible = self.iteration + 1

    def show(self, tolerance: float, seen: Members, *groups: Members) -> None:
        """Let the archive be what is `shown` of the first of the groups that has feasible points.

        If none has, it is what it last was; if that is nothing, what is feasible of the points just `seen`.
        """
        found = shown(tolerance, *groups)
        if found is None and not len(self.archive):
            found = shown(tolerance, seen)
        if found is not None:
            self.archive, self.closest = found, self.closest.take(np.arange(0))
        elif not len(self.archive):
            self.closest = least_violated(self.closest, seen.Z, seen.F, seen.violation)


class PopulationSolver(Solver):
    """A solver with a population, and with `handling`, `penalty` and `degree` among its settings.

    `stats["population"]` of its fronts tell, beside the number of `generations`, with the first population as the first, the `size` of the
    last one, how many of it were `feasible`, how many of these `nondominated`, and the first generations with one feasible member,
    `first_feasible`, and with none that was not, `all_feasible`; None where there was none.
    """

    handling: str
    penalty: float
    degree: str

    def extra_stats(self, state: State, tolerance: float) -> dict[str, Any]:
        """See `SearchMethod.extra_stats`."""
        members = state.members
        feasible = members.take(handlings.excess(members.F, members.violation, tolerance) == 0.0)
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

    def _told(self, points: Members, tolerance: float) -> handlings.Told:
        """What the algorithm is told of points."""
        return handlings.told(self.handling, self.penalty, points.F, points.violation, tolerance, points.degree)

    def _draw(self, evaluator: Evaluator, count: int, rng: np.random.Generator) -> np.ndarray:
        """`count` candidates (count, d), drawn evenly from the box, as pymoo draws them."""
        return evaluator.lower + (evaluator.upper - evaluator.lower) * rng.random((count, len(evaluator.free)))

    def _candidates(self, evaluator: Evaluator, given: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Full vectors (count, D) to begin with: the given ones, and drawn ones in the places that are left."""
        Z = evaluator.first_guess(evaluator.opening(self._draw(evaluator, count, rng)))
        if len(given):
            Z[: len(given)] = given
        Z[:, evaluator.free] = evaluator.box.confine(Z[:, evaluator.free])
        return Z

    def _check(self, counts: Mapping[str, int], ranges: Mapping[str, tuple[float, float]]) -> None:
        """Raise ValueError for settings that make no sense: `counts` gives the least of each, `ranges` the closed interval."""
        name = type(self).__name__
        for setting, least in counts.items():
            if getattr(self, setting) is not None or getattr(type(self), setting) is not None:  # None only where that is the default
                check_count(f"{name}: {setting}", getattr(self, setting), least)
        for setting, (low, high) in {**ranges, "penalty": (0.0, np.inf)}.items():
            value = getattr(self, setting)
            if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not low <= value <= high or np.isinf(value):
                wanted = f"in [{low:g}, {high:g}]" if np.isfinite(high) else f"a number of at least {low:g}"
                raise ValueError(f"{name}: {setting} must be {wanted}, not {value!r}")
        for setting, words in (("handling", handlings.HANDLINGS), ("degree", DEGREES)):
            if getattr(self, setting) not in words:
                known = ", ".join(f"'{word}'" for word in words)
                raise ValueError(f"{name}: {setting} must be one of {known}, not {getattr(self, setting)!r}")


def distinct(start: np.ndarray | None) -> np.ndarray:
    """The vectors of a `start` (k, D), or of none, without repetitions."""
    return np.empty((0, 0)) if start is None else start[np.sort(np.unique(start, axis=0, return_index=True)[1])]


def thinned(given: np.ndarray, size: int) -> np.ndarray:
    """The vectors `given` (k, D); of more than `size`, so many evenly spaced ones."""
    return given if len(given) <= size else given[np.linspace(0, len(given) - 1, size).round().astype(int)]


@dataclass(frozen=True, repr=False)
class Members(Archive):
    """Evaluated points of a population, feasible or not.

    Attributes
    ----------
    Z : array (n, D)
        Full vectors, in the user's units, after the evaluation.
    F : array (n, m)
        Objectives, all minimised; NaN where the evaluation failed.
    violation : array (n,)
        Largest scaled residual of any constraint; infinite where the evaluation failed.
    degree : array (n,)
        Number by which infeasible points are ranked; see `constraints.degree`.
    """

    degree: np.ndarray


def evaluate(evaluator: Evaluator, Z: np.ndarray, by: str) -> Members:
    """Evaluate full vectors (k, D), with the degree of violation named `by`.

    A point is where the evaluator moved it; a failure that brought nothing back, where it was sent.
    """
    seen = evaluator.evaluate(Z)
    degree = degrees.degree(by, seen.violation, lambda: seen.violations, evaluator.tolerance)
    return Members(np.where(np.isfinite(seen.Z), seen.Z, Z), seen.F, seen.violation, degree)


def full_vectors(evaluator: Evaluator, members: Members, X: np.ndarray) -> np.ndarray:
    """Full vectors (k, D) for candidates X (k, d): the rest is that of the nearest member, in spans, whose evaluation did not fail."""
    free = evaluator.free
    usable = np.flatnonzero(np.isfinite(members.violation))
    if members.Z.shape[1] == len(free) or not usable.size:
        return evaluator.first_guess(X)
    box, Z = evaluator.box, members.Z[usable]
    vectors = Z[box.squared_distances(box.to_unit(X), box.to_unit(Z[:, free])).argmin(axis=1)]
    vectors[:, free] = X
    return vectors


def shown(tolerance: float, *groups: Members) -> Archive | None:
    """The feasible, mutually non-dominated points, no two alike, of the first group that has feasible ones; None if none has."""
    for group in groups:
        feasible = group.take((group.violation <= tolerance) & np.isfinite(group.F).all(axis=1))
        if len(feasible):
            return Archive.of(feasible, nondominated(feasible.F))
    return None
