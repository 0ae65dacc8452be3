"""One point of a front, solved anew where the mesh is another: held at its place along the front."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from transcription.base import NLP
from transcription.inner import Ipopt
from transcription.nlp.scalarized import Solved, scalarize

from .evaluation.evaluator import CONVERGED

DRIFT = 1e-3
"""A point that gets worse by more than this, in ranges of the front, may have lost its way: other starts are tried too."""
CAP = 1e-9
"""How much of its range the objective that an end is best in may be given up for the other ones."""


@dataclass(frozen=True, eq=False)
class Resolved:
    """What came of it: a vector of `nlp`, its objectives (m,), its status, and whether it is an optimum or only feasible."""

    nlp: NLP
    z: np.ndarray
    F: np.ndarray
    status: str
    by_gradients: bool


class Resolver:
    """Solves points anew, and counts.

    Parameters
    ----------
    ranges : array (m,)
        Of the objectives on the front.
    F : array (n, m)
        The front's objectives, all minimised.
    tolerance : float
        Largest scaled residual of a feasible point.
    """

    def __init__(self, ranges: np.ndarray, F: np.ndarray, tolerance: float) -> None:
        self.ranges, self.F, self.tolerance = ranges, F, tolerance
        self.gradient_solves = self.inner_iterations = 0
        self.clocked = False

    def solve(self, nlp: NLP, position: np.ndarray, end: int | None, starts: Iterable[np.ndarray]) -> Resolved:
        """The point of this mesh's front that is met from `position` along the front's ranges (Pascoletti and Serafini).

        Where a mesh promised more than can be flown, the point gets worse; so there is no limit at its old objectives.

        Parameters
        ----------
        nlp : NLP
        position : array (m,)
            Objectives of the point on the first mesh.
        end : int, optional
            The objective of which this is the front's best point: then that is minimised, and after it the others.
        starts : vectors (n,)
            The first is the point itself; the others are tried where it fails, or loses its way.

        Returns
        -------
        Resolved
            Where objectives have no derivatives (a peak that is maximised) and where the gradient solves fail: the feasible point nearest
            to the first start.
        """
        found: list[Solved] = []
        first = None
        try:
            for start in starts:
                first = start if first is None else first
                found.append(self._scalarized(nlp, position, end, start))
                if found[-1].status == CONVERGED and self._worse(found[-1], position, end) <= DRIFT:
                    break
        except ValueError:
            # A use of peaks that gradient tools refuse.
            pass
        good = [solved for solved in found if solved.status == CONVERGED]
        if good:
            best = min(good, key=lambda solved: self._worse(solved, position, end))
            return Resolved(nlp, best.z, best.F, best.status, True)
        assert first is not None
        near = Ipopt().solve(nlp, first[None, nlp.free], first[None], tolerance=self.tolerance)
        self.inner_iterations += int(near.iterations.sum())
        self.clocked |= near.clocked
        return Resolved(nlp, near.z[0], near.F[0], str(near.status[0]), False)

    def _worse(self, solved: Solved, position: np.ndarray, end: int | None) -> float:
        """By how much, in ranges, it is worse than where it began."""
        change = (solved.F - position) / self.ranges
        return float(change.max() if end is None else change[end])

    def _scalarized(self, nlp: NLP, position: np.ndarray, end: int | None, start: np.ndarray) -> Solved:
        if end is not None:
            solved = self._lexicographic(nlp, position, end, start)
            others = np.linalg.norm((self.F - position) / self.ranges, axis=1)
            nearest = others[others > 0].min(initial=np.inf)
            # What moves further than half the way to the next point was not an end of the front, only of the part of it that is here.
            if solved.status != CONVERGED or np.linalg.norm((solved.F - position) / self.ranges) <= 0.5 * nearest:
                return solved
        return self._count(scalarize(nlp, start, reference=position, weights=self.ranges, tolerance=self.tolerance))

    def _lexicographic(self, nlp: NLP, position: np.ndarray, end: int, start: np.ndarray) -> Solved:
        """The best value of one objective, and with that, the best of the others."""
        mine = np.arange(len(position)) == end
        alone = np.where(mine, position, np.inf)
        first = self._count(scalarize(nlp, start, reference=alone, weights=self.ranges, tolerance=self.tolerance))
        if first.status != CONVERGED or len(position) == 1:
            return first
        ceiling = np.where(mine, first.F + CAP * self.ranges, np.inf)
        others = np.where(mine, np.inf, first.F)
        second = self._count(scalarize(nlp, first.z, reference=others, weights=self.ranges, ceiling=ceiling, tolerance=self.tolerance))
        return second if second.status == CONVERGED else first

    def _count(self, solved: Solved) -> Solved:
        self.gradient_solves += solved.begun
        self.clocked |= solved.clocked
        return solved
