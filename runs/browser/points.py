"""A front as plain data: its points as columns, and what is shown of one point once it is selected."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from macs.front import Front
from macs.fronts.point import Point
from macs.fronts.tables import footer, headline
from problems.compiled import Objective

from .curves import curves

SAMPLES, LEAST_SAMPLES = 400, 48
"""Largest number of samples of a curve: in a page with few points, and in one with many."""
NUMBERS = 3_000_000
"""Numbers that all curves of a page may have together, about."""


def samples_of(fronts: Sequence[Front]) -> int:
    """How many samples a curve may have in a page with all points of these fronts."""
    count = sum(map(len, fronts))
    width = max((_width(front) for front in fronts), default=1)
    return int(np.clip(NUMBERS // max(count * width, 1), LEAST_SAMPLES, SAMPLES))


def _width(front: Front) -> int:
    """Number of curves that a point has."""
    for trajectory, costates in zip(front.trajectories, front.costates, strict=True):
        if trajectory is not None:
            adjoint = 0 if costates is None else 1 + max(len(phase) for phase in costates.values())
            return sum(len(phase.names) + adjoint for phase in trajectory.phases)
    return 1


def goals_data(goals: Sequence[Objective]) -> list[dict[str, Any]]:
    """Name, unit and sense of each objective."""
    return [{"name": goal.name, "unit": goal.unit, "sense": goal.sense} for goal in goals]


def columns(front: Front) -> dict[str, Any]:
    """The points of a front as columns, numbers in full; None for what is not known.

    "objectives" and "simulated" have a column for each objective, in the user's units and senses. "verified" is True, False or None: not
    simulated. "defect", "violation", "simulated_violation", "optimality" and "status" are as those of a `Point`.
    """
    was = front.was_simulated
    return {
        "count": len(front),
        "objectives": [_numbers(column) for column in front.objectives.T],
        "simulated": [_numbers(column * sign) for column, sign in zip(front.simulated_F.T, front.signs, strict=True)],
        "verified": [bool(mark) if known else None for mark, known in zip(front.verified, was, strict=True)],
        "violation": _numbers(front.violation),
        "defect": _numbers(front.defect),
        "simulated_violation": _numbers(front.simulated_violation),
        "optimality": list(front.optimality),
        "status": front.status.tolist(),
    }


def details(front: Front, samples: int) -> list[dict[str, Any]]:
    """What is shown of each point once it is selected; see `detail`."""
    return [detail(point, samples) for point in front]


def detail(point: Point, samples: int) -> dict[str, Any]:
    """Of one point its note, weights, parameters (of a point without trajectory all variables), residuals by constraint, excesses between
    nodes, and its trajectory as `curves`."""
    known = {variable.name: variable for variable in point.variables}
    parameters = []
    for name, value in point.parameters.items():
        variable = known.get(name)
        bounds = {} if variable is None else {"unit": variable.unit, "lower": variable.lower, "upper": variable.upper}
        parameters.append({"name": name, "value": value, **bounds})
    trajectory = point.trajectory
    return {
        "note": point.note,
        "weights": None if point.weights is None else list(point.weights.values()),
        "parameters": parameters,
        "violations": point.violations,
        "excursions": point.excursions or {},
        "phases": [] if trajectory is None else curves(trajectory, point.costates, samples),
    }


def about(front: Front) -> dict[str, Any]:
    """The lines above and below the table of a front, and what the points may miss when they are simulated."""
    below = footer(front) if len(front) else [front.message or "There is no point."]
    return {"headline": headline(front), "footer": below, "tolerance": front.stats.get("verify"), "dynamic": front.dynamic}


def _numbers(values: np.ndarray) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]
