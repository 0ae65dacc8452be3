"""Dynamic soaring: the least wind gradient with which an unpowered glider can fly a periodic orbit.

Zhao, "Optimal patterns of glider dynamic soaring", Optimal Control Applications and Methods 25, 2004; with the data of GPOPS-II and YAPSS.
"""

from __future__ import annotations

from math import pi, radians

import casadi as ca
import numpy as np

from ....problem import Problem
from ..published import Published

MASS, GRAVITY, AREA, DENSITY = 5.6, 32.2, 45.09703, 0.002378
DRAG, INDUCED, LIFT, LOAD = 0.00873, 0.045, 1.5, 5.0
PUBLISHED = (Published("gradient", 0.06358656, 5e-8, "YAPSS 0.2.3, example dynamic_soaring: 0.06358656"),)


def problem() -> Problem:
    """A closed circle; the wind blows along x and grows with height. The load factor limits the turns."""
    problem = Problem("dynamic_soaring")
    gradient = problem.parameter("gradient", bounds=(0.005, 0.15), unit="1/s")
    circle = problem.phase("circle", t0=0.0, tf=(10.0, 30.0))
    circle.state("x", bounds=(-1500, 1500), initial=0, final=0, unit="ft")
    circle.state("y", bounds=(-1000, 1000), initial=0, final=0, unit="ft")
    h = circle.state("h", bounds=(0, 1000), initial=0, final=0, unit="ft")
    v = circle.state("v", bounds=(10, 350), unit="ft/s")
    path = circle.state("path angle", bounds=(-radians(75), radians(75)), unit="rad")
    heading = circle.state("heading", bounds=(-radians(225), radians(225)), unit="rad")
    lift = circle.control("lift", bounds=(0, LIFT))
    bank = circle.control("bank", bounds=(-radians(75), radians(75)), unit="rad")
    share = 0.5 * DENSITY * AREA * v**2 / MASS
    gust = gradient * v * ca.sin(path)
    circle.dynamics(
        **{
            "x": v * ca.cos(path) * ca.sin(heading) + gradient * h,
            "y": v * ca.cos(path) * ca.cos(heading),
            "h": v * ca.sin(path),
            "v": -share * (DRAG + INDUCED * lift**2) - GRAVITY * ca.sin(path) - gust * ca.cos(path) * ca.sin(heading),
            "path angle": (share * lift * ca.cos(bank) - GRAVITY * ca.cos(path) + gust * ca.sin(path) * ca.sin(heading)) / v,
            "heading": (share * lift * ca.sin(bank) - gust * ca.cos(heading)) / (v * ca.cos(path)),
        }
    )
    circle.path("load factor", share * lift / GRAVITY, lower=-2.0, upper=LOAD, unit="g")
    for name, value, turn, unit in (("v", v, 0.0, "ft/s"), ("path angle", path, 0.0, "rad"), ("heading", heading, 2 * pi, "rad")):
        problem.constraint(f"closed {name}", circle.final(value) - circle.initial(value), lower=turn, upper=turn, unit=unit)
    problem.minimize("gradient", gradient, unit="1/s")
    problem.guess(gradient=0.08)
    t = np.linspace(0.0, 24.0, 50)
    x = 600 * (np.cos(2 * pi * t / 24) - 1)
    y, turned = -200 * np.sin(2 * pi * t / 24), np.clip(2 * pi * t / 24, 0, radians(225))
    circle.guess(x=(t, x), y=(t, y), h=(t, -0.7 * x), v=150, **{"path angle": 0}, heading=(t, turned), lift=0.5, bank=pi / 4, tf=24.0)
    return problem
