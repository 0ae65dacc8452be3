"""Merge of several fronts of one problem: the union of their points, without dominated ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..evaluation.evaluator import CONVERGED
from ..pareto.dominance import nondominated
from .builders import nearest_violation
from .point import Point
from .points import Points
from .provenance import merged_stats


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
