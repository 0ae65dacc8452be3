"""Van der Pol's oscillator, brought to rest by a control with limits.

Vassiliadis, "Computational solution of dynamic optimization problems with general differential-algebraic constraints", 1993; case study 6.1
of Balsa-Canto, Banga, Alonso and Vassiliadis, "Restricted second order information for the solution of optimal control problems using
control vector parameterization", Journal of Process Control 12, 2002.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("cost", 2.8672610452, 1e-9, "the maximum principle, by shooting: see tests; PROPT manual, section 124: 2.867259"),)


def problem() -> Problem:
    """The lower limit of the control is active at the beginning."""
    problem = Problem("van_der_pol")
    swing = problem.phase("swing", t0=0.0, tf=5.0)
    x = swing.state("x", bounds=(-10, 10), initial=0)
    y = swing.state("y", bounds=(-10, 10), initial=1)
    u = swing.control("u", bounds=(-0.3, 1.0))
    swing.dynamics(x=(1 - y**2) * x - y + u, y=x)
    problem.minimize("cost", swing.integral(x**2 + y**2 + u**2))
    swing.guess(x=0, y=1, u=0)
    return problem
