"""The default inner level: the fastest that is exact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import NLP
from .base import CONVERGED, InnerResult, InnerSolver, started
from .ipopt import Ipopt
from .march import March


@dataclass(frozen=True)
class Auto(InnerSolver):
    """Propagation where nothing but bounds of states can be violated, with a projection for what leaves those; a projection elsewhere."""

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        """See `InnerSolver.solve`."""
        projection = Ipopt()
        if not nlp.marches_exactly:
            return projection.solve(nlp, candidates, warm, tolerance=tolerance)
        flown = March().solve(nlp, candidates, warm, tolerance=tolerance)
        rest = np.flatnonzero(flown.status != CONVERGED)
        if not len(rest):
            return flown
        start = started(nlp, candidates, warm)
        repaired = projection.solve(nlp, candidates[rest], start[rest], tolerance=tolerance)
        parts = {name: getattr(flown, name).copy() for name in ("z", "F", "violation", "status", "moved", "iterations")}
        for name, values in parts.items():
            values[rest] = getattr(repaired, name)
        parts["iterations"][rest] += 1
        return InnerResult(**parts, clocked=repaired.clocked)
