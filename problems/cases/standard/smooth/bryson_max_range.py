"""Bryson's maximum range: as far as possible in a given time, by a thrust of constant size in a uniform gravity.

Bryson, "Dynamic Optimization", 1999, with the data of PSOPT's example: the control is a vector whose length is an equality constraint.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

GRAVITY = 1.0
THRUST = 0.5 * GRAVITY
PUBLISHED = (Published("range", 1.7123149, 5e-8, "the maximum principle, by shooting: see tests; PSOPT: 1.712313"),)


def problem() -> Problem:
    """The guess is no stationary point of the constraint, and gives the direction no sense of its own."""
    problem = Problem("bryson_max_range")
    move = problem.phase("move", t0=0.0, tf=2.0)
    x = move.state("x", bounds=(-10, 10), initial=0)
    move.state("y", bounds=(-10, 10), initial=0, final=0.1)
    v = move.state("v", bounds=(-10, 10), initial=0)
    ux, uy = (move.control(name, bounds=(-10, 10)) for name in ("ux", "uy"))
    move.dynamics(x=v * ux, y=v * uy, v=THRUST - GRAVITY * uy)
    move.path("length", ux**2 + uy**2, lower=1.0, upper=1.0)
    problem.maximize("range", move.final(x))
    move.guess(x=0, y=0, v=0, ux=1, uy=0)
    return problem
