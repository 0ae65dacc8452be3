"""Isoperimetric: the largest area within a closed curve of length 1.

Dido's problem; as in YAPSS, with the centre of the area at the origin. The optimum is a circle that may be turned and begun anywhere.
"""

from __future__ import annotations

from math import pi

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("area", 1 / (4 * pi), 0.0, "closed form: the circle, 1 / (4 pi)"),)


def problem() -> Problem:
    """Arc length is the time. The guess is a square."""
    problem = Problem("isoperimetric")
    curve = problem.phase("curve", t0=0.0, tf=1.0, time_unit="1")
    x, y = (curve.state(name, bounds=(-1, 1)) for name in "xy")
    ux, uy = (curve.control(name, bounds=(-2, 2)) for name in ("ux", "uy"))
    curve.dynamics(x=ux, y=uy)
    curve.path("speed", ux**2 + uy**2, lower=1.0, upper=1.0)
    for name, value in (("x", x), ("y", y)):
        problem.constraint(f"closed {name}", curve.final(value) - curve.initial(value), lower=0.0, upper=0.0)
        problem.constraint(f"mean {name}", curve.integral(value), lower=0.0, upper=0.0)
    problem.maximize("area", curve.integral((y * ux - x * uy) / 2))
    corners, side = [0.0, 0.25, 0.5, 0.75, 1.0], 0.125
    curve.guess(x=(corners, [side, side, -side, -side, side]), y=(corners, [side, -side, -side, side, side]))
    return problem
