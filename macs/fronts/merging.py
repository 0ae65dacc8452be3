"""Several fronts of one problem as one: the union of their points, without the dominated ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..evaluation.evaluator import CONVERGED
from ..front import Front
from ..pareto.dominance import nondominated
from ..point import Point


def merge(fronts: Sequence[Front]) -> Front:
    """The non-dominated feasible points of several fronts; see `Front.merge`."""
    fronts = list(fronts)
    if not fronts:
        raise ValueError("there is no front to merge")
    for front in fronts[1:]:
        _check(fronts[0], front)
    points = [point for front in fronts for point in front if point.status == CONVERGED]
    F = np.array([point.F for point in points]).reshape(len(points), len(fronts[0].goals))
    kept = [point for point, keep in zip(points, nondominated(F), strict=True) if keep]
    closest = _closest(fronts)
    known = next((front for front in fronts if front.problem is not None), fronts[0])
    return Front(
        F=[point.F for point in kept],
        decision=[point.decision for point in kept],
        violation=[point.violation for point in kept],
        status=[point.status for point in kept],
        goals=known.goals,
        variables=[point.variables for point in kept] or known.variables,
        violations=[point.violations for point in kept],
        trajectories=[point.trajectory for point in kept],
        excursions=[point.excursions for point in kept],
        optimality=[point.optimality for point in kept],
        problem=known.problem or known.source,
        notes=[point.note for point in kept],
        transcription=[point.transcription for point in kept],
        solver=_solver(fronts),
        stats=_stats(fronts),
        message="" if kept else next((front.message for front in fronts if front.closest is closest and front.message), _nearest(closest)),
        closest=None if kept else closest,
    )


def _nearest(closest: Point | None) -> str:
    """What is to be said of fronts none of whose points is feasible, where they do not say it."""
    if closest is None or not closest.violations:
        return "nothing feasible"
    label, amount = max(closest.violations.items(), key=lambda item: item[1])
    return f"nothing feasible; the nearest violates {label} by {amount:.2g} of its scale"


def _check(one: Front, other: Front) -> None:
    def problem(front: Front) -> str:
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


def _objectives(front: Front) -> str:
    return ", ".join(f"{goal.sense} {goal.name} [{goal.unit}]" for goal in front.goals)


def _closest(fronts: Sequence[Front]) -> Point | None:
    found = [front.closest for front in fronts if front.closest is not None]
    return min(found, key=lambda point: point.violation, default=None)


def _solver(fronts: Sequence[Front]) -> dict[str, Any]:
    """The solver that made all of them; else the names of those that did."""
    first = fronts[0].solver
    if all(front.solver == first for front in fronts):
        return first
    return {"name": ", ".join(dict.fromkeys(front.solver.get("name", "?") for front in fronts)), "settings": {}}


def _stats(fronts: Sequence[Front]) -> dict[str, Any]:
    """Costs are summed, seeds listed, the loosest tolerance and the least reproducible run stand for all."""
    stats = [front.stats for front in fronts]
    summed = {key: sum(s[key] for s in stats) for key in ("evaluations", "inner_iterations", "gradient_solves", "fallbacks", "wall_time")}
    failures: Counter[str] = Counter()
    versions: dict[str, dict[str, None]] = {}
    seeds: list[Any] = []
    for s in stats:
        failures.update(s["failures"])
        seeds += s["seed"] if isinstance(s["seed"], list) else [s["seed"]]
        for package, version in s["versions"].items():
            versions.setdefault(package, {})[version] = None
    return {
        **summed,
        "failures": dict(failures),
        "seed": seeds if len(seeds) > 1 else seeds[0],
        "tolerance": max(s["tolerance"] for s in stats),
        "reproducible": all(s["reproducible"] for s in stats),
        "versions": {package: ", ".join(found) for package, found in versions.items()},
    }
