"""Brachistochrone: the quickest way down.

Johann Bernoulli, Acta Eruditorum, 1696; with the data of PSOPT's example (Becerra, "PSOPT Optimal Control Solver User Manual").
"""

from __future__ import annotations

from math import pi

import casadi as ca

from ....problem import Problem
from ..published import Published

GRAVITY = 9.8
PUBLISHED = (Published("time", 0.824759143157, 1e-10, "closed form, a cycloid; PSOPT: 0.8247591"),)


def problem() -> Problem:
    """From rest to a point as far below as it is ahead; the angle is from the vertical."""
    problem = Problem("brachistochrone")
    slide = problem.phase("slide", t0=0.0, tf=(0.1, 10.0))
    slide.state("x", bounds=(0, 20), initial=0, final=2, unit="m")
    slide.state("y", bounds=(0, 20), initial=0, final=2, unit="m")
    v = slide.state("v", bounds=(0, 20), initial=0, unit="m/s")
    angle = slide.control("angle", bounds=(0, pi), unit="rad")
    slide.dynamics(x=v * ca.sin(angle), y=v * ca.cos(angle), v=GRAVITY * ca.cos(angle))
    problem.minimize("time", slide.tf, unit="s")
    slide.guess(x=(0, 2), y=(0, 2), v=(0, 5), angle=1.0, tf=2.0)
    return problem
