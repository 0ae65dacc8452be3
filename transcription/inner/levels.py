"""The inner levels by name, and those that need no file of their own: the default, several, propagation alone, and none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..base import CONVERGED, INFEASIBLE, NLP
from .base import InnerResult, InnerSolver, scored, started
from .effort import evaluation, propagation
from .ipopt import Ipopt
from .newton import Newton

PATIENCE = 150
"""Most iterations of a projection, and of each further try, for what Newton's method leaves: most that succeed take some tens, and those
that fail take all."""


QUICK, EXACT = 25, 1
"""Steps of Newton's method as a way of its own, and those of them that are found exactly where that takes long: most of what it makes
feasible takes no more."""


@dataclass(frozen=True)
class Projection(InnerSolver):
    """Newton's method over propagated states, which needs one propagation where these are feasible already; a projection by IPOPT for what
    it leaves infeasible."""

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        """See `InnerSolver.solve`."""
        found = Newton().solve(nlp, candidates, warm, tolerance=tolerance)
        rest = np.flatnonzero(found.status != CONVERGED)
        if not len(rest) or found.clocked:
            return found
        start = started(nlp, candidates, warm)
        repaired = Ipopt(max_iterations=PATIENCE).solve(nlp, candidates[rest], start[rest], tolerance=tolerance)
        for name in ("z", "F", "violation", "status", "moved", "residuals"):
            getattr(found, name)[rest] = getattr(repaired, name)
        found.iterations[rest] += repaired.iterations
        return replace(found, clocked=repaired.clocked, fallbacks=len(rest), work=(found.work or 0.0) + int(repaired.iterations.sum()))


@dataclass(frozen=True)
class Auto(Projection):
    """The same for those who do not choose. MACS divides its effort among propagation, some steps of Newton's method, and a projection by
    IPOPT, by what each has brought for its work, see `macs.search.effort`."""

    @property
    def ways(self) -> tuple[InnerSolver, ...]:
        """See `InnerSolver.ways`."""
        return Propagate(), Newton(QUICK, EXACT), Ipopt(max_iterations=PATIENCE)


@dataclass(frozen=True)
class Propagate(InnerSolver):
    """Propagates the states from the free variables and changes nothing else; what constraints are left show in the violation."""

    moves: ClassVar[bool] = False

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        """See `InnerSolver.solve`."""
        start = started(nlp, candidates, warm)
        k = len(start)
        found = scored(nlp, nlp.propagate_and_score(start), start, np.full(k, INFEASIBLE), np.ones(k, dtype=int), tolerance)
        return replace(found, work=k * propagation(nlp))


@dataclass(frozen=True)
class Whole(InnerSolver):
    """No inner level: a candidate is the whole vector of the NLP, states and all, and is scored as it is. The dynamics are constraints like
    others, which the search itself has to satisfy, as population searches on collocation do in the literature."""

    moves: ClassVar[bool] = False

    def program(self, nlp: NLP) -> NLP:
        """See `InnerSolver.program`."""
        return nlp.whole

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        """See `InnerSolver.solve`."""
        start = nlp.tighten(started(nlp, candidates, warm))
        k = len(start)
        found = scored(nlp, (start, *nlp.residuals(start)), start, np.full(k, INFEASIBLE), np.ones(k, dtype=int), tolerance)
        return replace(found, work=k * evaluation(nlp))


NAMED: dict[str, InnerSolver] = {
    "auto": Auto(),
    "projection": Projection(),
    "propagate": Propagate(),
    "none": Whole(),
    "ipopt": Ipopt(),
    "ipopt-feasibility": Ipopt(objective="constant"),
}


def inner_solver(inner: str | InnerSolver) -> InnerSolver:
    """An inner solver by name, or as it is given. Raises ValueError for an unknown name."""
    if isinstance(inner, InnerSolver):
        return inner
    if not isinstance(inner, str) or inner not in NAMED:
        raise ValueError(f"unknown inner level {inner!r}; there are {', '.join(NAMED)}")
    return NAMED[inner]
