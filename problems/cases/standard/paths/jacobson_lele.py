"""Jacobson and Lele: a double integrator with friction below a parabola of time.

Jacobson and Lele, "A transformation technique for optimal control problems with a state variable inequality constraint", IEEE Transactions
on Automatic Control 14(5), 1969.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("cost", 0.1698205, 5e-7, "two meshes of ours, 0.1698206 and less by what they miss; literature: 0.1698"),)


def problem() -> Problem:
    """The speed touches the parabola."""
    problem = Problem("jacobson_lele")
    move = problem.phase("move", t0=0.0, tf=1.0)
    x = move.state("x", bounds=(-2, 2), initial=0)
    v = move.state("v", bounds=(-2, 2), initial=-1)
    u = move.control("u", bounds=(-20, 20))
    move.dynamics(x=v, v=u - v)
    move.path("parabola", 8 * (move.time - 0.5) ** 2 - 0.5 - v, lower=0.0)
    problem.minimize("cost", move.integral(x**2 + v**2 + 0.005 * u**2))
    move.guess(x=0, v=(-1, 0), u=0)
    return problem
