"""Stirred tank: a reaction that gives off heat is brought to rest by cooling. It has a local optimum of nearly twice the cost.

Lapidus and Luus, "Optimal Control of Engineering Processes", 1967; Luus and Cormack, "Multiplicity of solutions resulting from the use of
variational methods in optimal control problems", Canadian Journal of Chemical Engineering 50, 1972.
"""

from __future__ import annotations

import casadi as ca

from ....problem import Problem
from ..published import Published

PUBLISHED = (
    Published("cost", 0.1330957305, 1e-9, "the maximum principle, by collocation: see tests; Luus 2000: 0.133094", local=(0.244425,)),
)


def problem() -> Problem:
    """Temperature and concentration, as deviations from rest."""
    problem = Problem("stirred_tank")
    tank = problem.phase("tank", t0=0.0, tf=0.78)
    x = tank.state("temperature", bounds=(-1, 5), initial=0.09)
    y = tank.state("concentration", bounds=(-1, 5), initial=0.09)
    u = tank.control("cooling", bounds=(-1, 20))
    reaction = (y + 0.5) * ca.exp(25 * x / (x + 2))
    tank.dynamics(temperature=-(2 + u) * (x + 0.25) + reaction, concentration=0.5 - y - reaction)
    problem.minimize("cost", tank.integral(x**2 + y**2 + 0.1 * u**2))
    return problem
