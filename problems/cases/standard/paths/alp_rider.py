"""Alp rider: a stiff linear system above four peaks.

Betts 2010, chapter 4: the state has to stay outside a sphere whose radius rises to four narrow peaks.
"""

from __future__ import annotations

import casadi as ca

from ....problem import Problem
from ..published import Published

PEAKS = ((3.0, 12.0, 3.0), (3.0, 10.0, 6.0), (3.0, 6.0, 10.0), (8.0, 4.0, 15.0))
"""Height, sharpness and time of each peak."""
PUBLISHED = (Published("cost", 2030.85609, 5e-6, "Betts 2010: 2030.85609"),)


def problem() -> Problem:
    """Over twenty units of time."""
    problem = Problem("alp_rider")
    ride = problem.phase("ride", t0=0.0, tf=20.0)
    ends = {"a": (2, 2), "b": (1, 3), "c": (2, 1), "d": (1, -2)}
    a, b, c, d = (ride.state(name, bounds=(-4, 4), initial=first, final=last) for name, (first, last) in ends.items())
    u, v = (ride.control(name, bounds=(-500, 500)) for name in "uv")
    ride.dynamics(a=-10 * a + u + v, b=-2 * b + u + 2 * v, c=-3 * c + 5 * d + u - v, d=5 * c - 3 * d + u + 3 * v)
    size = a**2 + b**2 + c**2 + d**2
    terrain = 0.01 + sum(height * ca.exp(-sharpness * (ride.time - at) ** 2) for height, sharpness, at in PEAKS)
    ride.path("terrain", size - terrain, lower=0.0)
    problem.minimize("cost", ride.integral(100 * size + 0.01 * (u**2 + v**2)))
    ride.guess(**ends, u=0, v=0)
    return problem
