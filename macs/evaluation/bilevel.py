"""Evaluator of an optimal control problem: the inner level makes each candidate feasible before its objectives are evaluated."""

from __future__ import annotations

from itertools import takewhile
from typing import Any

import numpy as np

from problems.compiled import Objective
from problems.sampling import refuse_peaks
from transcription.base import NLP
from transcription.inner import InnerSolver
from transcription.inner.base import batch_charge, solves_charge, spent
from transcription.nlp.derivatives import refuse_dense
from transcription.nlp.scalarized import Solved, scalarize
from transcription.smooth import Smooth

from ..io.workers import each
from .evaluator import Counts, Evaluation, Evaluator, masks

SOLVE_ITERATIONS = 100
"""Iterations after which a gradient solve is given up. Most need some tens; the time of a long one is better spent on others. Where all are
long, it may take three times the mean of those that converged, up to five times these."""


def _descended(
    nlp: NLP, start: np.ndarray, reference: np.ndarray, weights: np.ndarray, margin: np.ndarray | None, tolerance: float, most: int
) -> Solved:
    """The result of one gradient solve."""
    limit = most if margin is None else 2 * most
    settings: dict[str, Any] = {"tolerance": tolerance, "max_iterations": limit, "persistent": False}
    return scalarize(nlp, start, reference=reference, weights=weights, margin=margin, **settings)


class Bilevel(Evaluator):
    """The two-level problem of Ricciardi, Vasile and Maddock (IEEE CEC 2016), eq. (13).

    The full vector is that of the NLP. Free are the parameters, times, free initial states and controls. The other entries are the states,
    from which the inner solve starts: those of the point that the candidate was made from.
    """

    def __init__(self, nlp: NLP, inner: InnerSolver, tolerance: float, start: Smooth | None = None) -> None:
        self.nlp, self.inner, self.tolerance, self.start = nlp, inner, tolerance, start
        self.free = nlp.free
        self.lower, self.upper, self.period = nlp.lower[nlp.free], nlp.upper[nlp.free], nlp.period[nlp.free]
        self.kinds = masks([nlp.variables[i] for i in nlp.free])
        self.m_known = len(nlp.problem.goals)
        self.moves = inner.moves
        self.ways = tuple(type(one).__name__.lower() for one in inner.ways)
        self.counts = Counts()
        try:
            refuse_peaks(nlp.problem)
            refuse_dense(nlp)
            self.has_gradients = True
        except ValueError:  # for example a peak that is maximised, or too many derivatives: the search uses none
            self.has_gradients = False

    @property
    def sizes(self) -> dict[str, int]:
        """See `Evaluator.sizes`."""
        return super().sizes | {"D": len(self.nlp.lower)}

    @property
    def goals(self) -> tuple[Objective, ...]:
        """See `Evaluator.goals`."""
        return self.nlp.problem.goals

    def opening(self, candidates: np.ndarray) -> np.ndarray:
        """See `Evaluator.opening`."""
        return candidates if self.start is None else self.start.shaped(self.nlp, candidates)

    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        """See `NLP.first_guess`."""
        return self.nlp.first_guess(candidates)

    def _evaluate(self, Z: np.ndarray, way: int | None = None) -> tuple[Evaluation, int]:
        inner = self.inner if way is None else self.inner.ways[way]
        before = spent(self.nlp)
        found = inner.solve(self.nlp, Z[:, self.free], Z, tolerance=self.tolerance)
        charge = spent(self.nlp) - before + batch_charge(self.nlp, len(Z))

        def itemise() -> np.ndarray:
            return self.nlp.by_constraint(self.nlp.residuals(found.z)[1] if found.residuals is None else found.residuals)

        iterations = int(np.sum(found.iterations))
        evaluation = Evaluation(
            found.z,
            found.F,
            found.violation,
            found.status,
            clocked=found.clocked,
            fallbacks=found.fallbacks,
            work=round((iterations if found.work is None else found.work) * Z.shape[1]),
            charge=charge,
            itemise=itemise,
        )
        return evaluation, iterations

    def _descend(
        self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray, margins: np.ndarray | None
    ) -> tuple[Evaluation, int]:
        inside = [None] * len(starts) if margins is None else margins
        mean = self.counts.solved_iterations / max(self.counts.solved, 1)
        most = int(np.clip(3 * mean, SOLVE_ITERATIONS, 5 * SOLVE_ITERATIONS))
        pieces = [(*piece, self.tolerance, most) for piece in zip(starts, references, weights, inside, strict=True)]
        found = [*takewhile(lambda solved: solved.begun, each(_descended, self.nlp, pieces))]
        evaluation = Evaluation(
            Z=np.array([solved.z for solved in found]).reshape(-1, starts.shape[1]),
            F=np.array([solved.F for solved in found]).reshape(-1, references.shape[1]),
            violation=np.array([solved.violation for solved in found]),
            status=np.array([solved.status for solved in found], dtype="<U10"),
            clocked=any(solved.clocked for solved in found),
            charge=solves_charge(self.nlp, len(found), sum(solved.iterations for solved in found)),
        )
        return evaluation, sum(solved.iterations for solved in found)
