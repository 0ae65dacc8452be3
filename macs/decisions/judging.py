"""Which of several points a preference has best, and hard limits that cannot be met together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from problems.compiled import Objective

from ..evaluation.evaluator import CONVERGED
from ..fronts.point import Point
from ..preferences import Stage
from ..preferences.stage import SLACK
from .stages import SAME

ALIKE = 0.5
"""Part of the largest excess from which on a limit is in conflict with others."""


def stage_values(stages: Sequence[Stage], objectives: np.ndarray) -> np.ndarray:
    """Values (n, number of stages) at objectives (n, m); 0 for a stage that does not follow, since the one before is not zero."""
    columns: list[np.ndarray] = []
    for stage in stages:
        found = stage.numbers(objectives)
        follows = columns[-1] <= SAME if columns and stage.after_zero else np.ones(len(found), dtype=bool)
        columns.append(np.where(follows | np.isinf(found), found, 0.0))
    return np.stack(columns, axis=1)


class Merit:
    """How good a point is among others, less is better: feasible and confirmed first, then by the excess over hard limits, then by the
    stages, each as far as those before tell no difference.

    Parameters
    ----------
    stages : sequence of Stage
    points : sequence of Point
        The others.
    """

    def __init__(self, stages: Sequence[Stage], points: Sequence[Point]) -> None:
        self._stages = stages
        rated = [self._rated(point) for point in points]
        first = min(one[:2] for one in rated)
        rows = np.array([one[2] for one in rated if one[:2] == first])
        self._least: list[float] = []
        for column in range(len(stages)):
            self._least.append(float(rows[:, column].min()))
            rows = rows[[_equal(value, self._least[-1]) for value in rows[:, column]]]

    def __call__(self, point: Point) -> tuple[float, ...]:
        kind, excess, values = self._rated(point)
        near = [0.0 if _equal(value, least) else value for value, least in zip(values.tolist(), self._least, strict=True)]
        return (kind, excess, *near[:-1], float(values[-1]))

    def _rated(self, point: Point) -> tuple[float, float, np.ndarray]:
        J = np.array([list(point.objectives.values())])
        excess = max(float(stage.excess(J)[0]) for stage in self._stages)
        return float(_kind(point)), excess if excess > SLACK else 0.0, stage_values(self._stages, J)[0]


def _equal(value: float, least: float) -> bool:
    """Whether a value is as good as the least, as far as stages keep what they attained."""
    return bool(value <= least + SAME * max(abs(least), 1.0)) if np.isfinite(least) else True


def _kind(point: Point) -> int:
    """0: feasible, and a simulation agrees if there was one; 1: feasible; 2: neither."""
    return 2 if point.status != CONVERGED else int(point.verified is False)


def with_all_limits(stages: Sequence[Stage], m: int) -> list[Stage]:
    """The stages of m objectives, of which the first has all limits, each once: the later ones keep it, and so have them, too."""
    limits: dict[str, tuple[int, int]] = {}
    for i, stage in enumerate(stages):
        count = len(stage.limits([1.0] * m))
        for k, name in enumerate(stage.limit_names or [f"limit {k + 1} of {stage.name}" for k in range(count)]):
            limits.setdefault(name, (i, k))

    def every(J: Sequence[Any]) -> list[Any]:
        found = [stage.limits(J) for stage in stages]
        return [found[i][k] for i, k in limits.values()]

    bare = [replace(stage, limits=_nothing, limit_names=()) for stage in stages]
    return [replace(bare[0], limits=every, limit_names=tuple(limits)), *bare[1:]]


def excess_stage(limits: Stage) -> Stage:
    """The stage of which the value is the largest excess over the limits of another."""
    return Stage("largest excess over hard limits", lambda J, peaks: peaks[0], lambda J: [limits.limits(J)])


def meets(limits: Stage, point: Point) -> bool:
    """Whether a point is within the limits of a stage."""
    return bool(limits.excess(np.array([list(point.objectives.values())]))[0] <= SLACK)


def unmet(limits: Stage, goals: Sequence[Objective], J: np.ndarray) -> str:
    """Text with the limits that cannot be met, by objectives (m,) that exceed them as little as possible: those in conflict are exceeded
    alike there."""
    excess = limits.excesses(J[None])[0]
    names = [name for name, one in zip(limits.limit_names, excess, strict=True) if one >= ALIKE * excess.max()]
    nearest = ", ".join(f"{goal.name} {value:.6g}{f' {goal.unit}' if goal.unit else ''}" for goal, value in zip(goals, J, strict=True))
    what = f"all of: {', '.join(names)}" if len(names) > 1 else names[0]
    return f"no point was found that meets {what}; the nearest has {nearest}"


def _nothing(J: Sequence[Any]) -> list[Any]:
    return []
