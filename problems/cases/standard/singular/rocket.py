"""Goddard's rocket with drag: the greatest height, full thrust, then a singular arc, then none.

Goddard, "A method of reaching extreme altitudes", 1919; problem 10 of Dolan, More and Munson, "Benchmarking optimization software with COPS
3.0", Argonne ANL/MCS-TM-273, 2004, in units of the earth's radius, the initial mass and the weight there.
"""

from __future__ import annotations

import casadi as ca

from ....problem import Problem
from ..published import Published

THRUST, EXHAUST, DRAG, DECAY, EMPTY = 3.5, 0.5, 310.0, 500.0, 0.6
"""Largest thrust, exhaust speed, drag at the ground at unit speed, decay of density with height, and mass without propellant."""
PUBLISHED = (
    Published(
        "height",
        1.0128369,
        5e-8,
        "COPS 3.0, problem 10: 1.01283; with three arcs of their own, each smooth: 1.0128369",
        scale=0.0128369,
        remark="differences are measured by the height that is gained",
    ),
)


def problem() -> Problem:
    """The guess is that of COPS."""
    problem = Problem("rocket")
    flight = problem.phase("flight", t0=0.0, tf=(0.05, 1.0))
    h = flight.state("h", bounds=(1.0, 2.0), initial=1.0)
    v = flight.state("v", bounds=(0.0, 2.0), initial=0.0)
    m = flight.state("m", bounds=(EMPTY, 1.0), initial=1.0, final=EMPTY)
    thrust = flight.control("thrust", bounds=(0.0, THRUST))
    drag = DRAG * v**2 * ca.exp(-DECAY * (h - 1.0))
    flight.dynamics(h=v, v=(thrust - drag) / m - 1.0 / h**2, m=-thrust / EXHAUST)
    problem.maximize("height", flight.final(h))
    flight.guess(h=1.0, v=([0.0, 0.5, 1.0], [0.0, 0.25, 0.0]), m=(1.0, EMPTY), thrust=0.5 * THRUST, tf=1.0)
    return problem
