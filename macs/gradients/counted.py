"""Gradient solves of a polish: up to a number, kept in a log, so that a polish that was ended early can be continued."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..evaluation.evaluator import CONVERGED, FAILED, Evaluation, Evaluator
from ..pareto.archive import Archive


@dataclass
class PolishLog:
    """Results of the first k solves of a polish, which can be continued with them."""

    SHAPES: ClassVar[dict[str, str]] = {"Z": "k D", "F": "k m", "violation": "k", "status": "k str"}

    archive: Archive  # the archive before the polish
    Z: np.ndarray  # Z, F, violation, status: (k, D), (k, m), (k,), (k,): Results in the order of the solves; see `Evaluation`
    F: np.ndarray
    violation: np.ndarray
    status: np.ndarray

    @classmethod
    def of(cls, archive: Archive) -> PolishLog:
        """The log of a polish that begins with this archive."""
        return cls(archive, archive.Z[:0], archive.F[:0], archive.violation[:0], np.empty(0, dtype="<U10"))

    def __len__(self) -> int:
        return len(self.F)

    def add(self, found: Evaluation) -> None:
        """Append the results of further solves."""
        self.Z, self.F = np.vstack([self.Z, found.Z]), np.vstack([self.F, found.F])
        self.violation, self.status = np.append(self.violation, found.violation), np.append(self.status, found.status)

    def take(self, rows: slice) -> Evaluation:
        """The results of the solves `rows`."""
        return Evaluation(self.Z[rows], self.F[rows], self.violation[rows], self.status[rows])


class CountedSolves:
    """Gradient solves up to a number. After a request to end early no more are made. in_vain (k, 2 m), in_vain (k, 2 m)."""

    def __init__(self, evaluator: Evaluator, left: int, log: PolishLog | None = None, in_vain: np.ndarray | None = None) -> None:
        self._evaluator, self._log = evaluator, log
        self._made = 0
        self.left, self.stopped, self.in_vain = left, False, in_vain

    def __call__(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray) -> Evaluation:
        """The results of `Evaluator.descend`; rows beyond the number of solves have failed."""
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

    def feasible(self, found: Evaluation) -> np.ndarray:
        """Mask (k,) of the feasible results: those that ran out of iterations may be, too."""
        return (found.status == CONVERGED) | (found.violation <= self._evaluator.tolerance)

    def _solve(self, start: np.ndarray, reference: np.ndarray, weights: np.ndarray) -> Evaluation:
        """The result of the next solve, one row, from the log or made now; no row if asked to end early."""
        made, self._made = self._made, self._made + 1
        if self._log is not None and made < len(self._log):
            return self._log.take(slice(made, made + 1))
        found = self._evaluator.descend(start, reference, weights)
        if self._log is not None:
            self._log.add(found)
        return found
