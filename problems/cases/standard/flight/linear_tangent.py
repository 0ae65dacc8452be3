"""Linear tangent steering: the shortest time to a height and a horizontal speed, at a thrust of constant size.

Bryson and Ho, "Applied Optimal Control", 1975, section 2.4; "particle steering" of Dolan, More and Munson, "Benchmarking optimization
software with COPS 3.0", Argonne ANL/MCS-TM-273, 2004.
"""

from __future__ import annotations

from math import pi

import casadi as ca

from ....problem import Problem
from ..published import Published

THRUST, HEIGHT, SPEED = 100.0, 5.0, 45.0
PUBLISHED = (Published("time", 0.554570878335, 1e-10, "closed form; COPS 3.0, problem 10: 0.554571"),)


def problem() -> Problem:
    """A particle that starts at rest."""
    problem = Problem("linear_tangent")
    rise = problem.phase("rise", t0=0.0, tf=(0.05, 2.0))
    rise.state("x", bounds=(-100, 100), initial=0)
    vx = rise.state("vx", bounds=(-100, 100), initial=0, final=SPEED)
    rise.state("y", bounds=(-100, 100), initial=0, final=HEIGHT)
    vy = rise.state("vy", bounds=(-100, 100), initial=0, final=0)
    u = rise.control("u", bounds=(-pi / 2, pi / 2), unit="rad")
    rise.dynamics(x=vx, vx=THRUST * ca.cos(u), y=vy, vy=THRUST * ca.sin(u))
    problem.minimize("time", rise.tf)
    rise.guess(x=(0, 12), vx=(0, SPEED), y=(0, HEIGHT), vy=0, u=0, tf=1.0)
    return problem
