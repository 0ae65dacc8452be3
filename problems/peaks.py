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

from .compiled import CompiledProblem
from .sanity import samples

HINT = "; a minimum over time is -peak(-expr)"
NEGLIGIBLE = 1e-9
"""Slopes of the wrong sign up to this, relative to the largest slope, are rounding."""


def refuse_peaks(problem: CompiledProblem) -> None:
    """Raise a ValueError that names an objective or a constraint in which a peak is used otherwise, and the peak's phase.

    By the signs of derivatives at points all over the ranges of their arguments.
    """
    if not any(phase.peaks.size1_out(0) for phase in problem.phases):
        return
    points = samples(problem)
    peaks = [np.arange(phase.n_quantities - phase.peaks.size1_out(0), phase.n_quantities) for phase in problem.phases]
    for row, i, _ in _wrong(problem, problem.objectives, peaks, points, *_objectives(problem)):
        raise ValueError(
            f"objective '{problem.goals[row].name}' of problem '{problem.name}' improves when a peak of phase '{problem.phases[i].name}' "
            f"rises: gradient tools can only minimise a peak or bound it above{HINT}"
        )
    for row, i, _ in _wrong(problem, problem.constraints, peaks, points, *_constraints(problem)):
        raise ValueError(
            f"constraint '{problem.limits[row].name}' of problem '{problem.name}' can be met by a rise of a peak of phase "
            f"'{problem.phases[i].name}': gradient tools can only minimise a peak or bound it above{HINT}"
        )


def with_sizes(problem: CompiledProblem) -> CompiledProblem:
    """The problem with those `sizes` only, of which the integral is minimised or bounded above and not used otherwise."""
    if not any(phase.sized for phase in problem.phases):
        return problem
    points = samples(problem)
    first = [2 + phase.initials.size1_out(0) + phase.finals.size1_out(0) for phase in problem.phases]
    columns = [at + np.array(phase.sized, dtype=int) for at, phase in zip(first, problem.phases, strict=True)]
    wrong = {
        (i, column - first[i])
        for function, signs in ((problem.objectives, _objectives(problem)), (problem.constraints, _constraints(problem)))
        for _, i, column in _wrong(problem, function, columns, points, *signs)
    }
    phases = []
    for i, phase in enumerate(problem.phases):
        kept = [k for k, row in enumerate(phase.sized) if (i, row) not in wrong]
        inputs = phase.sizes.mx_in()
        sizes = ca.Function("sizes", inputs, [phase.sizes(*inputs)[kept]], phase.sizes.name_in(), ["sizes"])
        duration = points[i][1] - points[i][0]
        scales = [float(np.median(points[i][columns[i][k]] / duration)) or 1.0 for k in kept]
        phases.append(replace(phase, sizes=sizes, sized=tuple(phase.sized[k] for k in kept), size_scales=tuple(scales)))
    return replace(problem, phases=tuple(phases))


def _objectives(problem: CompiledProblem) -> tuple[np.ndarray, np.ndarray]:
    """Which rows are limited from above, and which from below."""
    return np.full(len(problem.goals), True), np.full(len(problem.goals), False)


def _constraints(problem: CompiledProblem) -> tuple[np.ndarray, np.ndarray]:
    above, below = (np.isfinite([getattr(limit, side) for limit in problem.limits]) for side in ("upper", "lower"))
    return above, below


def _wrong(
    problem: CompiledProblem,
    function: ca.Function,
    columns: Sequence[np.ndarray],
    points: list[np.ndarray],
    above: np.ndarray,
    below: np.ndarray,
) -> Iterator[tuple[int, int, int]]:
    """Row, phase and column wherever a row that is limited from above falls, or one limited from below rises, with one of the
    `columns` of a phase's quantities."""
    if not len(above):
        return
    inputs = [ca.MX.sym(f"v{k}", function.size1_in(k)) for k in range(function.n_in())]
    value = function(*inputs)
    for i, chosen in enumerate(columns):
        count = len(chosen)
        if not count:
            continue
        slopes = ca.densify(ca.jacobian(value, inputs[i])[:, chosen.tolist()])
        flat = np.array(ca.Function("slopes", inputs, [ca.vec(slopes)])(*points))
        found = flat.reshape(count, len(above), -1)
        found = np.where(np.isfinite(found), found, 0.0)
        rounding = NEGLIGIBLE * np.abs(found).max(axis=2, initial=0.0)
        falls, rises = found.min(axis=2) < -rounding, found.max(axis=2) > rounding
        for k, row in np.argwhere((falls & above) | (rises & below)):
            yield int(row), i, int(chosen[k])
