"""Lotka-Volterra fishing: fish both prey and predators so that they come to rest, with a singular arc.

Sager, "Numerical methods for mixed-integer optimal control problems", 2005; "Lotka Volterra fishing problem" of mintoc.de. The control may
be anything from 0 to 1: the relaxed problem, whose optimum is the infimum of that with 0 and 1 alone.
"""

from __future__ import annotations

from ....problem import Problem
from ..published import Published

PUBLISHED = (Published("deviation", 1.34408, 5e-6, "Sager, mintoc.de: 1.34408, relaxed; with three arcs of their own: 1.344082"),)


def problem() -> Problem:
    """Over twelve units of time."""
    problem = Problem("lotka_fishing")
    sea = problem.phase("sea", t0=0.0, tf=12.0)
    prey = sea.state("prey", bounds=(0, 20), initial=0.5)
    predators = sea.state("predators", bounds=(0, 20), initial=0.7)
    u = sea.control("fishing", bounds=(0, 1))
    sea.dynamics(prey=prey - prey * predators - 0.4 * prey * u, predators=-predators + prey * predators - 0.2 * predators * u)
    problem.minimize("deviation", sea.integral((prey - 1) ** 2 + (predators - 1) ** 2))
    return problem
