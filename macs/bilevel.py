"""A problem as something to search: each candidate is made feasible by the inner level before its objectives are looked at."""

from __future__ import annotations

import numpy as np

from transcription.base import NLP
from transcription.inner import InnerSolver

from .evaluation import Counts, Evaluation, Evaluator


class Bilevel(Evaluator):
    """The two-level problem of Ricciardi, Vasile and Maddock (IEEE CEC 2016), eq. (13).

    The full vector is that of the NLP; free are parameters, times, free initial states and controls; the other entries, the states, are
    where the inner solve starts from: those of the point from which a candidate was made.

    Parameters
    ----------
    nlp : NLP
    inner : InnerSolver
    tolerance : float
        Largest scaled residual of a feasible point.
    """

    def __init__(self, nlp: NLP, inner: InnerSolver, tolerance: float) -> None:
        self.nlp, self.inner, self.tolerance = nlp, inner, tolerance
        self.free = nlp.free
        self.lower, self.upper, self.period = nlp.lower[nlp.free], nlp.upper[nlp.free], nlp.period[nlp.free]
        self.counts = Counts()

    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        """See `NLP.first_guess`."""
        return self.nlp.first_guess(candidates)

    def _evaluate(self, Z: np.ndarray) -> tuple[Evaluation, int]:
        found = self.inner.solve(self.nlp, Z[:, self.free], Z, tolerance=self.tolerance)
        evaluation = Evaluation(found.z, found.F, found.violation, found.status, clocked=found.clocked)
        return evaluation, int(np.sum(found.iterations))
