"""Propagation: the candidate is scored as it is flown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import NLP
from .base import INFEASIBLE, InnerResult, InnerSolver, scored, started


@dataclass(frozen=True)
class March(InnerSolver):
    """Propagates the states from the free variables and changes nothing else; what constraints are left show in the violation."""

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        """See `InnerSolver.solve`."""
        start = started(nlp, candidates, warm)
        k = len(start)
        return scored(nlp, nlp.fly(start), start, np.full(k, INFEASIBLE), np.ones(k, dtype=int), tolerance)
