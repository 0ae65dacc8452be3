"""The nearest feasible point in the free variables alone: batched Gauss-Newton steps over propagated states."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base import INFEASIBLE, NLP, TIMEOUT
from ..nlp.derivatives import refuse_dense
from ..phases.reduced import Propagated, Reduced
from ..stopping import stopping
from .base import InnerResult, InnerSolver, newton_work, scored, started
from .least_distance import least_distance

LONGEST_STEP = 0.3
"""Of Newton's method, in spans."""
NEAREST_ITERATIONS = 30
"""Iterations after which a point only has to be feasible, be it the nearest one or not."""


@dataclass(frozen=True)
class Newton(InnerSolver):
    """The nearest feasible point by Gauss-Newton steps on what propagation leaves to satisfy.

    States are always those that the dynamics give. In spans of the free variables' bounds, each step goes towards the point nearest to the
    candidate that satisfies the linearised constraints and the bounds exactly. The curvature of the constraints, which these steps do not
    know, is made up for by Anderson acceleration. What has become feasible stays so, even if no nearest point is found.
    """

    max_iterations: int = 40
    # How many steps of a candidate are found exactly, by non-negative least squares, where the faster method does not end. They may take
    # many times as long as all else; with few of them, fewer candidates become feasible.
    exact: int = 1000

    def solve(self, nlp: NLP, candidates: np.ndarray, warm: np.ndarray | None = None, *, tolerance: float = 1e-6) -> InnerResult:
        """If the work is to end early (`stopping`), what was not done with by then has the status "timeout"."""
        start = started(nlp, candidates, warm)
        Z, best, iterations = start.copy(), np.full(len(start), np.inf), np.zeros(len(start), dtype=int)
        otherwise = np.full(len(start), INFEASIBLE)
        going = _Going(nlp, start, self.exact)
        # Overflow shows in the results; warnings would add nothing.
        with np.errstate(invalid="ignore", over="ignore"):
            for iteration in range(self.max_iterations):
                propagated = nlp.reduced.propagate(going.vectors())
                outside = _outside(nlp.reduced, propagated)
                worst, pull = outside.max(axis=1, initial=0.0), going.center - going.x
                distance = _norm(pull)
                found = (worst <= 0.1 * tolerance) & (going.settled | (distance == 0.0))
                # Keep what was found; else what is nearest to the candidate of what is feasible, else what is least infeasible.
                merit = np.where(found, -1.0, np.where(worst <= 0.5 * tolerance, distance, 2.0 * len(nlp.free) + worst))
                better = np.flatnonzero(merit < best[going.index])
                Z[going.index[better]], best[going.index[better]] = propagated.Z[better], merit[better]
                iterations[going.index] = iteration + 1
                on = np.flatnonzero((worst < np.inf) & ~found)
                if len(on) < len(found):
                    if not len(on):
                        break
                    going.keep(on)
                    propagated, outside, pull = Propagated(propagated.Z[on], propagated.values[on]), outside[on], pull[on]
                if stopping():
                    otherwise[going.index] = TIMEOUT
                    break
                self._advance(going, iteration, propagated, outside, pull, tolerance)
        feasible = best <= len(nlp.free)  # within the tolerance: what is left of it at bounds of states goes into the dynamics
        Z[feasible] = np.clip(Z[feasible], nlp.lower, nlp.upper)
        found = scored(nlp, (Z, *nlp.residuals(Z)), start, otherwise, iterations, tolerance)
        return replace(found, work=int(iterations.sum()) * newton_work(nlp))

    def _advance(
        self, going: _Going, iteration: int, propagated: Propagated, outside: np.ndarray, pull: np.ndarray, tolerance: float
    ) -> None:
        """One step of those that go on, from their propagated vectors."""
        # From afar, inequalities and remembered steps only do harm.
        near = outside.take(going.equations, axis=1).max(axis=1, initial=0.0) <= 0.1
        going.watched |= (outside > 0.1 * tolerance) & near[:, None]
        if going.settled.any():
            pull = np.where(going.settled[:, None], 0.0, pull)
        step = going.towards(propagated, pull)
        length = _norm(step)
        if length.max() > LONGEST_STEP:
            far = np.flatnonzero(length > LONGEST_STEP)
            step[far] *= LONGEST_STEP / length[far, None]
            going.multipliers[far] = 0.0  # the next step is of another kind: these would lead it astray
            length = np.minimum(length, LONGEST_STEP)
        # The next step, if it shrinks as this one did; where it is next to none, the point is the nearest one.
        left = length * np.minimum(length / np.maximum(going.last, 1e-300), 1.0)
        going.last = length
        settles = near & ~going.settled & ((left <= 1e-6) | (iteration >= NEAREST_ITERATIONS))
        if settles.any():
            going.settled |= settles
            going.multipliers[settles] = 0.0
        accelerated = near & ~going.settled
        if iteration >= 2 and accelerated.any():
            improved = going.memory.improve(going.x, step, accelerated)
            improved *= np.minimum(1.0, LONGEST_STEP / np.maximum(_norm(improved), 1e-300))[:, None]
            step = np.where(accelerated[:, None], improved, step)
        going.x = np.minimum(np.maximum(going.x + step, -going.walls), 1.0 + going.walls)


