"""Points that a simulation does not confirm, solved again on finer meshes."""

from __future__ import annotations

import numpy as np

from transcription import from_dict
from transcription.base import Meshed
from transcription.meshes.verdict import Wanted

from ..evaluation.evaluator import CONVERGED
from ..fronts.merging import best_rows
from ..fronts.points import Points
from ..fronts.verified import verified
from ..io.console import working
from .mesh_refinement import FrontRefinement

PART = 0.1
"""What points are to miss at most, as a fraction of what they may."""
MESHES = 6
"""Most meshes of one point."""


def mended(points: Points, time_limit: float | None, progress: bool | None) -> Points:
    """The front of the points of which those that are not verified have been solved again; see `Front.mended`."""
    again = solved_again(points, time_limit, progress)
    return again[best_rows(again)].sorted()


def solved_again(points: Points, time_limit: float | None = None, progress: bool | None = None) -> Points:
    """The points in their order, of which those that are not verified have been solved again on finer meshes."""
    points.compiled()
    missing = points.was_simulated & ~points.verified & (points.status == CONVERGED)
    rows = [i for i in np.flatnonzero(missing).tolist() if isinstance(from_dict(points[i].transcription or {}), Meshed)]
    if not rows:
        return points
    verify = points.stats["verify"]
    wanted = Wanted(PART * verify, feasible=PART * verify, leaving=PART * verify, objectives=PART * verify)
    with working(time_limit, progress) as (show, interrupts):
        job = FrontRefinement(points, wanted, MESHES, rows)
        job.go(show)
        elapsed, stopped = interrupts.elapsed, interrupts.reason
    return verified(job.points(elapsed, stopped), verify).replace(message=points.message)
