"""Small problems whose answers are known."""

import casadi as ca
import numpy as np

from problems import Phase, Problem
from transcription import NLP
from transcription.inner import InnerResult, inner_solver


def candidates(nlp: NLP, k: int = 3, seed: int = 0) -> np.ndarray:
    """Random values (k, d) of the free variables."""
    rng = np.random.default_rng(seed)
    return nlp.lower[nlp.free] + rng.random((k, len(nlp.free))) * nlp.span[nlp.free]


def propagated(nlp: NLP, k: int = 3, seed: int = 0) -> np.ndarray:
    """Propagated vectors (k, n)."""
    return inner_solver("propagate").solve(nlp, candidates(nlp, k, seed)).z


def solved(nlp: NLP, k: int = 3, seed: int = 0, inner: str = "ipopt") -> InnerResult:
    """What an inner solver makes of random candidates."""
    return inner_solver(inner).solve(nlp, candidates(nlp, k, seed))


def slot(nlp: NLP, name: str) -> int:
    """Index of a variable of the NLP."""
    return [v.name for v in nlp.variables].index(name)


def total_derivatives(nlp: NLP, Z: np.ndarray) -> np.ndarray:
    """Those of the reduced problem at vectors (k, n), after a look whether they are those of differences, in spans and scales, and whether
    those of the rows at the ends alone are the same."""
    reduced, every = nlp.reduced, np.eye(len(nlp.variables))
    propagated = reduced.propagate(Z)
    A = reduced.derivatives(propagated, np.arange(len(reduced.scale)))
    for j, variable in enumerate(nlp.free):
        low, high = (reduced.propagate(Z + side * 1e-6 * nlp.span[variable] * every[variable]).values for side in (-1, 1))
        error = np.abs((high - low) / 2e-6 - A[:, :, j] * nlp.span[variable]) / reduced.scale
        assert error.max() < 2e-8, nlp.variables[variable].name
    at_ends = np.flatnonzero(~reduced.inside)
    assert np.allclose(reduced.derivatives(propagated, at_ends), A[:, at_ends], rtol=1e-12, atol=1e-13)
    return A


def oscillator() -> Problem:
    """Non-linear, depends on time, has parameters and two controls; no terminal constraint."""
    problem = Problem("oscillator")
    m = problem.parameter("m", bounds=(0.5, 2))
    phase = problem.phase("swing", t0=(0.0, 0.5), tf=(1.5, 2.0))
    x = phase.state("x", bounds=(-50, 50), initial=(-1, 1))
    y = phase.state("y", bounds=(-50, 50), initial=0.5)
    u, v = phase.control("u", bounds=(-1, 1)), phase.control("v", bounds=(0, 1))
    t = phase.time
    phase.dynamics(x=y + 0.1 * ca.sin(3 * t) * u, y=-m * ca.sin(x) - 0.2 * y * ca.fabs(v) ** 2 + ca.cos(t * phase.tf) * u * v)
    problem.minimize("cost", phase.integral(u**2 + x * y))
    problem.maximize("end", phase.final(x + 0 * u))
    return problem


def oscillator_rates(t: float, x: np.ndarray, u: np.ndarray, m: float, tf: float) -> np.ndarray:
    return np.array([
        x[1] + 0.1 * np.sin(3 * t) * u[0],
        -m * np.sin(x[0]) - 0.2 * x[1] * u[1] ** 2 + np.cos(t * tf) * u[0] * u[1],
    ])  # fmt: skip


def decay(tf: object = (1.0, 2.0), final: object = None) -> tuple[Problem, Phase]:
    """x' = -x, x(0) = 1, no control."""
    problem = Problem("decay")
    phase = problem.phase("fall", t0=0, tf=tf)
    x = phase.state("x", bounds=(-2, 2), initial=1, final=final)
    phase.dynamics(x=-x)
    problem.minimize("rest", phase.final(x))
    return problem, phase


def integrator(name: str = "line", **more: object) -> tuple[Problem, Phase]:
    """x' = u in [-1, 1], from 0, for 2 time units."""
    problem = Problem(name)
    phase = problem.phase("run", **({"t0": 0, "tf": 2.0} | {k: v for k, v in more.items() if k in ("t0", "tf", "duration")}))
    phase.state("x", bounds=(-10, 10), initial=more.get("initial", 0), final=more.get("final"))
    phase.control("u", bounds=more.get("bounds", (-1, 1)), period=more.get("period"))
    phase.dynamics(x=phase["u"])
    return problem, phase
