"""Catalyst mixing: the best blend of two catalysts along a reactor, a singular arc between two pure ends.

Jackson, "Optimization of chemical reactors with respect to flow configuration", JOTA 2, 1968; problem 14 of Dolan, More and Munson,
"Benchmarking optimization software with COPS 3.0", Argonne ANL/MCS-TM-273, 2004.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("yield", 0.0480557, 1e-7, "COPS 3.0, problem 14: -4.80556e-2; with three arcs of their own: 0.04805569"),)


def problem() -> Problem:
    """Length is the time."""
    problem = Problem("catalyst_mixing")
    reactor = problem.phase("reactor", t0=0.0, tf=1.0, time_unit="1")
    x = reactor.state("x", bounds=(0, 1), initial=1)
    y = reactor.state("y", bounds=(0, 1), initial=0)
    u = reactor.control("u", bounds=(0, 1))
    reactor.dynamics(x=u * (10 * y - x), y=u * (x - 10 * y) - (1 - u) * y)
    problem.maximize("yield", 1 - reactor.final(x) - reactor.final(y))
    reactor.guess(x=1, y=0, u=0)
    return problem
