"""Zermelo: the quickest way of a ship through a current that grows across the stream.

Zermelo, "Über das Navigationsproblem bei ruhender oder veränderlicher Windverteilung", ZAMM 11, 1931; with the data of Bryson and Ho,
"Applied Optimal Control", 1975, section 2.7.
"""

from __future__ import annotations

from math import pi

import casadi as ca

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("time", 5.457865263560, 1e-10, "Bryson and Ho 1975, section 2.7: 5.46; by shooting, see tests"),)


def problem() -> Problem:
    """The ship has speed 1; the current is -y."""
    problem = Problem("zermelo")
    trip = problem.phase("trip", t0=0.0, tf=(1.0, 20.0))
    trip.state("x", bounds=(-10, 20), initial=3.66, final=0)
    y = trip.state("y", bounds=(-10, 10), initial=-1.86, final=0)
    heading = trip.control("heading", bounds=(0, 2 * pi), unit="rad")
    trip.dynamics(x=ca.cos(heading) - y, y=ca.sin(heading))
    problem.minimize("time", trip.tf)
    trip.guess(x=(3.66, 0), y=(-1.86, 0), heading=pi, tf=5.0)
    return problem
