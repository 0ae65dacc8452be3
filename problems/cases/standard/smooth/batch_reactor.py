"""Batch reactor: the temperatures that make the most of an intermediate product.

Ray, "Advanced Process Control", 1981; Renfro, Morshedi and Asbjornsen, "Simultaneous optimization and solution of systems described by
differential/algebraic equations", Computers and Chemical Engineering 11, 1987; Dadebo and McAuley, "Dynamic optimization of constrained
chemical engineering problems using dynamic programming", Computers and Chemical Engineering 19, 1995.
"""

from __future__ import annotations

import casadi as ca

from ....problem import Problem
from ..published import Published

PUBLISHED = (
    Published(
        "yield",
        0.610802921,
        1e-8,
        "the maximum principle, by shooting: see tests",
        remark="Dadebo and McAuley 1995: 0.610775, by steps of constant temperature, which cannot follow its fall at the beginning",
    ),
)


def problem() -> Problem:
    """A decays into B, and B into C, over an hour."""
    problem = Problem("batch_reactor")
    batch = problem.phase("batch", t0=0.0, tf=1.0, time_unit="h")
    a = batch.state("A", bounds=(0, 1), initial=1)
    b = batch.state("B", bounds=(0, 1), initial=0)
    temperature = batch.control("temperature", bounds=(298, 398), unit="K")
    forward, loss = 4000 * ca.exp(-2500 / temperature) * a**2, 620000 * ca.exp(-5000 / temperature) * b
    batch.dynamics(A=-forward, B=forward - loss)
    problem.maximize("yield", batch.final(b))
    batch.guess(A=(1, 0.2), B=(0, 0.6), temperature=330)
    return problem
