"""Moon landing: least propellant to a soft landing, one switch from no thrust to full thrust.

Meditch, "On the problem of optimal thrust programming for a lunar soft landing", IEEE Transactions on Automatic Control 9(4), 1964; with
the data of PSOPT's example.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

EXHAUST, GRAVITY, THRUST = 2.349, 1.0, 1.227
PUBLISHED = (Published("impulse", 1.420312599049, 1e-10, "closed form: no thrust for 0.239259, full thrust for 1.157549"),)


def problem() -> Problem:
    """The objective is the impulse, the propellant times the exhaust speed."""
    problem = Problem("moon_landing")
    fall = problem.phase("landing", t0=0.0, tf=(0.1, 10.0))
    fall.state("altitude", bounds=(-20, 20), initial=1.0, final=0.0)
    speed = fall.state("speed", bounds=(-20, 20), initial=-0.783, final=0.0)
    mass = fall.state("mass", bounds=(0.01, 1.0), initial=1.0)
    thrust = fall.control("thrust", bounds=(0, THRUST))
    fall.dynamics(altitude=speed, speed=thrust / mass - GRAVITY, mass=-thrust / EXHAUST)
    problem.minimize("impulse", fall.integral(thrust))
    fall.guess(altitude=(1, 0), speed=(-0.783, 0), mass=(1, 0.5), thrust=0.5 * THRUST, tf=1.5)
    return problem
