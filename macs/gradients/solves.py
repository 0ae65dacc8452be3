"""Gradient solves of scalarised problems, each counted."""

from __future__ import annotations

import numpy as np

from transcription.base import NLP
from transcription.nlp.scalarized import Solved, scalarize

from ..evaluation.evaluator import Counts


class GradientSolves:
    """Gradient solves with one tolerance, which are counted.

    Parameters
    ----------
    tolerance : float
        Largest scaled residual of a feasible point.

    Attributes
    ----------
    counts : Counts
        Gradient solves, iterations, failures by status.
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self.counts = Counts()

    def __call__(
        self, nlp: NLP, start: np.ndarray, reference: np.ndarray, weights: np.ndarray, ceiling: np.ndarray | None = None
    ) -> Solved:
        """The result of one solve from a vector (n,); see `scalarize` for reference, weights and ceiling (m,)."""
        solved = scalarize(nlp, start, reference=reference, weights=weights, ceiling=ceiling, tolerance=self.tolerance)
        self.counts.add_solves(int(solved.begun), [solved.status], solved.iterations, solved.clocked)
        return solved
