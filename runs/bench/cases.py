"""Cases of the benchmark of inner levels: the published ones, and two that are hard for the fast path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import casadi as ca
import numpy as np

from problems import Problem, load
from transcription import DFET, NLP
from transcription.base import CONVERGED
from transcription.inner import Projection

BATCH = 10
"""Candidates in a batch, as the search sends them: one for each agent."""
NEAR = 0.05
"""Standard deviation of a warm candidate from the feasible point that it was made of, in spans of its bounds."""


Batch = tuple[np.ndarray, np.ndarray | None]
"""Candidates (BATCH, d), and the vectors (BATCH, n) that they start from if they are warm."""


@dataclass(frozen=True)
class Case:
    """Batches of candidates on one mesh."""

    name: str
    make: Callable[[], Problem]  # () -> Problem
    mesh: DFET
    warm: bool = False  # candidates near feasible points, starting from their states; else uniformly random ones, from a first guess
    tolerance: float = 1e-6
    # Every candidate is feasible when it is propagated, within the bounds of states: propagation alone is an inner level here.
    propagates: bool = False
    quick: bool = True  # also part of the quick benchmark
    asked: Mapping[str, float] = field(default_factory=dict)  # target of "auto": "speed" at least, "moved" at most

    def batch(self, nlp: NLP, rng: np.random.Generator) -> Batch:
        """A batch of candidates of the case, with a warm start if it has one."""
        lower, upper, span = nlp.lower[nlp.free], nlp.upper[nlp.free], nlp.span[nlp.free]
        cold = lower + rng.random((BATCH, len(span))) * span
        if not self.warm:
            return cold, None
        found = Projection().solve(nlp, cold, tolerance=self.tolerance)
        feasible = found.z[found.status == CONVERGED]
        if not len(feasible):
            raise RuntimeError(f"{self.name}: no feasible point to begin with")
        known = feasible[np.arange(BATCH) % len(feasible)]
        return np.clip(known[:, nlp.free] + NEAR * span * rng.standard_normal(cold.shape), lower, upper), known


def corridor() -> Problem:
    """Following a bend at speeds to be chosen, between walls so near that one or the other is in the way all along."""
    problem = Problem("corridor")
    walk = problem.phase("walk", t0=0.0, tf=(2.0, 4.0))
    x, y = walk.state("x", bounds=(-1, 9), initial=0), walk.state("y", bounds=(-3, 3), initial=0)
    u, v = walk.control("u", bounds=(0.5, 2.0)), walk.control("v", bounds=(-2.0, 2.0))
    walk.dynamics(x=u, y=v)
    walk.path("walls", y - 0.5 * ca.sin(x), lower=-0.05, upper=0.05)
    problem.minimize("effort", walk.integral(u**2 + v**2))
    problem.maximize("distance", walk.final(x))
    return problem


def needle() -> Problem:
    """Balancing for thirty-two time constants: no propagation reaches the end, whatever the control."""
    problem = Problem("needle")
    hold = problem.phase("hold", t0=0.0, tf=(7.0, 8.0))
    x = hold.state("x", bounds=(-2, 2), initial=0.5, final=0.0)
    u = hold.control("u", bounds=(-10, 10))
    hold.dynamics(x=4 * x + u)
    problem.minimize("effort", hold.integral(u**2))
    problem.minimize("time", hold.tf)
    return problem


GODDARD, ORBIT = partial(load, "goddard"), partial(load, "orbit_rise")
COARSE, FINE = DFET(4, 6), DFET(30, 1)

INNER = (
    Case("goddard, cold", GODDARD, COARSE, asked={"speed": 5}),
    Case("goddard, warm", GODDARD, COARSE, warm=True, asked={"speed": 15, "moved": 0.07}),
    Case("orbit_rise, cold", ORBIT, FINE, propagates=True, quick=False, asked={"speed": 100}),
    Case("orbit_rise, warm", ORBIT, FINE, warm=True, propagates=True, quick=False, asked={"speed": 100}),
    Case("orbit_rise, cold, 1e-9", ORBIT, FINE, tolerance=1e-9, propagates=True, asked={"speed": 100}),
    Case("orbit_rise, warm, 1e-9", ORBIT, FINE, warm=True, tolerance=1e-9, propagates=True, asked={"speed": 100}),
    Case("corridor, cold", corridor, DFET(4, 2), quick=False),
    Case("corridor, warm", corridor, DFET(4, 2), warm=True, quick=False),
    Case("needle, cold", needle, DFET(8, 3)),
    Case("needle, warm", needle, DFET(8, 3), warm=True, quick=False),
)
