"""Car: the quickest way from rest to rest, full throttle and then full brakes.

Logsdon and Biegler, "Accurate solution of differential-algebraic optimization problems", Industrial and Engineering Chemistry Research 28,
1989.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("time", 30.0, 0.0, "Logsdon and Biegler 1989: 30, with the switch at 20"),)


def problem() -> Problem:
    """Over 300 m, braking twice as hard as the car accelerates."""
    problem = Problem("car")
    drive = problem.phase("drive", t0=0.0, tf=(1.0, 100.0))
    drive.state("x", bounds=(-10, 400), initial=0, final=300, unit="m")
    v = drive.state("v", bounds=(-10, 100), initial=0, final=0, unit="m/s")
    u = drive.control("u", bounds=(-2, 1), unit="m/s2")
    drive.dynamics(x=v, v=u)
    problem.minimize("time", drive.tf, unit="s")
    return problem
