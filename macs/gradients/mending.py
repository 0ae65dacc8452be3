"""Points that a simulation does not confirm, solved again: on finer meshes, or inside of the limits that they exceed."""

from __future__ import annotations

from collections.abc import Sequence

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
PATIENCE = 150
"""Iterations after which a solve is given up: the time of a long one is better spent on other points."""
EVALUATION, SOLVE = 0.15, 20.0
"""What an evaluation and a gradient solve cost on average, in iterations of IPOPT on the same mesh."""
SHARE, LEAST = 0.3, 500.0
"""What is spent on the points that are solved again, as a fraction of what the front cost; in iterations for each, at least."""


def mended(points: Points, time_limit: float | None, progress: bool | None, first: Sequence[Meshed] = ()) -> Points:
    """The front of the points of which those that are not verified have been solved again, on the meshes `first`, if there are any; see
    `Front.mended`."""
    with working(time_limit, False) as (_, interrupts):
        again = solved_again(points, None, progress, first)
        kept = again[best_rows(again)].sorted()
        lost = len(points) - int(kept.verified.sum())
        if again is points or not lost:
            return kept
        solves = GradientSolves(float(points.stats["tolerance"]))
        full = filled(kept, len(points), solves, LEAST * lost * _size(kept))
        # The ranges of the objectives may be others now.
        return verified(full.sorted().replace(stats=more_costs(kept.stats, solves.counts, 0.0, interrupts.reason)), points.stats["verify"])


def solved_again(points: Points, time_limit: float | None = None, progress: bool | None = None, first: Sequence[Meshed] = ()) -> Points:
    """The points in their order, of which those that are not verified have been solved again."""
    points.compiled()
    missing = np.flatnonzero(points.was_simulated & ~points.verified & (points.status == CONVERGED)).tolist()
    if not missing:
        return points
    meshed = [i for i in missing if isinstance(from_dict(points[i].transcription or {}), Meshed)]
    verify = points.stats["verify"]
    with working(time_limit, progress) as (show, interrupts):
        again = points
        if meshed:
            limits = PART * verify
            wanted = Wanted(limits, feasible=limits, leaving=limits, objectives=limits, confirmed=False)
            job = FrontRefinement(points, wanted, MESHES, meshed, _most_work(points, meshed), first=first, max_iterations=PATIENCE)
            job.go(show)
            again = job.points(0.0, interrupts.reason)
        others = [i for i in missing if i not in meshed and points.simulated_violation[i] > verify]
        if others:
            show("points that are infeasible when simulated are solved again")
            again = _inside_limits(again, others, verify)
        stats = again.stats | {"wall_time": again.stats["wall_time"] + interrupts.elapsed}
    return verified(again.replace(stats=stats, message=points.message), verify)


def _most_work(points: Points, rows: list[int]) -> float:
    """What may be spent on some of the points, in iterations times variables: a share of what the front cost, and a little for each."""
    spent = EVALUATION * points.stats["evaluations"] + SOLVE * points.stats["gradient_solves"]
    return max(SHARE * spent, LEAST * len(rows)) * _size(points)


def _size(points: Points) -> float:
    """The mean number of variables of a point."""
    return float(np.mean([len(variables) for variables in points.places]))


def _inside_limits(points: Points, rows: Sequence[int], verify: float) -> Points:
    """The points, with those of `rows` that can be moved inside of the limits that they exceed when simulated."""
    moved: dict[int, Points] = {}
    for transcription in {id(points.transcriptions[i]): points.transcriptions[i] for i in rows}.values():
        own = [i for i in rows if points.transcriptions[i] is transcription]
        nlp = from_dict(transcription or {}).nlp(points.compiled())
        evaluator = Bilevel(nlp, Propagate(), float(points.stats["tolerance"]))
        if not evaluator.has_gradients:
            continue
        Z, feasible, changed = back_off(evaluator, np.array([points[i].decision for i in own]), objective_scales(points), verify)
        points = points.replace(stats=more_costs(points.stats, evaluator.counts, 0.0, ""))
        for k in np.flatnonzero(feasible & changed).tolist():
            moved[own[k]] = vectors_points(nlp, Z[k : k + 1], points.solver, points.stats, notes=[KEPT_INSIDE])
    if not moved:
        return points
    return Points.concatenate([moved.get(i, points[[i]]) for i in range(len(points))]).replace(stats=points.stats, solver=points.solver)
