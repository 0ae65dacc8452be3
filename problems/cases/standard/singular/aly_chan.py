"""Aly and Chan: a control that is singular all along.

Aly and Chan, "Application of a modified quasilinearization technique to totally singular optimal control problems", International Journal
of Control 17, 1973. The optimum is u = -sin t, x = sin t, and its cost is nothing.
"""

from __future__ import annotations

from math import pi

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("cost", 0.0, 1e-8, "Aly and Chan 1973: 0"),)


def problem() -> Problem:
    """A swing between speed and place."""
    problem = Problem("aly_chan")
    move = problem.phase("move", t0=0.0, tf=pi / 2)
    x = move.state("x", bounds=(-5, 5), initial=0)
    v = move.state("v", bounds=(-5, 5), initial=1)
    u = move.control("u", bounds=(-1, 1))
    move.dynamics(x=v, v=u)
    problem.minimize("cost", move.integral(0.5 * (v**2 - x**2)))
    move.guess(x=0, v=1, u=0)
    return problem
