"""What may be done with a peak where derivatives are used.

The maximum over time is no smooth function, but a number not below any value is as good, as long as it pays to make it small: a peak may
be minimised or bounded above.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from .compiled import CompiledProblem
from .sanity import samples

HINT = "; a minimum over time is -peak(-expr)"
NEGLIGIBLE = 1e-9
"""Slopes of the wrong sign up to this, relative to the largest slope, are rounding."""


def refuse_peaks(problem: CompiledProblem) -> None:
    """Raise a ValueError that names an objective or a constraint in which a peak is used otherwise, and the peak's phase.

    Looked at are the signs of derivatives at points all over the ranges of what objectives and constraints see.
    """
    if not any(phase.peaks.size1_out(0) for phase in problem.phases):
        return
    points = samples(problem)
    for row, phase in _wrong(problem, problem.objectives, points, np.full(len(problem.goals), True), np.full(len(problem.goals), False)):
        goal = problem.goals[row]
        raise ValueError(
            f"objective '{goal.name}' of problem '{problem.name}' improves when a peak of phase '{phase}' rises: gradient tools can only "
            f"minimise a peak or bound it above{HINT}"
        )
    above, below = (np.isfinite([getattr(limit, side) for limit in problem.limits]) for side in ("upper", "lower"))
    for row, phase in _wrong(problem, problem.constraints, points, above, below):
        limit = problem.limits[row]
        raise ValueError(
            f"constraint '{limit.name}' of problem '{problem.name}' can be met by a rise of a peak of phase '{phase}': gradient tools can "
            f"only minimise a peak or bound it above{HINT}"
        )


def _wrong(
    problem: CompiledProblem, function: ca.Function, points: list[np.ndarray], above: np.ndarray, below: np.ndarray
) -> Iterator[tuple[int, str]]:
    """Row and phase name wherever a row that is held down by `above` falls, or one held up by `below` rises, with a peak."""
    if not len(above):
        return
    inputs = [ca.MX.sym(f"v{k}", function.size1_in(k)) for k in range(function.n_in())]
    value = function(*inputs)
    for i, phase in enumerate(problem.phases):
        count, size = phase.peaks.size1_out(0), phase.n_quantities
        if not count:
            continue
        slopes = ca.densify(ca.jacobian(value, inputs[i])[:, size - count :])
        flat = np.array(ca.Function("slopes", inputs, [ca.vec(slopes)])(*points))
        found = flat.reshape(count, len(above), -1)
        found = np.where(np.isfinite(found), found, 0.0)
        rounding = NEGLIGIBLE * np.abs(found).max(axis=2, initial=0.0)
        falls, rises = found.min(axis=2) < -rounding, found.max(axis=2) > rounding
        for _, row in np.argwhere((falls & above) | (rises & below)):
            yield int(row), phase.name
