"""Fast oscillator: the quickest way of van der Pol's oscillator between two states, bang-bang.

Maurer and Osmolovskii, "Second order sufficient conditions for time-optimal bang-bang control", SIAM Journal on Control and Optimization
42(6), 2004.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

BEGINNING, END = (-0.4, 0.6), (0.6, 0.4)
PUBLISHED = (Published("time", 1.2540747293, 1e-9, "its switch by shooting: see tests; Maurer and Osmolovskii 2004: 1.2540747"),)


def problem() -> Problem:
    """One switch, from the upper bound to the lower one."""
    problem = Problem("fast_oscillator")
    swing = problem.phase("swing", t0=0.0, tf=(0.1, 20.0))
    x = swing.state("x", bounds=(-5, 5), initial=BEGINNING[0], final=END[0])
    y = swing.state("y", bounds=(-5, 5), initial=BEGINNING[1], final=END[1])
    u = swing.control("u", bounds=(-1, 1))
    swing.dynamics(x=y, y=-x + y * (1 - x**2) + u)
    problem.minimize("time", swing.tf)
    return problem
