"""Problems as users stated them when they asked for help: each stands for a kind that this program once solved wrongly.

Their optima are closed forms, or were found by shooting from the structure that is known.
"""

from __future__ import annotations

from itertools import pairwise
from math import sqrt

import casadi as ca
import numpy as np

from ...problem import Problem
from .published import optimum


@optimum("time", 102.36753588, 1e-6, "two switches by shooting, 14.646 s and 52.449 s: see tests")
def mountain_car() -> Problem:
    """The quickest way up a hill for a car that has to swing: the goal is a bound of its state.

    Dymos, "The Mountain Car Problem"; after Melnikov, Makmal and Briegel, "Projective simulation applied to the grid-world and the
    mountain-car problem", Artificial Intelligence Research 3(3), 2014.
    """
    problem = Problem("mountain_car")
    hill = problem.phase("hill", t0=0.0, tf=(1.0, 500.0))
    x = hill.state("x", bounds=(-1.2, 0.5), initial=-0.5, final=0.5)
    v = hill.state("v", bounds=(-0.07, 0.07), initial=0.0, final=(0.0, 0.07))
    u = hill.control("u", bounds=(-1, 1))
    hill.dynamics(x=v, v=0.001 * u - 0.0025 * ca.cos(3 * x))
    problem.minimize("time", hill.tf)
    return problem


@optimum("effort", 0.350076193, 1e-8, "the controllability Gramian: see tests")
@optimum("effort", 1.03359305, 1e-7, "likewise", data={"masses": 4})
@optimum("effort", 2.47257717, 1e-7, "likewise", data={"masses": 8})
def springs(*, masses: int = 2) -> Problem:
    """Least effort to bring masses on springs to rest in at most 40 s: all of it is wanted, and a coarse mesh prefers less.

    From a wall; the first mass is displaced, the last one pushed. Linear, and convex for a given time.
    """
    problem = Problem("springs")
    run = problem.phase("run", t0=0.0, tf=(2.0, 40.0))
    x = [run.state(f"x{i}", bounds=(-5, 5), initial=0.0 if i else 1.0, final=0.0) for i in range(masses)]
    v = [run.state(f"v{i}", bounds=(-5, 5), initial=0.0, final=0.0) for i in range(masses)]
    push = run.control("push", bounds=(-1, 1))
    forces = [b - a for a, b in pairwise(x)]
    rates = [right - left for left, right in zip([x[0], *forces], [*forces, push], strict=True)]
    run.dynamics(**{f"x{i}": v[i] for i in range(masses)}, **{f"v{i}": rates[i] for i in range(masses)})
    problem.minimize("effort", run.integral(push**2))
    return problem


@optimum("speed", 364.10695811, 1e-6, "the integral of the thrust over the mass")
def rail() -> Problem:
    """Speed of a rocket whose thrust exceeds its weight after 0.1 s only: near a bound that it never reaches."""
    problem = Problem("rail")
    ballast = problem.parameter("ballast", bounds=(0, 20), unit="kg")
    burn = problem.phase("burn", t0=0.0, tf=3.9)
    burn.state("v", bounds=(-1, 600), initial=0.0, unit="m/s")
    thrust = 900 * (1 + ca.tanh((burn.time - 0.1) / 0.02))
    burn.dynamics(v=thrust / (17 + ballast) - 9.80665)
    problem.maximize("speed", burn.final(burn["v"]), unit="m/s")
    return problem


@optimum("fuel", 3 - sqrt(5), 0.0, "thrust, coast, thrust: T - sqrt(T^2 - 4 d)")
def thrift() -> Problem:
    """Least fuel of a cart from rest to rest: thrust, coast, thrust against."""
    problem = Problem("thrift")
    push = problem.phase("push", t0=0.0, tf=3.0)
    push.state("x", bounds=(-1, 2), initial=0.0, final=1.0)
    v = push.state("v", bounds=(-3, 3), initial=0.0, final=0.0)
    u = push.control("u", bounds=(-1, 1))
    push.dynamics(x=v, v=u)
    problem.minimize("fuel", push.integral(ca.fabs(u)))
    return problem


@optimum("fuel", 0.18174, 1e-4, "found with this program, by two statements; impulses take 0.18164")
def transfer() -> Problem:
    """Least fuel between circular orbits, the norm of the thrust under a root: it has a corner where the engine is off."""
    problem = Problem("transfer")
    flight = problem.phase("flight", t0=0.0, tf=(2.0, 30.0))
    r = flight.state("r", bounds=(0.8, 2), initial=1.0, final=1.5)
    radial = flight.state("radial", bounds=(-1, 1), initial=0.0, final=0.0)
    along = flight.state("along", bounds=(0.2, 1.5), initial=1.0, final=sqrt(1 / 1.5))
    u, v = flight.control("u", bounds=(-0.1, 0.1)), flight.control("v", bounds=(-0.1, 0.1))
    flight.dynamics(r=radial, radial=along**2 / r - 1 / r**2 + u, along=-radial * along / r + v)
    flight.path("thrust", u**2 + v**2, upper=0.01)
    problem.minimize("fuel", flight.integral(ca.sqrt(u**2 + v**2 + 1e-8)))
    return problem


@optimum("peak", 0.801567054550, 1e-10, "arc and tangent: its curvature from the length of 5")
def least_turn() -> Problem:
    """The least curvature of a path of given length to a point beside the beginning: minimax, an arc and its tangent.

    Jennings' turning vehicle, as asked about in Stack Overflow 74788425.
    """
    problem = Problem("least_turn")
    path = problem.phase("path", t0=0.0, tf=5.0)
    heading = path.state("heading", bounds=(-7, 7), initial=np.pi / 2)
    path.state("x", bounds=(-6, 6), initial=4.0, final=0.0)
    path.state("y", bounds=(-6, 6), initial=0.0, final=0.0)
    turn = path.control("turn", bounds=(-2, 2))
    path.dynamics(heading=turn, x=ca.cos(heading), y=ca.sin(heading))
    problem.minimize("peak", path.peak(ca.fabs(turn)))
    return problem


@optimum("cost", 1001.330806904943, 1e-9, "two layers in closed form: see tests of meshes", scale=1e-1)
def layers() -> Problem:
    """A large constant and a small integral, whose scale is stated: layers at both ends, nothing in between."""
    problem = Problem("layers")
    run = problem.phase("run", t0=0.0, tf=40.0)
    x = run.state("x", bounds=(-3, 3), initial=1.5, final=1.0)
    u = run.control("u", bounds=(-6, 6))
    run.dynamics(x=-(x**3) + u)
    problem.minimize("cost", 1e3 + run.integral(0.5 * (x**2 + u**2)), scale=1e-4)
    return problem
