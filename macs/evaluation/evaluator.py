"""The contract of what can be searched: candidates in, evaluated points out, every evaluation and solve counted.

A search has full vectors. Of their D entries it alters only the *free* ones (d of them). The others belong to the evaluator: for a
trajectory, the states from which the next inner solve starts. A black box has none.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from transcription.base import CONVERGED, FAILED, INFEASIBLE, TIMEOUT

__all__ = ["CONVERGED", "FAILED", "INFEASIBLE", "TIMEOUT", "Counts", "Evaluation", "Evaluator"]


@dataclass(frozen=True)
class Evaluation:
    """A batch of k evaluated points.

    Attributes
    ----------
    Z : array (k, D)
        Full vectors, in the user's units, as they came back: the nearest feasible points, where there was something to make feasible.
    F : array (k, m)
        Objectives, all minimised. NaN in a row whose evaluation failed.
    violation : array (k,)
        Largest scaled residual of any constraint, 0 where there is none, infinite where the evaluation failed.
    status : array (k,) of str
        "converged" (feasible within the tolerance), "infeasible", "failed" or "timeout".
    clocked : bool
        Whether a clock ended any of the work: the same vectors need not give the same batch again.
    fallbacks : int
        Vectors that a faster inner level left to a slower one.
    itemise : callable, optional
        Returns `violations`; called only where they are needed.
    """

    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray
    status: np.ndarray
    clocked: bool = False
    fallbacks: int = 0
    itemise: Callable[[], np.ndarray] | None = field(default=None, repr=False, compare=False)

    @property
    def violations(self) -> np.ndarray:
        """Largest scaled residual of each constraint (k, c), at least 0; one column (k, 1) where constraints are not told apart."""
        return self.violation[:, None] if self.itemise is None else self.itemise()


@dataclass
class Counts:
    """Costs of a run so far.

    Attributes
    ----------
    evaluations, inner_iterations, gradient_solves : int
    fallbacks : int
        Candidates that a faster inner level left to a slower one.
    failures : Counter
        Evaluations and gradient solves that did not converge, by status.
    clocked : int
        Batches and solves that a clock, not a count, ended early.
    """

    evaluations: int = 0
    inner_iterations: int = 0
    gradient_solves: int = 0
    fallbacks: int = 0
    failures: Counter[str] = field(default_factory=Counter)
    clocked: int = 0

    def add_solves(self, count: int, status: Iterable[str], iterations: int, clocked: int) -> None:
        """Count gradient solves that ended with these statuses."""
        self.gradient_solves += count
        self.failures.update(one for one in status if one != CONVERGED)
        self.inner_iterations += iterations
        self.clocked += clocked


class Evaluator(ABC):
    """A problem whose points can be evaluated.

    An implementation sets the attributes below and defines `first_guess` and `_evaluate`; this class counts.

    Attributes
    ----------
    free : array (d,) of int
        Indices, in the full vector, of the variables that a search may alter.
    lower, upper : arrays (d,)
        Finite bounds of the free variables, in the user's units; `lower < upper`.
    period : array (d,)
        Length of the period of a free variable that wraps around at its bounds, which are one period wide; 0 where it does not.
    tolerance : float
        A point whose violation is at most this is feasible.
    has_gradients : bool
        Whether `descend` works.
    m_known : int or None
        Number of objectives; None as long as only an evaluation could tell.
    counts : Counts
    before_batch : callable
        Called without arguments before each batch; it may end the search by raising an exception.
    """

    free: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    period: np.ndarray
    tolerance: float
    has_gradients: bool = False
    m_known: int | None = None
    counts: Counts
    before_batch: Callable[[], Any] = staticmethod(lambda: None)

    def resume(self, counts: Counts, m: int) -> None:
        """Continue the counts of an earlier run, in which there were m objectives."""
        self.counts = counts

    def opening(self, candidates: np.ndarray) -> np.ndarray:
        """First candidates (k, d) of a search, from candidates (k, d) drawn uniformly from the box; by default these."""
        return candidates

    @abstractmethod
    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        """Full vectors (k, D) for new candidates (k, d)."""

    @abstractmethod
    def _evaluate(self, Z: np.ndarray) -> tuple[Evaluation, int]:
        """Evaluate full vectors (k, D), k > 0; also returns the inner iterations spent."""

    def evaluate(self, Z: np.ndarray) -> Evaluation:
        """Evaluate full vectors (k, D): their free entries are the candidates, the others what to start from. Each row counts as one."""
        self.before_batch()
        evaluation, iterations = self._evaluate(Z)
        self.counts.evaluations += len(Z)
        self.counts.inner_iterations += iterations
        self.counts.clocked += evaluation.clocked
        self.counts.fallbacks += evaluation.fallbacks
        self.counts.failures.update(status for status in evaluation.status.tolist() if status != CONVERGED)
        return evaluation

    def descend(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray, margins: np.ndarray | None = None) -> Evaluation:
        """Gradient solves, each to the least alpha with F - reference <= alpha weights; they are counted beside evaluations.

        Parameters
        ----------
        starts : array (k, D)
            Full vectors to begin with.
        references, weights : arrays (k, m)
            Weight 0: a hard limit at the reference. Reference +inf: the objective does not matter.
        margins : array (k, r), optional
            By how much, in their scales, the rows of the constraints are to stay inside their limits. Default: not at all.

        Returns
        -------
        Evaluation
            "converged" where a local optimum was found that is feasible. If the work is to end early (`transcription.stopping`), only of
            the first rows, which were solved by then; only these are counted.
        """
        self.before_batch()
        found, iterations = self._descend(starts, references, weights, margins)
        self.counts.add_solves(len(found.F), found.status.tolist(), iterations, found.clocked or len(found.F) < len(starts))
        return found

    def _descend(
        self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray, margins: np.ndarray | None
    ) -> tuple[Evaluation, int]:
        """Solve the rows in order, where there are gradients, until the work is to end; also returns the iterations spent."""
        raise NotImplementedError(f"{type(self).__name__} has no gradients")
