"""Orbit raising: the largest circular orbit that a small thrust reaches from another in a given time, as from the earth's to that of Mars.

Moyer and Pinkham, "Several trajectory optimization techniques", 1964; Bryson and Ho, "Applied Optimal Control", 1975, section 2.5. In units
of the first orbit; the data are those of YAPSS.
"""

from __future__ import annotations

import casadi as ca

from ....problem import Problem
from ..published import Published

THRUST, FLOW, DURATION = 0.1405, 0.0749, 3.32
PUBLISHED = (Published("radius", 1.5252777006, 1e-9, "Bryson and Ho 1975, section 2.5: 1.525; by the maximum principle, see tests"),)


def problem() -> Problem:
    """The direction of thrust is a vector no longer than 1."""
    problem = Problem("orbit_raising")
    rise = problem.phase("rise", t0=0.0, tf=DURATION)
    r = rise.state("r", bounds=(1, 10), initial=1)
    vr = rise.state("vr", bounds=(-10, 10), initial=0, final=0)
    vt = rise.state("vt", bounds=(-10, 10), initial=1)
    ur, ut = (rise.control(name, bounds=(-1.1, 1.1)) for name in ("ur", "ut"))
    force = THRUST / (1 - FLOW * rise.time)
    rise.dynamics(r=vr, vr=vt**2 / r - 1 / r**2 + force * ur, vt=-vr * vt / r + force * ut)
    rise.path("length", ur**2 + ut**2, upper=1.0)
    problem.constraint("circular", rise.final(vt - ca.sqrt(1 / r)), lower=0.0, upper=0.0)
    problem.maximize("radius", rise.final(r))
    rise.guess(r=(1.0, 1.5), vr=0, vt=(1.0, 0.5), ur=(0, 1), ut=(1, 0))
    return problem
