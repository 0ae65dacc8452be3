"""What a point is the optimum of, so that it can be solved again on any mesh."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from transcription.base import NLP
from transcription.nlp.scalarized import Solved
from transcription.stopping import stopping

from ..evaluation.evaluator import CONVERGED
from .multistart import GradientSolves


class Task(ABC):
    """A scalarised problem that can be solved on any mesh."""

    units: np.ndarray  # (m,): What counts as one in each objective

    @abstractmethod
    def solve(self, solves: GradientSolves, nlp: NLP, start: np.ndarray) -> Solved:
        """The result of gradient solves from a vector (n,)."""

    @abstractmethod
    def loss(self, F: np.ndarray) -> float:
        """How bad objectives (m,) are for it, in units; less is better."""

    @property
    @abstractmethod
    def used(self) -> np.ndarray:
        """Mask (m,) of the objectives that matter."""

    @property
    def sharp(self) -> np.ndarray:
        """Mask (m,) of those that a solve determines as exactly as its tolerance. By default all that matter."""
        return self.used


@dataclass(frozen=True, eq=False)
class Along(Task):
    """From a reference along weights to the front: Pascoletti and Serafini 1984; see `scalarize` for the arguments (m,)."""

    reference: np.ndarray
    weights: np.ndarray
    units: np.ndarray
    ceiling: np.ndarray | None = None

    def solve(self, solves: GradientSolves, nlp: NLP, start: np.ndarray) -> Solved:
        """See `Task.solve`."""
        return solves(nlp, start, self.reference, self.weights, self.ceiling)

    def loss(self, F: np.ndarray) -> float:
        """See `Task.loss`."""
        moving, hard = self.used & (self.weights > 0), self.used & (self.weights <= 0)
        # As the solve has it: by the weights, of which the largest is given in units.
        alpha = np.max((F - self.reference)[moving] / self.weights[moving]) * np.max((self.weights / self.units)[moving])
        return float(alpha + np.maximum((F - self.reference)[hard] / self.units[hard], 0.0).sum())

    @property
    def used(self) -> np.ndarray:
        """See `Task.used`."""
        return self.reference < np.inf


ROOM = 0.05
"""How much worse the other objectives of an end may become on another mesh, in units, before it is also sought near where it was."""
TIED = 1e-6
"""What counts as no loss of the one objective then, in units."""
CLOSE = 1e-3
"""Violation up to which a start on another mesh is nearly the end itself."""


@dataclass(frozen=True, eq=False)
class End(Task):
    """The least value of one objective, and for that the least values of the others. units (m,)."""

    objective: int
    units: np.ndarray
    # (m,): Objectives of the end on another mesh. Many points may have the least value of the one objective, such as its bound: one with
    # the others near these is preferred.
    known: np.ndarray

    def solve(self, solves: GradientSolves, nlp: NLP, start: np.ndarray) -> Solved:
        """See `Task.solve`."""
        mine = np.arange(len(self.units)) == self.objective
        alone = np.where(mine, 0.0, np.inf)
        first = solves(nlp, start, alone, self.units)
        if len(self.units) == 1:
            return first
        near = np.where(mine, np.inf, self.known + ROOM * self.units)
        if not stopping() and (first.status != CONVERGED or (near < first.F).any()):
            held = solves(nlp, start, alone, self.units, near)
            if held.status == CONVERGED and (first.status != CONVERGED or self.loss(held.F) <= self.loss(first.F) + TIED):
                first = held
        if first.status != CONVERGED:
            return first
        # No slack: where the front is steep, a small loss in one objective changes another by its square root.
        ceiling = np.where(mine, first.F, np.inf)
        # The first solve does not look at the other objectives, and often leaves a start that was nearly the end.
        (F,), (violation,) = nlp.evaluate(start[None])
        closer = violation <= CLOSE and bool((first.F >= F).all())
        second = solves(nlp, start if closer else first.z, np.where(mine, np.inf, first.F), self.units, ceiling)
        # What tells whether the one objective is at its least are the multipliers for that alone.
        return replace(second, multipliers=first.multipliers) if second.status == CONVERGED else first

    def loss(self, F: np.ndarray) -> float:
        """See `Task.loss`."""
        return float(F[self.objective] / self.units[self.objective])

    @property
    def used(self) -> np.ndarray:
        """See `Task.used`."""
        return np.ones(len(self.units), dtype=bool)

    @property
    def sharp(self) -> np.ndarray:
        """See `Task.sharp`: where the front is steep, the others are determined by the root of an error of the first."""
        return np.arange(len(self.units)) == self.objective
