"""Two structures, problems without trajectories: a truss whose front is known in closed form, and a welded beam.

Truss: problem RE21 of Tanabe and Ishibuchi, "An easy-to-use real-world multi-objective optimization problem suite", Applied Soft Computing
89, 2020; it is example 2 of Cheng and Li, Engineering Optimization 31(5), 1999, after Stadler and Dauer. The square root of the third area
in the volume is as published.

Beam: Deb, "Evolutionary algorithms for multi-criterion optimization in engineering design", in Miettinen et al. (eds.), "Evolutionary
Algorithms in Engineering and Computer Science", 1999; it is that of Ragsdell and Phillips, ASME J. Eng. Ind. 98(3), 1976. All data are
those of the paper.
"""

from __future__ import annotations

import numpy as np

from ..vector import VectorProblem

FORCE, STRESS, MODULUS, LENGTH = 10.0, 10.0, 2e5, 200.0
"""Of the truss: kN, kN/cm2, kN/cm2, cm."""
AREA = FORCE / STRESS
ROOT = np.sqrt(2.0)
LOAD, ARM = 6000.0, 14.0
"""Of the beam: force at the free end, lb, and its distance from the weld, in."""


def four_bar_truss() -> VectorProblem:
    """Volume of the bars against displacement of the loaded joint."""
    problem = VectorProblem("four-bar truss")
    for number, least in enumerate((1.0, ROOT, ROOT, 1.0), start=1):
        problem.variable(f"area {number}", bounds=(least * AREA, 3 * AREA), unit="cm2")
    problem.minimize("volume", unit="cm3")
    problem.minimize("displacement", unit="cm")
    problem.function(evaluate_truss)
    problem.default_evaluations = 5_000
    return problem


def evaluate_truss(X: np.ndarray) -> dict[str, np.ndarray]:
    """Objectives of rows of areas."""
    a, b, c, d = X.T
    return {
        "volume": LENGTH * (2 * a + ROOT * b + np.sqrt(c) + d),
        "displacement": FORCE * LENGTH / MODULUS * (2 / a + 2 * ROOT / b - 2 * ROOT / c + 2 / d),
    }


def optimal_areas(points: int = 2001) -> np.ndarray:
    """Areas (points, 4) along the true front.

    Both objectives grow with the third area, which is at its lower bound. The rest is convex and a sum over the other areas, so that every
    point of the front minimises volume + weight * displacement, each area by itself: with s the square root of
    weight * FORCE / MODULUS, the areas are s, sqrt(2) s and sqrt(2) s, within their bounds.
    """
    s = np.linspace(AREA / ROOT, 3 * AREA, points)
    return np.stack(
        [
            np.clip(s, AREA, 3 * AREA),
            np.clip(ROOT * s, ROOT * AREA, 3 * AREA),
            np.full(points, ROOT * AREA),
            np.clip(ROOT * s, AREA, 3 * AREA),
        ],
        axis=1,
    )


def four_bar_truss_reference(points: int = 2001) -> np.ndarray:
    """The true front (points, 2) in closed form: volume and displacement."""
    return np.stack([*evaluate_truss(optimal_areas(points)).values()], axis=1)


def welded_beam() -> VectorProblem:
    """Cost of fabrication against deflection at the end, within limits of stress and buckling."""
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
    problem.function(evaluate_beam)
    problem.default_evaluations = 10_000
    return problem


def evaluate_beam(X: np.ndarray) -> dict[str, np.ndarray]:
    """Objectives and constraints of rows of weld thickness h and length l, beam height t and width b."""
    h, l, t, b = X.T  # noqa: E741 - the paper's letters
    direct = LOAD / (np.sqrt(2) * h * l)
    radius = np.sqrt(0.25 * (l**2 + (h + t) ** 2))
    torsion = LOAD * (ARM + 0.5 * l) * radius / (2 * 0.707 * h * l * (l**2 / 12 + 0.25 * (h + t) ** 2))
    return {
        "cost": 1.10471 * h**2 * l + 0.04811 * t * b * (ARM + l),
        "deflection": 2.1952 / (t**3 * b),
        "shear stress": np.sqrt(direct**2 + torsion**2 + l * direct * torsion / radius),
        "bending stress": 504_000 / (t**2 * b),
        "buckling load": 64_746.022 * (1 - 0.0282346 * t) * t * b**3,
        "weld beyond beam": h - b,
    }
