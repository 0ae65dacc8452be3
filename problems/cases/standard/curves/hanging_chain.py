"""Hanging chain: the shape of a chain of given length between two heights, as that of the least potential energy.

Problem 4 of Dolan, More and Munson, "Benchmarking optimization software with COPS 3.0", Argonne ANL/MCS-TM-273, 2004; among PSOPT's
examples.
"""

from __future__ import annotations

import casadi as ca

from ....problem import Problem
from ..published import Published

LENGTH, BEGINNING, END = 4.0, 1.0, 3.0
PUBLISHED = (Published("energy", 5.0684801110, 1e-9, "closed form, a catenary: see tests; PSOPT: 5.068480"),)


def problem() -> Problem:
    """The height over the place, with its slope as the control."""
    problem = Problem("hanging_chain")
    chain = problem.phase("chain", t0=0.0, tf=1.0)
    x = chain.state("height", bounds=(-10, 10), initial=BEGINNING, final=END)
    chain.state("length", bounds=(0, 10), initial=0, final=LENGTH)
    slope = chain.control("slope", bounds=(-20, 20))
    way = ca.sqrt(1 + slope**2)
    chain.dynamics(height=slope, length=way)
    problem.minimize("energy", chain.integral(x * way))
    chain.guess(height=(BEGINNING, END), length=(0, LENGTH), slope=END - BEGINNING)
    return problem
