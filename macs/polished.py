"""A front brought down to the Pareto front by gradients, on a transcription that is made for them, whoever found it on whichever."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from problems.peaks import refuse_peaks
from transcription.base import Transcription
from transcription.inner import March
from transcription.stopping import stopped_by

from . import archive as archives
from .archive import Archive
from .bilevel import Bilevel
from .evaluation import CONVERGED
from .inputs import check_count, check_problem
from .merging import merge
from .monitor import Monitor
from .polish import polish
from .progress import Told
from .refinement import ranges
from .results import certificates, vectors_front
from .solves import Solves

if TYPE_CHECKING:
    from .front import Front


def polished(front: Front, transcription: Transcription, solves: int | None, limit: int | None, progress: bool) -> Front:
    """See `Front.polished`."""
    problem = front.compiled()
    check_problem(problem, transcription)
    known = front[[point.index for point in front if point.status == CONVERGED and point.trajectory is not None]]
    solves, limit = len(known) if solves is None else solves, len(known) if limit is None else limit
    check_count("solves", solves, 0)
    check_count("limit", limit, min(len(front.goals), len(known)))
    refuse_peaks(problem)
    if not len(known):
        return front
    nlp = transcription.transcribe(problem)
    starts = np.array([nlp.interpolate(point.trajectory) for point in known if point.trajectory is not None])
    tolerance = float(front.stats["tolerance"])
    evaluator = Bilevel(nlp, March(), tolerance)
    # What is promised is what was found, on whichever mesh: nothing worse is to take its place.
    begun = Archive(starts, known.F, np.minimum(known.violation, tolerance))
    with Told(progress) as told, Monitor(None, None, None) as monitor, stopped_by(lambda: bool(monitor.reason)):
        evaluator.before_batch = lambda: told(f"polish: {evaluator.counts.gradient_solves} of at most {solves} gradient solves done")
        archive = polish(begun, Solves(evaluator, solves), limit)
        taken = monitor.elapsed
        untouched = {z.tobytes() for z in starts}
        Z = archive.Z[[z.tobytes() not in untouched for z in archive.Z]]
        told(f"polish: how near to optimal {len(Z)} points are")
        certified = certificates(nlp, Z, ranges(archive.F))
        taken = monitor.elapsed
        interrupted = bool(monitor.reason)
    counts, before = evaluator.counts, front.stats
    stats = {
        **before,
        "gradient_solves": before["gradient_solves"] + counts.gradient_solves,
        "inner_iterations": before["inner_iterations"] + counts.inner_iterations,
        "wall_time": before["wall_time"] + taken,
        "reproducible": before["reproducible"] and not (counts.clocked or interrupted),
        **({"stopped": "interrupted"} if interrupted else {}),
    }
    found = merge([vectors_front(nlp, Z, front.solver, stats, optimality=certified), known])
    found = found if len(found) <= limit else found[np.flatnonzero(archives.spread(found.F, limit))]
    found.solver, found.stats = dict(front.solver), stats
    return found
