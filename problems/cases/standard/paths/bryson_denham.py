"""Bryson-Denham: least effort to turn back before a wall.

Bryson, Denham and Dreyfus, "Optimal programming problems with inequality constraints I", AIAA Journal 1(11), 1963; Bryson and Ho, "Applied
Optimal Control", 1975, section 3.11.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (
    Published("effort", 4.0, 0.0, "Bryson and Ho 1975, section 3.11: 4 / (9 wall)"),
    Published("effort", 2.24, 0.0, "Bryson and Ho 1975, section 3.11: 2 + 6 (1 - 4 wall)^2", {"wall": 0.2}),
)


def problem(wall: float = 1.0 / 9.0) -> Problem:
    """With an arc along the wall where that is nearer than 1/6; between 1/6 and 1/4 the wall is touched at one instant."""
    return turn("bryson_denham", wall)


def turn(name: str, wall: float) -> Problem:
    """State it."""
    problem = Problem(name)
    move = problem.phase("move", t0=0.0, tf=1.0)
    move.state("x", bounds=(-10, wall), initial=0, final=0)
    v = move.state("v", bounds=(-10, 10), initial=1, final=-1)
    u = move.control("u", bounds=(-20, 20))
    move.dynamics(x=v, v=u)
    problem.minimize("effort", move.integral(0.5 * u**2))
    return problem
