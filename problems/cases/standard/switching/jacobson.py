"""Jacobson, Gershwin and Lele: a double integrator brought near rest by a control that is on its bound, and then singular.

Jacobson, Gershwin and Lele, "Computation of optimal singular controls", IEEE Transactions on Automatic Control 15(1), 1970. From the switch
on, x = A cosh(5 - t), and the control is x.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("cost", 0.7539838606, 1e-9, "closed form, with the switch at 1.413764: see tests; literature: 0.75398"),)


def problem() -> Problem:
    """The control enters linearly, and not at all in the cost."""
    problem = Problem("jacobson")
    move = problem.phase("move", t0=0.0, tf=5.0)
    x = move.state("x", bounds=(-10, 10), initial=0)
    v = move.state("v", bounds=(-10, 10), initial=1)
    u = move.control("u", bounds=(-1, 1))
    move.dynamics(x=v, v=u)
    problem.minimize("cost", move.integral(x**2 + v**2))
    return problem
