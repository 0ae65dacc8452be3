"""A vector problem for tests: two parabolas, of which one is maximised upside down, left of a wall."""

from collections.abc import Callable

import numpy as np

from problems import VectorProblem

Made = dict[str, np.ndarray]


def parabolas(wall: float = 1.5, far: float = 2.0, function: Callable[[np.ndarray], Made] | None = None) -> VectorProblem:
    """Distances from 0 and from `far`; x at most `wall`. The front is 0 <= x <= wall, y = 0."""
    problem = VectorProblem("parabolas")
    problem.variable("x", bounds=(-4, 4), unit="m")
    problem.variable("y", bounds=(-1, 1))
    problem.minimize("near", unit="m2")
    problem.maximize("nearness", unit="m2")
    problem.constraint("wall", upper=wall, unit="m")

    def evaluate(X: np.ndarray) -> Made:
        x, y = X.T
        return {"near": x**2 + y**2, "nearness": -((x - far) ** 2) - y**2, "wall": x}

    problem.function(function or evaluate)
    problem.default_evaluations = 600
    return problem
