"""The points that an algorithm works with, and how candidates become points: the border between its population and the evaluator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..evaluation.evaluator import Evaluator
from ..pareto.archive import Archive
from ..pareto.dominance import nondominated
from ..search.loop import box_of
from . import degrees


@dataclass(frozen=True)
class Members:
    """Evaluated points, one a row, feasible or not.

    Attributes
    ----------
    Z : array (n, D)
        Full vectors, in the user's units, as they came back from the evaluator.
    F : array (n, m)
        Objectives, all minimised; NaN where the evaluation failed.
    violation : array (n,)
        Infinite where the evaluation failed.
    degree : array (n,)
        The number that infeasible points are ranked by; see `degrees`.
    """

    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray
    degree: np.ndarray

    def __len__(self) -> int:
        return len(self.F)

    def take(self, rows: np.ndarray) -> Members:
        """The points of `rows` (indices or mask)."""
        return Members(*(values[rows] for values in self._fields))

    def join(self, others: Members) -> Members:
        """These, then the others."""
        return Members(*(np.concatenate(pair) for pair in zip(self._fields, others._fields, strict=True)))

    @property
    def _fields(self) -> tuple[np.ndarray, ...]:
        return self.Z, self.F, self.violation, self.degree


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
    box, Z = box_of(evaluator), members.Z[usable]
    vectors = Z[box.squared_distances(box.to_unit(X), box.to_unit(Z[:, free])).argmin(axis=1)]
    vectors[:, free] = X
    return vectors


def shown(tolerance: float, *groups: Members) -> Archive | None:
    """The feasible, mutually non-dominated points, no two alike, of the first group that has feasible ones; None if none has."""
    for group in groups:
        feasible = group.take((group.violation <= tolerance) & np.isfinite(group.F).all(axis=1))
        if len(feasible):
            best = feasible.take(nondominated(feasible.F))
            return Archive(best.Z, best.F, best.violation)
    return None
