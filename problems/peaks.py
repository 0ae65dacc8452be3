"""Permitted uses of peaks, and of integrals of absolute values, where derivatives are used.

The maximum over time is no smooth function, but a number not below any value is as good, as long as it pays to make it small: a peak may
be minimised or bounded above. In the same way a number that is below neither a value nor its negative stands for the absolute value in an
integral.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from .compiled import CompiledProblem, Limit
from .sanity import samples

NEGLIGIBLE = 1e-9
"""Slopes of the wrong sign up to this, relative to the largest slope, are rounding."""


def refuse_peaks(problem: CompiledProblem) -> None:
    """Raise a ValueError that names an objective or a constraint in which a peak is used otherwise, and the peak's phase.

    By the signs of derivatives at points all over the ranges of their arguments.
    """
    if not any(phase.peaks.size1_out(0) for phase in problem.phases):
        return
    peaks = [np.arange(phase.n_quantities - phase.peaks.size1_out(0), phase.n_quantities) for phase in problem.phases]
    for function, row, i, _ in _wrong(problem, peaks, samples(problem)):
        peak = f"a peak of phase '{problem.phases[i].name}'"
        if function is problem.objectives:
            what = f"objective '{problem.goals[row].name}' of problem '{problem.name}' improves when {peak} rises"
        else:
            what = f"constraint '{problem.limits[row].name}' of problem '{problem.name}' can be met by a rise of {peak}"
        raise ValueError(f"{what}: gradient tools can only minimise a peak or bound it above; a minimum over time is -peak(-expr)")


def with_sizes(problem: CompiledProblem) -> CompiledProblem:
    """The problem with those `sizes` only, of which the integral is minimised or bounded above and not used otherwise."""
    if not any(phase.sized for phase in problem.phases):
        return problem
    points = samples(problem)
    first = [2 + phase.initials.size1_out(0) + phase.finals.size1_out(0) for phase in problem.phases]
    columns = [at + np.array(phase.sized, dtype=int) for at, phase in zip(first, problem.phases, strict=True)]
    wrong = {(i, column - first[i]) for _, _, i, column in _wrong(problem, columns, points)}
    phases = []
    for i, phase in enumerate(problem.phases):
        kept = [k for k, row in enumerate(phase.sized) if (i, row) not in wrong]
        inputs = phase.sizes.mx_in()
        sizes = ca.Function("sizes", inputs, [phase.sizes(*inputs)[kept, :]], phase.sizes.name_in(), ["sizes"])
        duration = points[i][1] - points[i][0]
        scales = [float(np.median(points[i][columns[i][k]] / duration)) or 1.0 for k in kept]
        phases.append(replace(phase, sizes=sizes, sized=tuple(phase.sized[k] for k in kept), size_scales=tuple(scales)))
    return replace(problem, phases=tuple(phases))


def _wrong(
    problem: CompiledProblem, columns: Sequence[np.ndarray], points: list[np.ndarray]
) -> Iterator[tuple[ca.Function, int, int, int]]:
    """Function, row, phase and column wherever a row that is limited from above falls, or one limited from below rises, with one of the
    `columns` of a phase's quantities."""
    objectives = [Limit(goal.name, -np.inf, 0.0) for goal in problem.goals]
    for function, limits in ((problem.objectives, objectives), (problem.constraints, problem.limits)):
        above, below = (np.isfinite([getattr(limit, side) for limit in limits]) for side in ("upper", "lower"))
        inputs = function.mx_in()
        for i, chosen in enumerate(columns):
            if not len(limits) or not len(chosen):
                continue
            slopes = ca.densify(ca.jacobian(function(*inputs), inputs[i])[:, chosen.tolist()])
            flat = np.array(ca.Function("slopes", inputs, [ca.vec(slopes)])(*points))
            found = flat.reshape(len(chosen), len(limits), -1)
            found = np.where(np.isfinite(found), found, 0.0)
            rounding = NEGLIGIBLE * np.abs(found).max(axis=2, initial=0.0)
            falls, rises = found.min(axis=2) < -rounding, found.max(axis=2) > rounding
            for k, row in np.argwhere((falls & above) | (rises & below)):
                yield function, int(row), i, int(chosen[k])
