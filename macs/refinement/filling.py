"""A front whose verified points are too few, filled up by solves from those that there are."""

from __future__ import annotations

import numpy as np

from transcription import from_dict
from transcription.meshed import Meshed
from transcription.stopping import stopping

from ..evaluation.evaluator import CONVERGED
from ..fronts.builders import best_rows, from_vectors
from ..fronts.points import Points
from ..fronts.verified import Simulations, objective_scales, verified
from ..gradients.scalarised import GradientSolves, Scalarised
from ..pareto.dominance import extremes
from ..pareto.spread import Guide, spread
from .mesh_loop import Programs

STARTS = 2
"""Number of verified points from which a solve is tried."""


def filled(
    points: Points,
    size: int,
    solves: GradientSolves,
    most_work: float,
    programs: Programs,
    simulations: Simulations,
    guide: Guide | None = None,
) -> Points:
    """The points with further verified ones, until `size` of them are verified or the work is done.

    Solves lead first to where points are that are not verified, then to the middle of the widest gaps between verified ones. Each goes from
    there to the front along the ranges of the objectives (Pascoletti and Serafini 1984) and starts at the nearest verified points, on their
    meshes. As many of the points that are not verified are left out as the front has too many.
    """
    tried = np.empty((0, points.F.shape[1]))
    while points.verified.any() and _needed(points).sum() < size and solves.counts.work < most_work and not stopping():
        scales = objective_scales(points)
        target = _target(points, tried, scales, guide)
        if target is None:
            break
        tried = np.vstack([tried, target])
        rows = np.flatnonzero(points.verified)
        near = rows[np.argsort(np.linalg.norm((points.simulated_F[rows] - target) / scales, axis=1), kind="stable")][:STARTS]
        for row in near:
            found = _solved(points, int(row), Scalarised(target, scales, units=scales), solves, programs, simulations)
            if found is not None:
                joined = Points.concatenate([points, found]).replace(stats=points.stats, solver=points.solver)
                points = joined[best_rows(joined)]
                break
    return points[_within(points, size, guide)]


def _within(points: Points, size: int, guide: Guide | None) -> np.ndarray:
    """Rows (k,) of a front with `size` points, if that is possible without the best of any objective: of verified points those that are
    well spread, of others as many as there is room for."""
    good = np.flatnonzero(points.verified)
    if len(good) > size:
        return good[spread(points.simulated_F[good], size, guide=guide)]
    spare = np.flatnonzero(~_needed(points))
    return np.setdiff1d(np.arange(len(points)), spare[: max(len(points) - size, 0)])


def _needed(points: Points) -> np.ndarray:
    """Mask (n,) of the points that are verified or the best of an objective."""
    needed = points.verified.copy()
    needed[extremes(points.F)] = True
    return needed


def _target(points: Points, tried: np.ndarray, scales: np.ndarray, guide: Guide | None) -> np.ndarray | None:
    """Where to go next (m,): to the point that is not verified and nearest to one that is; without any, to the middle of the widest gap
    between verified points that are neighbours in the first of two objectives. None if all of that was tried."""
    good, others = points.simulated_F[points.verified], points.F[~points.verified]
    others = others[[not (row == tried).all(axis=1).any() for row in others]]
    if len(others):
        return others[np.argmin(np.linalg.norm((others[:, None] - good) / scales, axis=2).min(axis=1))]
    if len(points.goals) != 2 or len(good) < 2:
        return None
    good = good[np.argsort(good[:, 0], kind="stable")]
    middles, widths = 0.5 * (good[1:] + good[:-1]), np.linalg.norm(np.diff(good, axis=0) / scales, axis=1)
    if guide is not None:
        widths *= guide.factors(good, middles)
    new = [k for k in np.argsort(-widths, kind="stable").tolist() if not (middles[k] == tried).all(axis=1).any()]
    return middles[new[0]] if new else None


def _solved(
    points: Points, row: int, task: Scalarised, solves: GradientSolves, programs: Programs, simulations: Simulations
) -> Points | None:
    """A verified point of the task from a point, on its mesh; None if there is none."""
    point = points[row]
    method = from_dict(point.transcription or {})
    if not isinstance(method, Meshed):
        return None
    nlp = programs(method)
    solved = task.solve(solves, nlp, point.decision)
    if solved.status != CONVERGED:
        return None
    found = from_vectors(nlp, solved.z[None], points.solver, points.stats)
    found = verified(found, simulations.tolerance, task.weights, remark=False, simulations=simulations)
    return found if found.verified[0] else None
