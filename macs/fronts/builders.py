"""Points made from vectors of an NLP, from the archive of a search, and from several fronts of one problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem, Objective
from problems.vector import CompiledVectorProblem
from transcription.base import NLP
from transcription.meshes.minimum import OptimumMultipliers, gains
from transcription.nlp.elastic import opposing
from transcription.nlp.optimality import Conditions, Multipliers, costates
from transcription.nlp.program import nlp_scales
from transcription.stopping import Stopped, check_stopping
from transcription.trajectories.limits import excursions
from transcription.trajectories.simulate import limits_by_label

from ..evaluation.evaluator import CONVERGED, FAILED, INFEASIBLE
from ..io.interrupts import spending
from ..io.text import counted
from ..io.workers import each
from ..pareto.archive import Archive
from ..pareto.dominance import nondominated
from .point import Point
from .points import Points
from .provenance import merged_stats

CERTIFIED = 1e-3
"""Largest `optimality`, and largest violation, of points whose multipliers are costates."""


def from_archive(
    nlp: NLP,
    archive: Archive,
    closest: Archive,
    solver: Mapping[str, Any],
    stats: Mapping[str, Any],
    *,
    certify: bool,
) -> Points:
    """Points with the trajectories of an archive; if `certify`, with their optimality and costates, for objectives in ranges of the
    archive."""
    if len(archive):
        found = certified(nlp, archive.Z, np.ptp(archive.F, axis=0)) if certify else {}
        return from_vectors(nlp, archive.Z, solver, stats, **found)
    nearest = from_vectors(nlp, closest.Z[:1], solver, stats)[0]
    violated = conflict(nlp, nearest) if certify and _settled(stats) else nearest_violation(nearest)
    return from_vectors(nlp, archive.Z, solver, stats, message=f"{_nothing(stats)}; {violated}", closest=nearest)


def no_points(
    goals: Sequence[Objective],
    problem: CompiledProblem | CompiledVectorProblem | None,
    solver: Mapping[str, Any],
    stats: Mapping[str, Any],
) -> Points:
    """No points, of a search that was ended before its first population was evaluated."""
    return Points(
        F=np.empty((0, len(goals))),
        decision=np.empty((0, 0)),
        violation=(),
        status=(),
        goals=goals,
        problem=problem,
        solver=solver,
        stats=stats,
        message=f"nothing was evaluated yet: {stats['stopped']}",
    )


@spending("certificates")
def certified(nlp: NLP, Z: np.ndarray, ranges: np.ndarray | None, sole: np.ndarray | None = None) -> dict[str, list[Any]]:
    """The columns `optimality`, `costates` and `weighted_gain` of vectors (k, n), for objectives in `ranges` (m,) or their own scales; None
    for those left when the work is to end.

    Only what is `CERTIFIED` has the last two: those of the objectives of a mask `sole` (m,) where it is so for these alone, since other
    weights may do as well at an end of a front.
    """
    names, rows = ("optimality", "costates", "weighted_gain"), each(_certificate, nlp, [(z, ranges, sole) for z in Z])
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def _certificate(nlp: NLP, z: np.ndarray, ranges: np.ndarray | None, sole: np.ndarray | None) -> tuple[Any, ...]:
    """The columns of `certified` of one vector (n,)."""
    try:
        check_stopping()
        conditions = Conditions.of(nlp, z, ranges)
        some = None if sole is None else _alone(nlp, z, ranges, sole, conditions)
        known = [one for one in (some, conditions) if one is not None]
        # With so small a residual of the objectives asked for that of all is not sought: it is hardly less, and takes as long.
        small = next((one.residual for one in known if one.residual <= 1e-6), None)
        optimality = min((one.residual for one in known), default=np.inf) if small is None else small
        feasible = nlp.evaluate(z[None])[1][0] <= CERTIFIED
        best = next((one for one in known if feasible and one.residual <= CERTIFIED), None)
        multipliers = None if best is None else best.multipliers()
        more = (None, None) if multipliers is None else (costates(nlp, z, multipliers), _weighted_gain(nlp, z, multipliers))
        return optimality, *more
    except Stopped:
        return None, None, None


def _weighted_gain(nlp: NLP, z: np.ndarray, found: Multipliers) -> float | None:
    """What other controls would gain in the weighted sum of the objectives, see `gains`; None where there are no costates to tell."""
    quantities = [np.array(q).ravel() for q in nlp.quantities.call([z])]
    phases = gains(nlp.problem, nlp.unpack(z), OptimumMultipliers.of(nlp, z, found), quantities, np.ones(len(nlp.problem.goals)))
    return sum(float(gain.amounts.sum()) for gain in phases.values()) if phases else None


def _alone(nlp: NLP, z: np.ndarray, ranges: np.ndarray | None, sole: np.ndarray, every: Conditions | None) -> Conditions | None:
    """The conditions of the objectives of a mask alone: from those of all or, where another has no derivatives, by themselves."""
    if every is not None:
        return every.alone(sole)
    return Conditions.of(nlp, z, np.where(sole, nlp_scales(nlp) if ranges is None else ranges, np.inf))


def from_vectors(nlp: NLP, Z: np.ndarray, solver: Mapping[str, Any], stats: Mapping[str, Any], **more: Any) -> Points:
    """Points from vectors (k, n) of an NLP; `more` are further arguments of `Points`.

    Objectives and violations are evaluated by the NLP, and so is the status, unless it is given.
    """
    given = trajectory_columns(nlp, Z, stats["tolerance"]) | more
    return Points(**given, goals=nlp.problem.goals, problem=nlp.problem, solver=solver, stats=stats)


def nearest_violation(nearest: Point) -> str:
    """Text with the at most three constraints that the least infeasible point violates most, each by a tenth of the most at least."""
    (label, amount), *others = sorted(nearest.violations.items(), key=lambda item: -item[1])[:3]
    if not np.isfinite(amount):
        return f"all failed: {label} is not a number"
    also = "".join(f", and {name} by {size:.2g}" for name, size in others if size > 0.1 * amount)
    return f"the nearest violates {label} by {amount:.2g} of its scale{_scale_in_unit(nearest, label)}{also}"


def _scale_in_unit(point: Point, label: str) -> str:
    """What counts as one in a constraint of a point, after a comma, if it has a unit."""
    problem = point._points.problem
    limit = limits_by_label(problem).get(label) if isinstance(problem, CompiledProblem) else None
    return f", {limit.scale:g} {limit.unit}" if limit is not None and limit.unit else ""


def conflict(nlp: NLP, nearest: Point) -> str:
    """Text of `nearest_violation` for a point that violates least, with the constraints that are in conflict with those it names."""
    others = [label for label in opposing(nlp, nearest.decision) if not nearest.violations.get(label, 0.0) > 0.1 * nearest.violation]
    return nearest_violation(nearest) + (f", in conflict with {', '.join(others[:3])}" if others else "")


def trajectory_columns(nlp: NLP, Z: np.ndarray, tolerance: float) -> dict[str, Any]:
    """Columns of `Points`, of k entries each, for vectors (k, n) of one NLP; their variables are there even without any."""
    k = len(Z)
    F, violation = nlp.evaluate(Z) if k else (np.empty((0, len(nlp.problem.goals))), np.empty(0))
    trajectories = [nlp.unpack(z) for z in Z]
    return {
        "F": F,
        "decision": Z,
        "violation": violation,
        "status": _status(violation, tolerance),
        "variables": nlp.variables,
        "violations": [nlp.violations(z) for z in Z],
        "trajectories": trajectories,
        "excursions": [excursions(nlp.problem, trajectory) for trajectory in trajectories],
        "transcriptions": [nlp.transcription.to_dict()] * k,
    }


def from_vector_problem(
    problem: CompiledVectorProblem,
    archive: Archive,
    closest: Archive,
    goals: Sequence[Objective],
    solver: Mapping[str, Any],
    stats: Mapping[str, Any],
) -> Points:
    """Points with the archive of a vector problem; of one without a name, as those of a black box."""
    named = bool(problem.name)

    def of(points: Archive, **more: Any) -> Points:
        return Points(
            F=points.F,
            decision=points.Z,
            violation=points.violation,
            status=_status(points.violation, stats["tolerance"]),
            goals=goals,
            variables=problem.variables,
            problem=problem if named else None,
            solver=solver,
            stats=stats,
            **more,
        )

    if len(archive) or not len(closest):
        return of(archive, message="" if len(archive) else _nothing(stats))
    nearest, violation = of(closest.take(np.arange(1)))[0], closest.violation[0]  # points are put into the order of their objectives
    why = (
        f"the nearest violates the constraints by {violation:.2g}"
        if np.isfinite(violation)
        else f"all of them failed, the first: {stats.get('first_failure') or 'its values are not finite'}"
    )
    return of(archive, message=f"{_nothing(stats)}; {why}", closest=nearest)


def _status(violation: np.ndarray, tolerance: float) -> np.ndarray:
    return np.where(violation <= tolerance, CONVERGED, np.where(np.isfinite(violation), INFEASIBLE, FAILED))


def _nothing(stats: Mapping[str, Any]) -> str:
    ended = ": solves for feasibility from different starts find none nearby" if _settled(stats) else ""
    return f"no feasible point in {counted(stats['evaluations'], 'evaluation')}{ended}"


def _settled(stats: Mapping[str, Any]) -> bool:
    """Whether a search ended since it can find nothing else."""
    return stats.get("stopped") == "settled"


def merge(fronts: Sequence[Points]) -> Points:
    """The non-dominated feasible points of several fronts; see `Front.merge`."""
    fronts = list(fronts)
    if not fronts:
        raise ValueError("there is no front to merge")
    for front in fronts[1:]:
        _check(fronts[0], front)
    union = Points.concatenate([front[front.status == CONVERGED] for front in fronts])
    kept = union[best_rows(union)].sorted()
    closest = _closest(fronts)
    reasons = (front.message for front in fronts if front.closest is closest and front.message)
    return kept.replace(
        solver=_solver(fronts),
        stats=merged_stats([front.stats for front in fronts]),
        message="" if len(kept) else next(reasons, _nearest(closest)),
        closest=None if len(kept) else closest,
    )


def best_rows(points: Points, miss: np.ndarray | float = 0.0) -> np.ndarray:
    """Rows (k,) of the points that belong to a front, in their order.

    Points that were not simulated are compared by their objectives. Verified points are compared among themselves, by their simulated
    objectives. A point that is not verified never displaces one that is: it belongs to the front as long as no verified point, and no other
    that is not, is as good. miss (m,).
    """
    good = np.flatnonzero(points.verified)
    good = good[nondominated(points.simulated_F[good])]
    others = np.flatnonzero(~points.verified)
    others = others[nondominated(points.F[others])]
    as_good = (points.simulated_F[good] <= points.F[others][:, None] + miss).all(axis=2).any(axis=1)
    return np.sort(np.concatenate([good, others[~as_good]]))


def _nearest(closest: Point | None) -> str:
    """The message of a merged front without a feasible point."""
    if closest is None or not closest.violations:
        return "no feasible point"
    return f"no feasible point; {nearest_violation(closest)}"


def _check(one: Points, other: Points) -> None:
    """Raise ValueError if two fronts are of different problems."""

    def problem(front: Points) -> str:
        return f"'{front.source.name}'" if front.source else "a black box"

    if (one.source and one.source.fingerprint) != (other.source and other.source.fingerprint):
        same = one.source and other.source and one.source.name == other.source.name
        why = ": the same name, but other bounds, equations or data" if same else ""
        raise ValueError(f"fronts of different problems do not merge: {problem(one)} and {problem(other)}{why}")
    if one.goals != other.goals:
        raise ValueError(f"fronts with different objectives do not merge: {_objectives(one)} and {_objectives(other)}")
    if not one.source and one.variables != other.variables:
        names = [", ".join(v.name for v in front.variables) for front in (one, other)]
        raise ValueError(f"fronts of black boxes with different variables do not merge: {names[0]} and {names[1]}")


def _objectives(front: Points) -> str:
    return ", ".join(f"{goal.sense} {goal.name} [{goal.unit}]" for goal in front.goals)


def _closest(fronts: Sequence[Points]) -> Point | None:
    found = [front.closest for front in fronts if front.closest is not None]
    return min(found, key=lambda point: point.violation, default=None)


def _solver(fronts: Sequence[Points]) -> dict[str, Any]:
    """The common solver of the fronts; else the names of all their solvers."""
    first = fronts[0].solver
    if all(front.solver == first for front in fronts):
        return first
    return {"name": ", ".join(dict.fromkeys(front.solver.get("name", "?") for front in fronts)), "settings": {}}
