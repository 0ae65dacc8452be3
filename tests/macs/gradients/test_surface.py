"""Cover of a surface whose solves end in the valley in which they begin."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from macs.decisions import ReferencePoint
from macs.evaluation.evaluator import CONVERGED, Evaluation
from macs.gradients.polish import Surface, cover
from macs.pareto.archive import Archive
from macs.pareto.directions import across, simplex_lattice
from macs.search.guide import PreferenceGuide
from problems.compiled import Objective

GOALS = tuple(Objective(f"f{k + 1}", "", "minimize") for k in range(3))
GOOD, POOR = 1.0, 1.03
GUIDE = PreferenceGuide(ReferencePoint({"f1": 0.3, "f2": 0.4, "f3": 0.5}), GOALS)


@dataclass
class Spheres:
    """Solves on eighths of spheres: the only variable is the radius, which no solve changes."""

    left: int
    begun: list[float] = field(default_factory=list)

    def __call__(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray) -> Evaluation:
        (radius,), reference, weight = starts[0], references[0], weights[0]
        self.left -= 1
        self.begun.append(float(radius))
        step = brentq(lambda t: float(np.linalg.norm(np.maximum(reference + t * weight, 0.0))) - radius, -3.0, 3.0)
        F = np.maximum(reference + step * weight, 0.0)
        return Evaluation(starts.copy(), F[None], np.zeros(1), np.array([CONVERGED]))

    def feasible(self, found: Evaluation) -> np.ndarray:
        return np.array([True])


def on_sphere(directions: np.ndarray, radius: float) -> Archive:
    F = radius * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return Archive(np.full((len(F), 1), radius), F, np.zeros(len(F)))


ENDS = on_sphere(np.eye(3), GOOD)
"""The ends of the front; they are no good for the preference."""


def test_solves_begin_where_points_are_good_and_stay_in_the_better_valley() -> None:
    """One point of the good valley is best; those of the poor one are nearer to most places."""
    poor = on_sphere(simplex_lattice(3, 30), POOR)
    poor = poor.take((poor.F > 0.0).all(axis=1))
    best = on_sphere(np.array([[0.3, 0.4, 0.5]]), GOOD)
    surface = Surface(ENDS.joined(poor).joined(best), np.zeros(3), np.ones(3), across(ENDS.F), ENDS.F)
    start, place = surface.guided(GUIDE)
    wanted = GUIDE.factors(surface.pool.F, surface.pool.F)
    nearest = np.linalg.norm(surface.plane(surface.pool.F) - place, axis=1).argmin()
    assert wanted[nearest] < wanted.max() == wanted[start]
    solves = Spheres(40)
    few = on_sphere(simplex_lattice(3, 12), POOR)
    surface = cover(best.joined(few.take((few.F > 0.0).all(axis=1))), ENDS, solves, 12, GUIDE)  # type: ignore[arg-type]
    assert solves.left == 0 and set(solves.begun) == {GOOD}
