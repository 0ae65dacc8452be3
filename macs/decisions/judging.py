"""Hard limits of preferences: all of them in one stage, and those that cannot be met together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from problems.compiled import Objective

from ..fronts.point import Point
from ..preferences import Stage
from ..preferences.checks import shown
from ..preferences.stage import SLACK

ALIKE = 0.5
"""Part of the largest excess from which on a limit is in conflict with others."""
STEP = 1e-4
"""Part of an objective, or of 1, by which it is moved to see in which unit a limit is."""


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


def keeps(limits: Stage, point: Point, verify: float) -> bool:
    """Whether a point is within the limits of a stage; of one that a simulation contradicts, whether what was simulated is, too, but for
    `verify`, which points may miss."""
    if point.verified is not False or point.simulated is None:
        return meets(limits, point)
    return meets(limits, point) and bool(limits.excess(np.array([list(point.simulated.values())]))[0] <= verify)


def unmet(limits: Stage, goals: Sequence[Objective], J: np.ndarray) -> str:
    """Text with the limits that cannot be met, by objectives (m,) that exceed them as little as possible: those in conflict are exceeded
    alike there."""
    excess = limits.excesses(J[None])[0]
    names = [name for name, one in zip(limits.limit_names, excess, strict=True) if one >= ALIKE * excess.max()]
    nearest = ", ".join(f"{goal.name} {shown(float(value), goal)}" for goal, value in zip(goals, J, strict=True))
    what = f"all of: {', '.join(names)}" if len(names) > 1 else names[0]
    return f"no point was found that meets {what}; the nearest has {nearest}: {exceeded(limits, goals, J)}"


def exceeded(limits: Stage, goals: Sequence[Objective], J: np.ndarray) -> str:
    """Text with each limit that objectives (m,) exceed, and by how much."""
    unknown = [f"'{goal.name}'" for goal, value in zip(goals, J, strict=True) if not np.isfinite(value)]
    if unknown:
        return f"{', '.join(unknown)} is no number"
    excess = limits.excesses(J[None])[0]
    return ", ".join(
        f"'{name}' is missed by {_amount(limits, k, goals, J)}"
        for k, (name, one) in enumerate(zip(limits.limit_names, excess, strict=True))
        if one > SLACK
    )


def _amount(limits: Stage, k: int, goals: Sequence[Objective], J: np.ndarray) -> str:
    """By how much objectives (m,) exceed a limit: in the unit of its objective, where it is a limit of one."""
    here = float(limits.excesses(J[None])[0, k])
    steps = STEP * np.maximum(np.abs(J), 1.0)
    slopes = (limits.excesses(J + np.diag(steps))[:, k] - here) / steps
    (own,) = np.nonzero(slopes)
    return f"{here:.3g}" if len(own) != 1 else shown(here / abs(float(slopes[own[0]])), goals[own[0]])


def _nothing(J: Sequence[Any]) -> list[Any]:
    return []
