"""Plane change: an orbit is turned by 18 degrees with lift in the atmosphere, as fast as possible at its end, below a heating rate.

Miele, Lee and Mease, "Nearly grazing optimal trajectories for noncoplanar aeroassisted orbital transfer", Journal of the Astronautical
Sciences 35, 1987; Betts, "Practical Methods for Optimal Control Using Nonlinear Programming", third edition, 2020, chapter 10. In feet,
slugs, seconds and radians.
"""

from __future__ import annotations

from math import cos, exp, pi, radians, sqrt

import casadi as ca

from ....problem import Problem
from ..published import Published

EARTH, MU, MASS, AREA = 2.092643e7, 1.40895e16, 331.5, 125.84
DENSITY, REFERENCE, SCALE_HEIGHT, DRAG, INDUCED = 3.3195e-5, 1e5, 2.41388e4, 0.032, 1.4
LIFTING, DRAGGING = AREA / (2 * MASS) * sqrt(DRAG / INDUCED), DRAG * AREA / (2 * MASS)
TOP, SPEED, TURN, HEATING = 365000.0, 25745.704, radians(18), 800.0
WIDE, FLAT = radians(89), radians(10)
PUBLISHED = (Published("speed", 22043.5079, 5e-2, "Betts 2020, chapter 10: 22043.5079 ft/s after 1005.8778 s"),)


def problem() -> Problem:
    """From the top of the atmosphere to its top."""
    problem = Problem("plane_change")
    flight = problem.phase("flight", t0=0.0, tf=(800.0, 2000.0))
    latitude = flight.state("latitude", bounds=(-WIDE, WIDE), initial=0, unit="rad")
    h = flight.state("altitude", bounds=(0, 400000), initial=TOP, final=TOP, unit="ft")
    v = flight.state("speed", bounds=(20000, 28000), initial=SPEED, unit="ft/s")
    path = flight.state("path angle", bounds=(-FLAT, FLAT), initial=-radians(0.55), unit="rad")
    heading = flight.state("heading", bounds=(-WIDE, WIDE), initial=0, unit="rad")
    lift = flight.control("lift", bounds=(0, 2))
    bank = flight.control("bank", bounds=(0, pi), unit="rad")
    r = EARTH + h
    density = DENSITY * ca.exp((REFERENCE - h) / SCALE_HEIGHT)
    turning = LIFTING * density * v
    gravity = (1 - MU / (r * v**2)) * v / r
    flight.dynamics(
        **{
            "latitude": v / r * ca.cos(path) * ca.sin(heading),
            "altitude": v * ca.sin(path),
            "speed": -DRAGGING * density * v**2 * (1 + lift**2) - MU / r**2 * ca.sin(path),
            "path angle": turning * lift * ca.cos(bank) + gravity * ca.cos(path),
            "heading": turning * lift * ca.sin(bank) / ca.cos(path) - v / r * ca.cos(path) * ca.cos(heading) * ca.tan(latitude),
        }
    )
    surface = DENSITY * exp(REFERENCE / SCALE_HEIGHT)
    flight.path("heating", 17600 * ca.sqrt(density / surface) * (v / sqrt(MU / EARTH)) ** 3.15, upper=HEATING, unit="Btu/ft2/s")
    turned = ca.cos(flight.final(latitude)) * ca.cos(flight.final(heading))
    problem.constraint("turn", turned, lower=cos(TURN), upper=cos(TURN))
    problem.maximize("speed", flight.final(v), unit="ft/s")
    return problem
