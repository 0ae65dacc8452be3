"""Schwartz: two phases, the first around an ellipse with a weak control, the second free with a strong one.

Schwartz, "Theory and implementation of numerical methods based on Runge-Kutta integration for solving optimal control problems", 1996
(RIOTS, problem "obstacle"); in two phases in the manual of PSOPT.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("distance", 0.0, 1e-6, "PSOPT: 3.1e-16; the origin is reached", remark="many optima"),)


def problem() -> Problem:
    """The distance is five times the squared one of the final state from the origin."""
    problem = Problem("schwartz")
    first = problem.phase("first", t0=0.0, tf=1.0)
    second = problem.phase("second", t0=1.0, tf=2.9)
    for phase, slowest, strength in ((first, -0.8, 1.0), (second, -10.0, 50.0)):
        start = 1.0 if phase is first else None
        x = phase.state("x", bounds=(-20, 10), initial=start)
        v = phase.state("v", bounds=(slowest, 10), initial=start)
        u = phase.control("u", bounds=(-strength, strength))
        phase.dynamics(x=v, v=u - 0.1 * (1 + 2 * x**2) * v)
        phase.guess(x=1, v=1 if phase is first else 0, u=0)
    first.path("ellipse", 9 * (first["x"] - 1) ** 2 + ((first["v"] - 0.4) / 0.3) ** 2, lower=1.0)
    problem.link(first, second)
    problem.minimize("distance", 5 * (second.final(second["x"]) ** 2 + second.final(second["v"]) ** 2))
    return problem
