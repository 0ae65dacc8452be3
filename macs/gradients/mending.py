"""Points that a simulation does not confirm, solved again: on finer meshes, or inside of the limits that they exceed."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from transcription import from_dict
from transcription.base import Meshed
from transcription.inner import Propagate
from transcription.meshes.verdict import Wanted

from ..evaluation.bilevel import Bilevel
from ..evaluation.evaluator import CONVERGED
from ..fronts.builders import vectors_points
from ..fronts.merging import best_rows
from ..fronts.points import Points
from ..fronts.provenance import more_costs
from ..fronts.verified import objective_scales, verified
from ..io.console import working
from .filling import filled
from .front_polish import KEPT_INSIDE, back_off
from .mesh_refinement import FrontRefinement
from .multistart import GradientSolves

PART = 0.8
"""What points are to miss at most, as a fraction of what they may."""
MESHES = 6
"""Most meshes of one point."""
EVALUATION, FALLBACK, SOLVE = 0.15, 30.0, 20.0
"""What an evaluation, one that went to IPOPT, and a gradient solve cost on average, in iterations of IPOPT on the same mesh."""
ENOUGH = 600.0
"""Iterations that are little time on any mesh."""
SHARE, LEAST = 0.4, 250.0
"""What is spent on points that are solved again, as a fraction of what the front cost; in iterations for each, at least, as long as that is
no more than the front cost."""
LITTLE, LOSS = 0.1, 5e-3
"""Excess over limits, in their scales, up to which a point is rather moved inside of them than solved on a finer mesh; what that may cost
in each objective, in ranges of the front."""


def mended(points: Points, time_limit: float | None, progress: bool | None, fine: Meshed | None = None) -> Points:
    """The front of the points of which those that are not verified have been solved again; see `Front.mended`. With a `fine` mesh, since
    those of the points are known to be too coarse, all of them have been."""
    with working(time_limit, False) as (_, interrupts):
        again = solved_again(points, None, progress, fine)
        if again is not points and (spoilt := points.verified & ~again.verified).any():
            again = Points.concatenate([again, points[spoilt]]).replace(stats=again.stats)
        kept = again[best_rows(again)].sorted()
        lost = len(points) - int(kept.verified.sum())
        if again is points:
            # What no solve can mend is to be explained.
            return kept if kept.verified.all() else verified(kept, points.stats["verify"])
        if not lost:
            return kept
        solves = GradientSolves(float(points.stats["tolerance"]))
        full = filled(kept, len(points), solves, _most_work(points, lost))
        # The ranges of the objectives may be others now.
        return verified(full.sorted().replace(stats=more_costs(kept.stats, solves.counts, 0.0, interrupts.reason)), points.stats["verify"])


def solved_again(points: Points, time_limit: float | None = None, progress: bool | None = None, fine: Meshed | None = None) -> Points:
    """The points in their order, of which those that are not verified have been solved again.

    With a `fine` mesh, all of them are solved on it once, and then those that are still not verified on others.
    """
    points.compiled()
    verify = points.stats["verify"]
    with working(time_limit, progress) as (show, interrupts):
        again = points
        if fine is not None:
            again = _refined(again, _doubtful(again, np.ones(len(again), dtype=bool)), show, fine)
        if slightly := _slightly_outside(again, verify):
            show("points that are infeasible when simulated are solved again")
            again = verified(_inside_limits(again, slightly, verify, LOSS), verify)
        missing = _doubtful(again, ~again.verified)
        if missing:
            again = _refined(again, missing, show, work=_most_work(points, len(missing)))
        others = np.flatnonzero(again.was_simulated & (again.simulated_violation > verify) & (again.status == CONVERGED)).tolist()
        others = [i for i in others if not _meshed(again, i)]
        if others:
            show("points that are infeasible when simulated are solved again")
            again = verified(_inside_limits(again, others, verify), verify)
        if again is points:
            return points
        stats = again.stats | {"wall_time": again.stats["wall_time"] + interrupts.elapsed}
    return again.replace(stats=stats, message=points.message)


def _meshed(points: Points, i: int) -> bool:
    """Whether a point is on a mesh that can be refined."""
    return isinstance(from_dict(points[i].transcription or {}), Meshed)


def _doubtful(points: Points, rows: np.ndarray) -> list[int]:
    """Those of a mask of rows (n,) that were simulated and can be solved on other meshes."""
    return [i for i in np.flatnonzero(rows & points.was_simulated & (points.status == CONVERGED)).tolist() if _meshed(points, i)]


def _refined(points: Points, rows: list[int], show: Callable[[str], None], fine: Meshed | None = None, work: float | None = None) -> Points:
    """The points with some of them on finer meshes, as far as the work allows, or once on a `fine` one; simulated."""
    if not rows:
        return points
    verify = points.stats["verify"]
    limits = PART * verify
    wanted = Wanted(limits, feasible=limits, leaving=limits, objectives=limits, confirmed=False)
    meshes, first = (MESHES, []) if fine is None else (1, [fine])
    job = FrontRefinement(points, wanted, meshes, rows, work, first=first)
    job.go(show)
    return verified(job.points(0.0, ""), verify)


def _most_work(points: Points, count: int) -> float:
    """What may be spent on so many of the points, in iterations times variables."""
    stats = points.stats
    spent = EVALUATION * stats["evaluations"] + FALLBACK * stats["fallbacks"] + SOLVE * stats["gradient_solves"]
    # Where nothing was searched, the mesh is all that there is to be found.
    least = min(LEAST * count, max(spent, ENOUGH)) if stats["evaluations"] else LEAST * count
    return max(SHARE * spent, least) * _size(points)


def _size(points: Points) -> float:
    """The mean number of variables of a point."""
    return float(np.mean([len(variables) for variables in points.places]))


def _slightly_outside(points: Points, verify: float) -> list[int]:
    """The points of which a simulation shows nothing wrong but that they exceed limits, by little: mostly between nodes. On the mesh that
    they have, whose program is there already, a solve costs far less than on any other."""
    beyond = (points.simulated_violation > verify) & (points.simulated_violation <= LITTLE) & (points.status == CONVERGED)
    off = np.abs(points.simulated_F - points.F) / objective_scales(points)
    return np.flatnonzero(beyond & (points.defect <= verify) & (off <= verify).all(axis=1)).tolist()


def _inside_limits(points: Points, rows: Sequence[int], verify: float, loss: float = np.inf) -> Points:
    """The points, with those of `rows` that can be moved inside of the limits that they exceed when simulated, as long as no objective
    gets worse by more than the loss, in ranges of the front."""
    moved: dict[int, Points] = {}
    for transcription in {id(points.transcriptions[i]): points.transcriptions[i] for i in rows}.values():
        own = [i for i in rows if points.transcriptions[i] is transcription]
        nlp = from_dict(transcription or {}).nlp(points.compiled())
        evaluator = Bilevel(nlp, Propagate(), float(points.stats["tolerance"]))
        if not evaluator.has_gradients:
            continue
        scales = objective_scales(points)
        Z, feasible, changed = back_off(evaluator, np.array([points[i].decision for i in own]), scales, verify)
        worse = ((nlp.evaluate(Z)[0] - points.F[own]) / scales).max(axis=1)
        points = points.replace(stats=more_costs(points.stats, evaluator.counts, 0.0, ""))
        for k in np.flatnonzero(feasible & changed & (worse <= loss)).tolist():
            moved[own[k]] = vectors_points(nlp, Z[k : k + 1], points.solver, points.stats, notes=[KEPT_INSIDE])
    if not moved:
        return points
    return Points.concatenate([moved.get(i, points[[i]]) for i in range(len(points))]).replace(stats=points.stats, solver=points.solver)
