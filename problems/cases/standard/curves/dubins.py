"""Dubins: the shortest way of a car that turns no tighter than a circle, to a place behind it, in the direction that it has.

Dubins, "On curves of minimal length with a constraint on average curvature", American Journal of Mathematics 79, 1957. The way consists of
arcs of the tightest circles and a straight line, which is singular; others of this kind are local optima.
"""

from __future__ import annotations

from math import pi

import casadi as ca

from ....problem import Problem
from ..published import Published

PLACE = (-3.0, 1.0)
PUBLISHED = (Published("length", 9.445462967348, 1e-9, "closed form, the shortest of six words: see tests", local=(10.7459, 12.5774)),)


def problem() -> Problem:
    """The radius and the speed are one; the car may turn round once on either side."""
    problem = Problem("dubins")
    drive = problem.phase("drive", t0=0.0, tf=(1.0, 30.0))
    drive.state("x", bounds=(-10, 10), initial=0, final=PLACE[0])
    drive.state("y", bounds=(-10, 10), initial=0, final=PLACE[1])
    heading = drive.state("heading", bounds=(-2.5 * pi, 2.5 * pi), initial=0, unit="rad")
    turn = drive.control("turn", bounds=(-1, 1), unit="rad/s")
    drive.dynamics(x=ca.cos(heading), y=ca.sin(heading), heading=turn)
    problem.constraint("same axis", ca.sin(drive.final(heading)), lower=0, upper=0)
    problem.constraint("same direction", ca.cos(drive.final(heading)), lower=0)
    problem.minimize("length", drive.tf)
    return problem
