"""The contract between the search and what it searches: candidates go in, evaluated points come out, everything is counted.

The search knows full vectors. Of their D entries it alters only the *free* ones (d of them); the others are the memory of a point, which
the evaluator needs again: for a trajectory, the states from which the next inner solve starts. A black box has no others.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

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
        Whether a clock ended any of the work: then the same vectors need not give the same batch again.
    fallbacks : int
        How many vectors a faster method left to a slower one.
    itemise : callable, optional
        Returns what `violations` are, for those who ask: most do not, and then nothing has been spent on it.
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
        """Of each constraint its own largest scaled residual (k, c), at least 0; they are one (k, 1) where nobody tells them apart."""
        return self.violation[:, None] if self.itemise is None else self.itemise()


@dataclass
class Counts:
    """What a run has spent so far: `failures` are the statuses that are not "converged", `clocked` the batches that a clock cut short."""

    evaluations: int = 0
    inner_iterations: int = 0
    gradient_solves: int = 0
    fallbacks: int = 0
    failures: Counter[str] = field(default_factory=Counter)
    clocked: int = 0


class Evaluator(ABC):
    """Something whose points can be evaluated.

    An implementation sets the attributes below and defines `first_guess` and `_evaluate`; it never counts.

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
        Whether `refine` works.
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
    before_batch: Callable[[], None] = staticmethod(lambda: None)

    def resume(self, counts: Counts, m: int) -> None:
        """Go on counting where another run of the same had got to, which knew the number of objectives to be m."""
        self.counts = counts

    def opening(self, candidates: np.ndarray) -> np.ndarray:
        """What a search is to begin with (k, d), from candidates (k, d) that were drawn from the box, each variable by itself.

        The same, unless something is known of how candidates should look.
        """
        return candidates

    @abstractmethod
    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        """Full vectors (k, D) for candidates (k, d) that nothing is known of yet."""

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

    def refine(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray, margins: np.ndarray | None = None) -> Evaluation:
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
        found, iterations = self._refine(starts, references, weights, margins)
        self.counts.gradient_solves += len(found.F)
        self.counts.inner_iterations += iterations
        self.counts.clocked += found.clocked or len(found.F) < len(starts)
        return found

    def _refine(
        self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray, margins: np.ndarray | None
    ) -> tuple[Evaluation, int]:
        """Solve, if there are gradients, as many of the rows, in order, as may be; also returns the iterations spent."""
        raise NotImplementedError(f"{type(self).__name__} has no gradients")
