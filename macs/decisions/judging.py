"""Hard limits of preferences: all of them in one stage, and those that cannot be met together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from problems.compiled import Objective

from ..fronts.point import Point
from ..preferences import Stage
from ..preferences.preference import BEYOND, standing
from ..preferences.ranges import shown
from ..preferences.stage import LIMIT_TOL, exceeded

ALIKE = 0.5
"""Part of the largest excess from which on a limit is in conflict with others."""


def with_all_limits(stages: Sequence[Stage], m: int) -> list[Stage]:
    """The stages of m objectives, of which the first has all limits: the later ones keep it, and so have them, too. Those of one name are
    one limit; without names, each is one of its own."""
    places: dict[str | tuple[int, int], tuple[int, int, str]] = {}
    for i, stage in enumerate(stages):
        for k, name in enumerate(stage.titles(len(stage.limits([1.0] * m)))):
            places.setdefault(name if stage.limit_names else (i, k), (i, k, name))

    def every(J: Sequence[Any]) -> list[Any]:
        found = [stage.limits(J) for stage in stages]
        return [found[i][k] for i, k, _ in places.values()]

    bare = [replace(stage, limits=_nothing, limit_names=()) for stage in stages]
    return [replace(bare[0], limits=every, limit_names=tuple(name for _, _, name in places.values())), *bare[1:]]


def excess_stage(limits: Stage) -> Stage:
    """The stage of which the value is the largest excess over the limits of another."""
    return Stage("largest excess over hard limits", lambda J, peaks: peaks[0], lambda J: [limits.limits(J)])


def meets(limits: Stage, point: Point) -> bool:
    """Whether a point is within the limits of a stage."""
    return bool(limits.excess(np.array([list(point.objectives.values())]))[0] <= LIMIT_TOL)


def keeps(limits: Stage, point: Point, verify: float) -> bool:
    """Whether a feasible point is within the limits of a stage, as far as `standing` tells."""
    return bool(standing([limits], point.alone(), verify)[0] < BEYOND)


def unmet(limits: Stage, goals: Sequence[Objective], J: np.ndarray) -> str:
    """Text with the limits that cannot be met, by objectives (m,) that exceed them as little as possible: those in conflict are exceeded
    alike there."""
    excess = limits.excesses(J[None])[0]
    names = [limits.titles(len(excess))[k] for k in np.flatnonzero(excess >= ALIKE * excess.max())]
    nearest = ", ".join(f"{goal.name} {shown(float(value), goal)}" for goal, value in zip(goals, J, strict=True))
    what = f"all of: {', '.join(names)}" if len(names) > 1 else names[0]
    return f"no point was found that meets {what}; the nearest has {nearest}: {exceeded(limits, goals, J)}"


def _nothing(J: Sequence[Any]) -> list[Any]:
    return []
