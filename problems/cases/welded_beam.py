"""Welded beam: cost of fabrication against deflection at the end, within limits of stress and buckling.

Deb, "Evolutionary algorithms for multi-criterion optimization in engineering design", in Miettinen et al. (eds.), "Evolutionary
Algorithms in Engineering and Computer Science", 1999; the beam is that of Ragsdell and Phillips, ASME J. Eng. Ind. 98(3), 1976. All data
are those of the paper.
"""

from __future__ import annotations

import numpy as np

from ..vector import VectorProblem

LOAD, LENGTH = 6000.0, 14.0
"""Force at the free end, lb, and its distance from the weld, in."""


def problem() -> VectorProblem:
    """The case."""
    problem = VectorProblem("welded beam")
    problem.variable("weld thickness", bounds=(0.125, 5), unit="in")
    problem.variable("weld length", bounds=(0.1, 10), unit="in")
    problem.variable("beam height", bounds=(0.1, 10), unit="in")
    problem.variable("beam width", bounds=(0.125, 5), unit="in")
    problem.minimize("cost", unit="$")
    problem.minimize("deflection", unit="in")
    problem.constraint("shear stress", upper=13_600, unit="psi")
    problem.constraint("bending stress", upper=30_000, unit="psi")
    problem.constraint("buckling load", lower=LOAD, unit="lb")
    problem.constraint("weld beyond beam", upper=0, unit="in")
    problem.function(evaluate)
    problem.default_evaluations = 10_000
    return problem


def evaluate(X: np.ndarray) -> dict[str, np.ndarray]:
    """Objectives and constraints of rows of weld thickness h and length l, beam height t and width b."""
    h, l, t, b = X.T  # noqa: E741 - the paper's letters
    direct = LOAD / (np.sqrt(2) * h * l)
    radius = np.sqrt(0.25 * (l**2 + (h + t) ** 2))
    torsion = LOAD * (LENGTH + 0.5 * l) * radius / (2 * 0.707 * h * l * (l**2 / 12 + 0.25 * (h + t) ** 2))
    return {
        "cost": 1.10471 * h**2 * l + 0.04811 * t * b * (LENGTH + l),
        "deflection": 2.1952 / (t**3 * b),
        "shear stress": np.sqrt(direct**2 + torsion**2 + l * direct * torsion / radius),
        "bending stress": 504_000 / (t**2 * b),
        "buckling load": 64_746.022 * (1 - 0.0282346 * t) * t * b**3,
        "weld beyond beam": h - b,
    }
