"""Two-link arm: the quickest way from rest to rest, bang-bang in both joints.

Weinreb 1985; Luus, "Iterative Dynamic Programming", 2000, section 12.4.2; Moon, "Two-link robotic arm" in the test problems of the Handbook
of Test Problems in Local and Global Optimization; PSOPT, example twolinkarm.
"""

from __future__ import annotations

import casadi as ca

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("time", 2.982279943, 1e-9, "the four arcs of its bang-bang controls: see tests"),)


def problem() -> Problem:
    """Rates of both joints, the angle between the links and that of the first."""
    problem = Problem("two_link_arm")
    move = problem.phase("move", t0=0.0, tf=(1.0, 10.0))
    ends = {"a": (0.0, 0.0), "b": (0.0, 0.0), "elbow": (0.5, 0.5), "shoulder": (0.0, 0.522)}
    a, b, elbow, _ = (move.state(name, bounds=(-2, 2), initial=first, final=last) for name, (first, last) in ends.items())
    u, v = (move.control(name, bounds=(-1, 1)) for name in "uv")
    sin, cos = ca.sin(elbow), ca.cos(elbow)
    inertia = 31 / 36 + 9 / 4 * sin**2
    move.dynamics(
        a=(sin * (9 / 4 * cos * a**2 + 2 * b**2) + 4 / 3 * (u - v) - 3 / 2 * cos * v) / inertia,
        b=-(sin * (7 / 2 * a**2 + 9 / 4 * cos * b**2) - 7 / 3 * v + 3 / 2 * cos * (u - v)) / inertia,
        elbow=b - a,
        shoulder=a,
    )
    problem.minimize("time", move.tf)
    move.guess(**ends, u=0, v=0, tf=3.0)
    return problem
