"""Four-bar truss: volume of the bars against displacement of the loaded joint; its front is known in closed form.

Problem RE21 of Tanabe and Ishibuchi, "An easy-to-use real-world multi-objective optimization problem suite", Applied Soft Computing 89,
2020; it is example 2 of Cheng and Li, Engineering Optimization 31(5), 1999, after Stadler and Dauer. The square root of the third area in
the volume is as published.
"""

from __future__ import annotations

import numpy as np

from ..vector import VectorProblem

FORCE, STRESS, MODULUS, LENGTH = 10.0, 10.0, 2e5, 200.0
"""kN, kN/cm2, kN/cm2, cm."""
AREA = FORCE / STRESS
ROOT = np.sqrt(2.0)


def problem() -> VectorProblem:
    """The case."""
    problem = VectorProblem("four-bar truss")
    for number, least in enumerate((1.0, ROOT, ROOT, 1.0), start=1):
        problem.variable(f"area {number}", bounds=(least * AREA, 3 * AREA), unit="cm2")
    problem.minimize("volume", unit="cm3")
    problem.minimize("displacement", unit="cm")
    problem.function(evaluate)
    problem.default_evaluations = 5_000
    return problem


def evaluate(X: np.ndarray) -> dict[str, np.ndarray]:
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


def reference(points: int = 2001) -> np.ndarray:
    """The true front (points, 2) in closed form: volume and displacement."""
    return np.stack([*evaluate(optimal_areas(points)).values()], axis=1)
