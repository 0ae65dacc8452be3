"""Rayleigh's oscillator with a mixed constraint: a tunnel diode whose current and voltage limit each other.

Augustin and Maurer, "Sensitivity analysis and real-time control of a parametric control problem with mixed constraints", in "Online
Optimization of Large Scale Systems", 2001; Betts 2010, chapter 4.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("cost", 44.80444, 5e-5, "Augustin and Maurer 2001: 44.8044"),)


def problem() -> Problem:
    """The constraint is active at the beginning and once more later."""
    problem = Problem("rayleigh")
    swing = problem.phase("swing", t0=0.0, tf=4.5)
    x = swing.state("x", bounds=(-10, 10), initial=-5)
    y = swing.state("y", bounds=(-10, 10), initial=-5)
    u = swing.control("u", bounds=(-10, 10))
    swing.dynamics(x=y, y=-x + y * (1.4 - 0.14 * y**2) + 4 * u)
    swing.path("mixed", u + x / 6, upper=0.0)
    problem.minimize("cost", swing.integral(x**2 + u**2))
    swing.guess(x=-5, y=-5, u=0)
    return problem
