"""Free-flying robot: least fuel of two pairs of jets, to a place and an attitude.

Sakawa, "Trajectory planning of a free-flying robot by using the optimal control", Optimal Control Applications and Methods 20, 1999; Betts
2010, section 6.13.
"""

from __future__ import annotations

from math import pi

import casadi as ca

from ....problem import Problem
from ..published import Published

ARM = 0.2
PUBLISHED = (
    Published(
        "fuel",
        7.68862,
        1e-5,
        "found with this program, nine arcs of constant thrust have 7.688928, integrated: see tests; Betts 2010: 7.91015",
        local=(7.910147051,),
        remark="the optimum of the literature is symmetric in time, and a local one",
    ),
)


def problem() -> Problem:
    """Each pair pushes forwards or backwards; fuel is the sum of what all four jets do."""
    problem = Problem("free_flying_robot")
    flight = problem.phase("flight", t0=0.0, tf=12.0)
    ends = {"x": (-10.0, 0.0), "y": (-10.0, 0.0), "heading": (pi / 2, 0.0), "vx": (0.0, 0.0), "vy": (0.0, 0.0), "rate": (0.0, 0.0)}
    bounds = {"x": (-20, 20), "y": (-20, 20), "heading": (-2 * pi, 2 * pi), "vx": (-10, 10), "vy": (-10, 10), "rate": (-3, 3)}
    s = {name: flight.state(name, bounds=bounds[name], initial=first, final=last) for name, (first, last) in ends.items()}
    jets = [flight.control(f"jet {i}", bounds=(0, 1)) for i in (1, 2, 3, 4)]
    left, right = jets[0] - jets[1], jets[2] - jets[3]
    flight.dynamics(
        x=s["vx"],
        y=s["vy"],
        heading=s["rate"],
        vx=(left + right) * ca.cos(s["heading"]),
        vy=(left + right) * ca.sin(s["heading"]),
        rate=ARM * (left - right),
    )
    flight.path("left", jets[0] + jets[1], upper=1.0)
    flight.path("right", jets[2] + jets[3], upper=1.0)
    problem.minimize("fuel", flight.integral(sum(jets)))
    flight.guess(**ends)
    return problem
