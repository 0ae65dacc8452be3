"""Rows of a vector problem evaluated again: what a simulation is to a trajectory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem
from problems.vector import CompiledVectorProblem
from transcription.trajectories.limits import excess


@dataclass(frozen=True)
class Reevaluation:
    """One point evaluated again; with the names of a `Simulation`."""

    objectives: Mapping[str, float]  # by name, in the user's units and senses
    violations: Mapping[str, float]  # scaled residual by constraint, and of bounds that are exceeded
    violation: float  # the largest of them; infinite if the evaluation failed
    # defect, max_defect, trajectory: Empty, 0 and None: there are no states.
    defect: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    max_defect: float = 0.0
    trajectory: Any = None


def evaluated_again(problem: CompiledVectorProblem, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[dict[str, float]]]:
    """Objectives (n, m), all minimised, largest violations (n,), and violations by name of decisions (n, d), those of bounds included.

    A failed evaluation has NaN and infinity. Constraints without names are called g1, g2, ...
    """
    if not len(Z):
        return np.empty((0, len(problem.goals))), np.empty(0), []
    F, found = problem.evaluate(np.array(Z, dtype=float))
    beyond = excess(np.asarray(Z, dtype=float)[:, None], problem.variables)
    limits = [f"g{k + 1}" for k in range(found.shape[1])] if problem.limits is None else [limit.name for limit in problem.limits]
    names = [*limits, *(f"bounds of {v.name}" for v in problem.variables)]
    amounts = np.hstack([np.abs(found), beyond])
    failed = ~(np.isfinite(F).all(axis=1) & np.isfinite(found).all(axis=1))
    F = np.where(failed[:, None], np.nan, F)
    violations = [
        {name: float(amount) for k, (name, amount) in enumerate(zip(names, row, strict=True)) if k < len(limits) or amount > 0.0}
        for row in amounts
    ]
    return F, np.where(failed, np.inf, amounts.max(axis=1, initial=0.0)), violations


def reevaluation(problem: CompiledVectorProblem, z: np.ndarray) -> Reevaluation:
    """One decision (d,) evaluated again."""
    F, violation, violations = evaluated_again(problem, z[None])
    objectives = {goal.name: float(goal.sign * value) for goal, value in zip(problem.goals, F[0], strict=True)}
    return Reevaluation(objectives, violations[0], float(violation[0]))


def check_same_vectors(known: CompiledVectorProblem, other: CompiledVectorProblem | CompiledProblem) -> CompiledVectorProblem:
    """`other`, if decisions of the known problem can be evaluated with it. Raises ValueError for other variables or objectives."""
    place = f"points of '{known.name}' cannot be evaluated with '{other.name}'"
    if not isinstance(other, CompiledVectorProblem):
        raise ValueError(f"{place}: that is no vector problem")

    def parts(problem: CompiledVectorProblem) -> dict[str, list[str]]:
        objectives = [f"{goal.sense} {goal.name} [{goal.unit}]" for goal in problem.goals]
        return {"variables": [v.name for v in problem.variables], "objectives": objectives}

    ours, theirs = parts(known), parts(other)
    for what, names in ours.items():
        if theirs[what] != names:
            raise ValueError(f"{place}: its {what} are {', '.join(theirs[what])}, not {', '.join(names)}")
    return other
