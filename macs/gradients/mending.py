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


def mended(points: Points, time_limit: float | None, progress: bool) -> Points:
    """The points of which those that are not verified have been solved again; see `Front.mended`."""
    points.compiled()
    missing = points.was_simulated & ~points.verified & (points.status == CONVERGED)
    rows = [i for i in np.flatnonzero(missing).tolist() if isinstance(from_dict(points[i].transcription or {}), Meshed)]
    if rows:
        verify = points.stats["verify"]
        wanted = Wanted(PART * verify, feasible=PART * verify, leaving=PART * verify, objectives=PART * verify)
        with working(time_limit, progress) as (show, interrupts):
            job = FrontRefinement(points, wanted, MESHES, rows)
            job.go(show)
            elapsed, stopped = interrupts.elapsed, interrupts.reason
        points = verified(job.points(elapsed, stopped), verify).replace(message=points.message)
    return points[best_rows(points)]
