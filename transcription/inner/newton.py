"""The nearest feasible point in the free variables alone: batched Gauss-Newton steps over propagated states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import NLP
from ..reduced import Flown, Reduced
from .anderson import Anderson
from .base import INFEASIBLE, InnerResult, InnerSolver, result, started
from .least_distance import least_distance

NEAR = 0.1
"""Largest scaled residual of the equations at which inequalities are looked at, and steps remembered: from afar both only stand in the
way."""
STILL = 1e-6
"""Once the next step will be no longer than this, in spans, the point is the nearest one, and only has to be feasible."""
FAR, COARSE = 0.5, 0.03
"""A candidate farther than this from anything feasible says little: there a step of this part of the distance will do."""
PLAIN, MEMORY = 4, 6
"""Iterations before acceleration begins: near the candidate the plain ones converge as fast. Steps that it remembers."""


@dataclass(frozen=True)
class Newton(InnerSolver):
    """The nearest feasible point by Gauss-Newton steps on what propagation leaves to satisfy.

    States are always those that the dynamics give. In spans of the free variables' bounds, each step goes towards the point nearest to the
    candidate that satisfies the linearised constraints and the bounds exactly. The curvature of the constraints, which these steps do not
    know, is made up for by Anderson acceleration. What has become feasible stays so, even if no nearest point is found.

    Parameters
    ----------
    max_iterations : int
    cap : float
        Longest step, in spans.
    """

    max_iterations: int = 30
    cap: float = 0.2

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        """See `InnerSolver.solve`."""
        start = started(nlp, candidates, warm)
        reduced, free, (k, d) = nlp.reduced, nlp.free, candidates.shape
        origin, span, period = nlp.lower[free], nlp.span[free], nlp.period[free]
        walls = np.where(period > 0, np.inf, 0.0)
        center = (start[:, free] - origin) / span
        X, Z, best = center.copy(), start.copy(), np.full(k, np.inf)
        watched = np.tile(reduced.equation, (k, 1))
        memory = Anderson(k, d, MEMORY)
        iterations, settled, last = np.zeros(k, dtype=int), np.zeros(k, dtype=bool), np.zeros(k)
        going = np.arange(k)
        for iteration in range(self.max_iterations):
            trial = start[going]
            trial[:, free] = _values(X[going], origin, span, period)
            flown = reduced.fly(trial)
            iterations[going] += 1
            residual = _residual(reduced, flown)
            worst = residual.max(axis=1, initial=0.0)
            distance = np.linalg.norm(center[going] - X[going], axis=1)
            with np.errstate(invalid="ignore"):
                found = (worst <= 0.1 * tolerance) & (settled[going] | (distance == 0.0))
                merit = np.where(worst <= 0.5 * tolerance, distance, 2.0 * d + worst)
                self._keep(going, flown.Z, np.where(found, -1.0, merit), Z, best)
                on = np.isfinite(worst) & ~found
            if not on.all():
                going, residual, distance = going[on], residual[on], distance[on]
                flown = Flown(flown.Z[on], flown.values[on])
            if not len(going):
                break
            x = X[going]
            near = residual[:, reduced.equation].max(axis=1, initial=0.0) <= NEAR
            watched[going] |= (residual > 0.1 * tolerance) & near[:, None]
            pull = np.where(settled[going, None], 0.0, center[going] - x)
            step = self._capped(_towards(reduced, flown, watched[going], pull, span, (-x - walls, 1.0 - x + walls)))
            length = np.linalg.norm(step, axis=1)
            shrinks = np.minimum(length / np.maximum(last[going], 1e-300), 1.0)
            last[going] = length
            settled[going] |= near & (length * shrinks <= np.where(distance > FAR, COARSE * distance, STILL))
            memory.forget(going[~near])
            accelerated = near & ~settled[going]
            if iteration >= PLAIN and accelerated.any():
                step[accelerated] = self._capped(memory.improve(going[accelerated], x[accelerated], step[accelerated]))
            X[going] = np.clip(x + step, -walls, 1.0 + walls)
        feasible = best <= d  # within the tolerance: what is left of it at bounds of states goes into the dynamics
        Z[feasible] = np.clip(Z[feasible], nlp.lower, nlp.upper)
        return result(nlp, Z, start, np.full(k, INFEASIBLE), iterations, tolerance)

    def _capped(self, step: np.ndarray) -> np.ndarray:
        length = np.linalg.norm(step, axis=1, keepdims=True)
        return step * np.minimum(1.0, self.cap / np.maximum(length, 1e-300))

    @staticmethod
    def _keep(going: np.ndarray, flown: np.ndarray, merit: np.ndarray, Z: np.ndarray, best: np.ndarray) -> None:
        """Keep what was found; else what is nearest to the candidate of what is feasible, else what is least infeasible."""
        better = merit < best[going]
        Z[going[better]], best[going[better]] = flown[better], merit[better]


def _towards(
    reduced: Reduced, flown: Flown, watched: np.ndarray, pull: np.ndarray, span: np.ndarray, box: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Steps (k, d) to the nearest points, seen from `pull`, that satisfy the linearised constraints that are watched (k, rows)."""
    rows = np.asarray(watched.any(axis=0))
    if not rows.any():
        return np.clip(pull, *box)
    scale = reduced.scale[rows]
    A = reduced.derivatives(flown, rows) * span / scale[:, None]
    values, on = flown.values[:, rows], watched[:, rows]
    lower = np.where(on, (reduced.lower[rows] - values) / scale, -np.inf)
    upper = np.where(on, (reduced.upper[rows] - values) / scale, np.inf)
    step, met = least_distance(pull, A, lower, upper, box)
    if not met.all():
        # Far from feasibility they may contradict each other: then inequalities wait until the equations are satisfied.
        again, equations = ~met, reduced.equation[rows]
        lower[:, ~equations], upper[:, ~equations] = -np.inf, np.inf
        step[again] = least_distance(pull[again], A[again], lower[again], upper[again], (box[0][again], box[1][again]))[0]
    return step


def _residual(reduced: Reduced, flown: Flown) -> np.ndarray:
    """Scaled violation (k, rows) of what is left to satisfy; NaN where it is no number."""
    with np.errstate(invalid="ignore"):
        outside = np.maximum(reduced.lower - flown.values, flown.values - reduced.upper) / reduced.scale
        return np.maximum(outside, 0.0)


def _values(X: np.ndarray, origin: np.ndarray, span: np.ndarray, period: np.ndarray) -> np.ndarray:
    """From the unit cube to the user's units: periodic variables wrapped, the others clipped."""
    X = np.where(period > 0, X - np.floor(X), np.clip(X, 0.0, 1.0))
    return np.clip(origin + X * span, origin, origin + span)
