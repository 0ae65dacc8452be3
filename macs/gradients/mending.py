"""Points that a simulation does not confirm, solved again: on finer meshes, or inside of the limits that they exceed."""

from __future__ import annotations

import numpy as np

from transcription import from_dict
from transcription.base import Meshed

from ..evaluation.evaluator import CONVERGED
from ..fronts.columns import by_first
from ..fronts.merging import best_rows
from ..fronts.points import Points
from ..fronts.verified import verified
from .mesh_refinement import LEAST_TOLERANCE, MeshRefinement

FINER = 1e-3
"""Tolerance of the meshes, as a fraction of what a point may miss."""
MESHES = 6
"""Most meshes of one point."""


def mended(points: Points, time_limit: float | None, progress: bool, sifted: bool = True) -> Points:
    """The points of which those that are not verified have been solved again; see `Front.mended`. All of them, unless `sifted`."""
    points.compiled()
    missing = points.was_simulated & ~points.verified & (points.status == CONVERGED)
    rows = [i for i in np.flatnonzero(missing).tolist() if isinstance(from_dict(points[i].transcription or {}), Meshed)]
    if rows:
        verify = points.stats["verify"]
        tolerance = max(FINER * verify, LEAST_TOLERANCE)
        refinement = MeshRefinement(points, tolerance, MESHES, rows)
        refined = refinement.go(time_limit, progress)
        if not sifted:  # refined points come sorted
            F = [refinement.points[i].F if i in refinement.points else points.F[i] for i in range(len(points))]
            refined = refined.take(np.argsort(by_first(np.array(F) * points.signs)))
        again = verified(refined, verify)
        points = again.replace(message=points.message)
    return points[best_rows(points)] if sifted else points
