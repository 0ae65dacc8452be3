"""Obstacle avoidance: past two discs at a constant speed, with hardly any room: 2.138 of a shortest way of 2.1317.

Example of PSOPT (Becerra, "PSOPT Optimal Control Solver User Manual"), after "Obstacle avoidance problem" of DIDO. The speed is constant,
and so is the cost: any way that arrives on time is optimal. What is hard is to find one.
"""

from __future__ import annotations

from math import pi

import casadi as ca

from ....problem import Problem
from ..published import Published

SPEED = 2.138
CENTRES, SQUARED_RADIUS = ((0.4, 0.5), (0.8, 1.5)), 0.1
PUBLISHED = (Published("cost", SPEED**2, 0.0, "PSOPT: 4.571044, the square of the speed"),)


def problem() -> Problem:
    """The guess is the straight line, which is not feasible."""
    problem = Problem("obstacle")
    walk = problem.phase("walk", t0=0.0, tf=1.0)
    x = walk.state("x", bounds=(0, 2), initial=0, final=1.2)
    y = walk.state("y", bounds=(0, 2), initial=0, final=1.6)
    heading = walk.control("heading", bounds=(-pi, pi), unit="rad")
    walk.dynamics(x=SPEED * ca.cos(heading), y=SPEED * ca.sin(heading))
    for name, (a, b) in zip(("first", "second"), CENTRES, strict=True):
        walk.path(name, (x - a) ** 2 + (y - b) ** 2, lower=SQUARED_RADIUS)
    problem.minimize("cost", walk.integral((SPEED * ca.cos(heading)) ** 2 + (SPEED * ca.sin(heading)) ** 2))
    walk.guess(x=(0, 1.2), y=(0, 1.6), heading=0)
    return problem
