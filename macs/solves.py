"""The gradient solves of a polish: as many as it has, as long as it may go on; and what they gave, so that it goes on where it was.

What a polish does follows from the archive that it begins with, and from what its solves give, without chance. So these are all there is to
keep of one that is under way: given them once more, in the same order, it comes to the same point in no time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .evaluation.evaluator import FAILED, Evaluation, Evaluator
from .pareto.archive import Archive


@dataclass
class Polishing:
    """A polish that is under way, after k solves.

    Attributes
    ----------
    archive : Archive
        What it began with.
    Z, F, violation, status : arrays (k, D), (k, m), (k,), (k,)
        What the solves gave, in their order; see `Evaluation`.
    """

    archive: Archive
    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray
    status: np.ndarray

    @classmethod
    def of(cls, archive: Archive) -> Polishing:
        """One that begins."""
        return cls(archive, archive.Z[:0], archive.F[:0], archive.violation[:0], np.empty(0, dtype="<U10"))

    def __len__(self) -> int:
        return len(self.F)

    def add(self, found: Evaluation) -> None:
        """Take note of what further solves gave."""
        self.Z, self.F = np.vstack([self.Z, found.Z]), np.vstack([self.F, found.F])
        self.violation, self.status = np.append(self.violation, found.violation), np.append(self.status, found.status)

    def take(self, rows: slice) -> Evaluation:
        """What the solves of `rows` gave."""
        return Evaluation(self.Z[rows], self.F[rows], self.violation[rows], self.status[rows])


class Solves:
    """Gradient solves, as long as there are any left: none are, once the work is to end early.

    Parameters
    ----------
    evaluator : Evaluator
    left : int
    polishing : Polishing, optional
        The solves that it knows are not made again, all others are added to it.

    Attributes
    ----------
    left : int
    stopped : bool
        Whether the work was to end early, with solves left to make.
    """

    def __init__(self, evaluator: Evaluator, left: int, polishing: Polishing | None = None) -> None:
        self._evaluator, self._polishing = evaluator, polishing
        self._made = 0
        self.left, self.stopped = left, False

    def __call__(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray) -> Evaluation:
        """See `Evaluator.refine`; rows for which nothing is left have failed."""
        Z, F = np.array(starts), np.full(references.shape, np.nan)
        violation, status = np.full(len(starts), np.inf), np.full(len(starts), FAILED, dtype="<U10")
        for row in range(max(min(len(starts), self.left), 0)):
            one = slice(row, row + 1)
            found = self._solve(starts[one], references[one], weights[one])
            if not len(found.F):
                self.left, self.stopped = 0, True
                break
            self.left -= 1
            Z[one], F[one], violation[one], status[one] = found.Z, found.F, found.violation, found.status
        return Evaluation(Z, F, violation, status)

    def _solve(self, start: np.ndarray, reference: np.ndarray, weights: np.ndarray) -> Evaluation:
        """The next solve, of one row: made, or remembered; no row if the work is to end early."""
        made, self._made = self._made, self._made + 1
        if self._polishing is not None and made < len(self._polishing):
            return self._polishing.take(slice(made, made + 1))
        found = self._evaluator.refine(start, reference, weights)
        if self._polishing is not None:
            self._polishing.add(found)
        return found