class _Going:
    """The candidates of a batch that are not done, in the unit cube: x, center (k, d), watched, multipliers (k, rows), others (k,)."""

    def __init__(self, nlp: NLP, start: np.ndarray, exact: int) -> None:
        refuse_dense(nlp)
        (k, _), free, self.reduced = start.shape, nlp.free, nlp.reduced
        self.exact = np.full(k, exact)
        self.free, self.equations = free, np.flatnonzero(nlp.reduced.equation)
        self.origin, self.span, self.period = nlp.lower[free], nlp.span[free], nlp.period[free]
        self.top, self.periodic = self.origin + self.span, bool(self.period.any())
        self.moving = np.where(np.isin(free, nlp.integers), 0.0, self.span)  # whole numbers stay as they are
        self.walls = np.where(self.period > 0, np.inf, 0.0)
        self.index, self._vectors = np.arange(k), start.copy()
        self.x = self.center = (start[:, free] - self.origin) / self.span
        self.watched, self.multipliers = np.tile(self.reduced.equation, (k, 1)), np.zeros((k, len(self.reduced.equation)))
        self.settled, self.last = np.zeros(k, dtype=bool), np.zeros(k)
        self.memory = Anderson(k, len(free), memory=6)

    def keep(self, on: np.ndarray) -> None:
        """Go on with some of them only."""
        for name in ("index", "_vectors", "x", "center", "watched", "multipliers", "settled", "last", "exact"):
            setattr(self, name, getattr(self, name)[on])
        self.memory.keep(on)

    def vectors(self) -> np.ndarray:
        """Vectors (k, n) of the NLP with the free variables where they are: periodic ones wrapped, the others within bounds."""
        x = np.where(self.period > 0, self.x - np.floor(self.x), self.x) if self.periodic else self.x
        self._vectors[:, self.free] = np.minimum(np.maximum(self.origin + x * self.span, self.origin), self.top)
        return self._vectors

    def towards(self, propagated: Propagated, pull: np.ndarray) -> np.ndarray:
        """Steps (k, d) to the nearest points, seen from `pull`, that satisfy the linearised constraints that are watched."""
        inside = (self.watched & self.reduced.inside).any(axis=1)
        if inside.all() or not inside.any():
            return self._towards(slice(None), propagated, pull)
        step = np.empty_like(pull)
        for some in np.flatnonzero(inside), np.flatnonzero(~inside):  # apart: the derivatives of the first are costly
            step[some] = self._towards(some, Propagated(propagated.Z[some], propagated.values[some]), pull[some])
        return step

    def _towards(self, some: slice | np.ndarray, propagated: Propagated, pull: np.ndarray) -> np.ndarray:
        """The same for some of them, whose vectors and pull are given."""
        reduced, watched = self.reduced, self.watched[some]
        rows = np.flatnonzero(watched.any(axis=0))
        box = -self.x[some] - self.walls, 1.0 - self.x[some] + self.walls
        scale, equation = reduced.scale[rows], reduced.equation[rows]
        A = reduced.derivatives(propagated, rows) * (self.moving / scale[:, None])
        values = propagated.values[:, rows]
        lower, upper = (reduced.lower[rows] - values) / scale, (reduced.upper[rows] - values) / scale
        multipliers = self.multipliers[some][:, rows]
        if not equation.all():
            on = watched[:, rows]
            lower, upper, multipliers = np.where(on, lower, -np.inf), np.where(on, upper, np.inf), np.where(on, multipliers, 0.0)
        exact = self.exact[some]
        step, met, multipliers = least_distance(pull, A, lower, upper, box, multipliers, exact)
        if not met.all():
            # Far from feasibility they may contradict each other: then inequalities wait until the equations are satisfied.
            again = ~met
            lower[:, ~equation], upper[:, ~equation], multipliers[again] = -np.inf, np.inf, 0.0
            there = box[0][again], box[1][again]
            left = exact[again]
            step[again] = least_distance(pull[again], A[again], lower[again], upper[again], there, multipliers[again], left)[0]
            exact[again] = left
        self.exact[some] = exact
        self.multipliers[slice(None) if isinstance(some, slice) else some[:, None], rows] = multipliers
        return step


def _norm(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("kd,kd->k", vectors, vectors))


def _outside(reduced: Reduced, propagated: Propagated) -> np.ndarray:
    """Scaled distance (k, rows) from the limits of what is left to satisfy, negative inside; NaN where it is no number."""
    return np.maximum(reduced.lower - propagated.values, propagated.values - reduced.upper) / reduced.scale


class Anderson:
    """Remembers the last steps of k iterations x -> x + s(x) and combines them so that the linear part of s vanishes soonest.

    Anderson, "Iterative procedures for nonlinear integral equations", 1965; in the form of Walker and Ni, 2011.
    """

    def __init__(self, k: int, d: int, memory: int) -> None:
        self._dx, self._ds = np.zeros((k, memory, d)), np.zeros((k, memory, d))
        self._x, self._s = np.zeros((k, d)), np.zeros((k, d))
        self._known = np.zeros((k, 1), dtype=bool)
        self._slot = 0

    def keep(self, rows: np.ndarray) -> None:
        """Go on with some of the iterations only."""
        for name in ("_dx", "_ds", "_x", "_s", "_known"):
            setattr(self, name, getattr(self, name)[rows])

    def improve(self, x: np.ndarray, s: np.ndarray, good: np.ndarray) -> np.ndarray:
        """Better steps (k, d) than s, at x; iterations whose steps are not `good` (k,) begin anew."""
        if not good.all():
            self._dx[~good], self._ds[~good], self._known[~good] = 0.0, 0.0, False
        dx, ds, slot = self._dx, self._ds, self._slot
        dx[:, slot], ds[:, slot] = (x - self._x) * self._known, (s - self._s) * self._known
        self._x, self._s, self._slot = x, s, (slot + 1) % dx.shape[1]
        self._known[good] = True
        gram = ds @ ds.transpose(0, 2, 1)
        diagonal = np.einsum("kii->ki", gram)
        diagonal += 1e-10 * diagonal.max(axis=1, keepdims=True) + 1e-300
        share = np.linalg.solve(gram, ds @ s[:, :, None])
        return s - ((dx + ds).transpose(0, 2, 1) @ share)[:, :, 0]
