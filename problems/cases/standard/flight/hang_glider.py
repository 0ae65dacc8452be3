"""Hang glider: as far as possible through a thermal.

Bulirsch, Nerz, Pesch and von Stryk, "Combining direct and indirect methods in optimal control: range maximization of a hang glider", 1993;
Betts 2010, section 6.5, whose speeds at the ends are those of the best steady glide; problem 9 of COPS 3.0 with rounded data.
"""

from __future__ import annotations

import casadi as ca

from ....problem import Problem
from ..published import Published

MASS, GRAVITY, AREA, DENSITY = 100.0, 9.80665, 14.0, 1.13
DRAG, INDUCED = 0.034, 0.069662
UPDRAFT, RADIUS = 2.5, 100.0
SPEED, SINK = 13.2275675, -1.28750052
PUBLISHED = (Published("range", 1248.031, 5e-4, "Betts 2010, section 6.5: 1248.031"),)


def problem() -> Problem:
    """From a height of 1000 m to one of 900 m; the thermal is at 250 m."""
    problem = Problem("hang_glider")
    glide = problem.phase("glide", t0=0.0, tf=(10.0, 200.0))
    x = glide.state("x", bounds=(0, 1500), initial=0, unit="m")
    glide.state("y", bounds=(0, 1100), initial=1000, final=900, unit="m")
    vx = glide.state("vx", bounds=(0, 15), initial=SPEED, final=SPEED, unit="m/s")
    vy = glide.state("vy", bounds=(-4, 4), initial=SINK, final=SINK, unit="m/s")
    lift = glide.control("lift", bounds=(0, 1.4))
    away = (x / RADIUS - 2.5) ** 2
    sink = vy - UPDRAFT * (1 - away) * ca.exp(-away)
    speed = ca.sqrt(vx**2 + sink**2)
    # Forces are along the air's and across it: half the density times area and speed, times the components of the speed.
    share = 0.5 * DENSITY * AREA * speed / MASS
    drag = DRAG + INDUCED * lift**2
    glide.dynamics(x=vx, y=vy, vx=-share * (lift * sink + drag * vx), vy=share * (lift * vx - drag * sink) - GRAVITY)
    problem.maximize("range", glide.final(x), unit="m")
    glide.guess(x=(0, 1250), y=(1000, 900), vx=13.23, vy=-1.288, lift=1.0, tf=105.0)
    return problem
