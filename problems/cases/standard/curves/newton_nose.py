"""Newton's nose: the least drag of a body of revolution of given length and radius, in a thin gas.

Newton, Principia, 1687, book II, proposition 34; as in YAPSS, with a flat front whose radius is to be found.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("drag", 1.499263950511, 1e-10, "closed form: r = r0 (1 + p^2)^2 / (4 p), with r0 = 0.350943"),)


def problem() -> Problem:
    """The radius is the time, from that of the flat front to 1."""
    problem = Problem("newton_nose")
    nose = problem.phase("nose", t0=(0.01, 0.99), tf=1.0, time_unit="1")
    nose.state("y", bounds=(0, 1), initial=1, final=0)
    slope = nose.control("slope", bounds=(0, 20))
    nose.dynamics(y=-slope)
    problem.minimize("drag", nose.integral(8 * nose.time / (1 + slope**2)) + 4 * nose.t0**2)
    nose.guess(y=(1, 0), slope=1.0, t0=0.1)
    return problem
