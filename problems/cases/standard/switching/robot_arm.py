"""Robot arm: the quickest turn of an arm that can be drawn in, lifted and turned, each by a force of its own.

Weinreb and Bryson, "Optimal control of systems with hard control bounds", IEEE Transactions on Automatic Control 30, 1985; problem 8 of
Dolan, More and Munson, "Benchmarking optimization software with COPS 3.0", Argonne ANL/MCS-TM-273, 2004.
"""

from __future__ import annotations

from math import pi

import casadi as ca

from ....problem import Problem
from ..published import Published

LENGTH = 5.0
PUBLISHED = (Published("time", 9.140911746, 1e-9, "the six arcs of its bang-bang controls: see tests; COPS 3.0, problem 8: 9.14093"),)


def problem() -> Problem:
    """The ends differ in the turn alone; a shorter arm turns faster."""
    problem = Problem("robot_arm")
    turn = problem.phase("turn", t0=0.0, tf=(1.0, 30.0))
    reach = turn.state("reach", bounds=(0, LENGTH), initial=4.5, final=4.5)
    angle_ends = {"heading": (0.0, 2 * pi / 3), "elevation": (pi / 4, pi / 4)}
    turn.state("heading", bounds=(-pi, pi), initial=0, final=2 * pi / 3, unit="rad")
    elevation = turn.state("elevation", bounds=(0, pi), initial=pi / 4, final=pi / 4, unit="rad")
    rates = {name: turn.state(f"{name} rate", bounds=(-10, 10), initial=0, final=0) for name in ("reach", *angle_ends)}
    forces = {name: turn.control(f"{name} force", bounds=(-1, 1)) for name in rates}
    inertia = ((LENGTH - reach) ** 3 + reach**3) / 3
    turn.dynamics(
        **rates,
        **{
            "reach rate": forces["reach"] / LENGTH,
            "heading rate": forces["heading"] / (inertia * ca.sin(elevation) ** 2),
            "elevation rate": forces["elevation"] / inertia,
        },
    )
    problem.minimize("time", turn.tf)
    turn.guess(reach=4.5, **angle_ends, tf=10.0)
    return problem
