"""Problems with several objectives whose fronts are known in closed form."""

import casadi as ca
import numpy as np

from problems import Problem
from transcription import DFET, NLP


def still(name: str) -> Problem:
    """A problem whose trajectory does not matter: what there is to decide are the parameters that the caller adds."""
    problem = Problem(name)
    phase = problem.phase("wait", t0=0, tf=1)
    phase.state("x", bounds=(-1, 1), initial=0)
    phase.dynamics(x=0)
    return problem


def two_wells(q: tuple[float, float] = (-2.0, 2.0)) -> Problem:
    """Squared distances from (0, 0) and (1, 0): Pareto-optimal is 0 <= p <= 1 with q as near to 0 as its bounds let it."""
    problem = still("two wells")
    p, q_ = problem.parameter("p", bounds=(-2, 2)), problem.parameter("q", bounds=q)
    problem.minimize("from left", p**2 + q_**2)
    problem.minimize("from right", (p - 1) ** 2 + q_**2)
    return problem


def corners(m: int = 3) -> Problem:
    """Squared distances from the unit vectors: Pareto-optimal is the simplex between them."""
    problem = still("corners")
    p = ca.vertcat(*(problem.parameter(f"p{i}", bounds=(-1, 2)) for i in range(m)))
    for i in range(m):
        problem.minimize(f"from {i}", ca.sumsqr(p - np.eye(m)[i]))
    return problem


def slide(limit: float | None = None) -> Problem:
    """x' = u from 0 in 2 time units: to be near 1 at the end, with little effort. Optimal is a constant u = c from 0 to 0.5.

    With a `limit`, x may not exceed it; its own objective then is to be near 1 all along.
    """
    problem = Problem("slide")
    run = problem.phase("run", t0=0, tf=2)
    x = run.state("x", bounds=(-3, 3), initial=0)
    u = run.control("u", bounds=(-2, 2))
    run.dynamics(x=u)
    problem.minimize("effort", run.integral(u**2))
    if limit is None:
        problem.minimize("miss", (run.final(x) - 1) ** 2)
    else:
        run.path("wall", x, upper=limit)
        problem.minimize("miss", run.integral((x - 1) ** 2))
    return problem


def time_against_effort() -> Problem:
    """From rest to rest over a distance of 1 in a time T: the least effort is 12 / T^3."""
    problem = Problem("cart")
    move = problem.phase("move", t0=0.0, tf=(1.0, 2.0))
    move.state("x", bounds=(-1, 2), initial=0, final=1)
    v = move.state("v", bounds=(-5, 5), initial=0, final=0)
    u = move.control("u", bounds=(-20, 20))
    move.dynamics(x=v, v=u)
    problem.minimize("time", move.tf)
    problem.minimize("effort", move.integral(u**2))
    return problem


def shuttle(tf: object = (1.0, 3.0)) -> Problem:
    """From rest to rest over a distance of 1: least time against least largest thrust, which is 4/tf^2 (bang-bang)."""
    problem = Problem("shuttle")
    trip = problem.phase("trip", t0=0, tf=tf)
    x = trip.state("x", bounds=(-2, 2), initial=0, final=1)
    v = trip.state("v", bounds=(-5, 5), initial=0, final=0)
    u = trip.control("u", bounds=(-8, 8))
    trip.dynamics(x=v, v=u + 0 * x)
    problem.minimize("time", trip.tf)
    problem.minimize("largest thrust squared", trip.peak(u**2))
    return problem


def compass() -> Problem:
    """A course u, periodic, from the origin at unit speed: as far west as possible, which is the end of the box of u; and north."""
    problem = Problem("compass")
    walk = problem.phase("walk", t0=0, tf=2)
    x, y = walk.state("x", bounds=(-5, 5), initial=0), walk.state("y", bounds=(-5, 5), initial=0)
    u = walk.control("u", bounds=(-ca.pi, ca.pi), period=2 * ca.pi)
    walk.dynamics(x=ca.cos(u), y=ca.sin(u))
    problem.minimize("x", walk.final(x))
    problem.minimize("y", walk.final(y))
    return problem


def with_peak(use: str) -> Problem:
    problem = shuttle()
    phase = problem.phases["trip"]
    peak, low = phase.peak(phase["v"]), -phase.peak(-phase["v"])
    if use == "maximised":
        problem.maximize("speed", peak)
    elif use == "minimum minimised":
        problem.minimize("least speed", low)
    elif use == "bounded below":
        problem.constraint("fast enough", peak**3, lower=0.1)
    elif use == "equal":
        problem.constraint("just so", peak, lower=1, upper=1)
    elif use == "minimum maximised":
        problem.maximize("least speed", low + phase.tf)
    elif use == "minimum bounded below":
        problem.constraint("not too slow", low, lower=-4)
    elif use == "convex and rising":
        problem.minimize("speed", ca.exp(peak) + peak**3)
    return problem


def nlp_of(problem: Problem, mesh: DFET | None = None) -> NLP:
    """The NLP on a mesh of four elements of order 2."""
    return (mesh or DFET(4, 2)).transcribe(problem)


def vector(nlp: NLP, **values: float) -> np.ndarray:
    """A vector (n,) of parameters or constant controls by name, with the states that they fly; others are at their lower bounds."""
    z = np.where(np.isfinite(nlp.span), nlp.lower, 0.0)
    for i, v in enumerate(nlp.variables):
        name = v.name.rpartition(".")[2].partition("[")[0]
        z[i] = values.get(name, z[i])
    return nlp.propagate(z[None])[0]


def bryson_denham() -> Problem:
    """Effort against the height of a ceiling: Bryson and Denham, on a path from side to side."""
    problem = Problem("Bryson and Denham")
    phase = problem.phase("flight", t0=0.0, tf=1.0)
    x, v = phase.state("x", bounds=(-0.5, 0.5), initial=0.0, final=0.0), phase.state("v", bounds=(-2.0, 2.0), initial=1.0, final=-1.0)
    u = phase.control("u", bounds=(-30.0, 30.0))
    limit = problem.parameter("limit", bounds=(0.04, 1 / 6))
    phase.dynamics(x=v, v=u)
    phase.path("height", x - limit, upper=0.0)
    problem.minimize("effort", phase.integral(u**2 / 2))
    problem.minimize("highest", limit)
    return problem
