"""Judgements of expressions by their values and slopes at samples within the bounds.

Expressions that are no numbers anywhere: a division by zero, the root of something negative, a NaN among the user's data. And permitted
uses of peaks, and of integrals of absolute values, where derivatives are used: the maximum over time is no smooth function, but a number
not below any value is as good, as long as it pays to make it small. So a peak may be minimised or bounded above. In the same way a number
that is below neither a value nor its negative stands for the absolute value in an integral.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from .absolute import terms
from .compiled import CompiledPhase, CompiledProblem, Limit, Variable, remembered
from .externals import reraise
from .layers import check_externals, mapped

FEW, MOST = 64, 2048
"""Samples: as many as do where each expression is a number at one of them, and the most."""
NEARLY = 1e-4
"""Part of its value at bounds of the controls up to which a radicand is nothing where there are none: its root has a kink there."""
NEGLIGIBLE = 1e-9
"""Part of the largest value, or slope, up to which a difference is rounding."""
Labels = Mapping[str, Sequence[str]]


def samples(problem: CompiledProblem, labels: Sequence[Labels] | None = None) -> list[np.ndarray]:
    """Samples of the arguments of objectives and constraints: columns of quantities of each phase and of parameters, (size, FEW) each.

    Raises a ValueError that names an expression, by the labels of its phase's Functions, which is not a finite number wherever we look
    within the bounds.
    """
    if labels is None:
        names = ("dynamics", "path", "initials", "finals", "integrands", "peaks")
        labels = [{name: [name] * getattr(phase, name).size1_out(0) for name in names} for phase in problem.phases]
    p, draws = _drawn(problem)
    with suppress(ValueError):
        return _checked(problem, labels, p, draws, FEW)
    return [values[:, :FEW] for values in _checked(problem, labels, p, draws, MOST)]


@remembered
def objective_spreads(problem: CompiledProblem) -> np.ndarray:
    """How much each objective (m,) varies within the bounds: the median distance from its median, 1 where that is 0."""
    values = np.array(problem.objectives(*samples(problem)))
    values = np.where(np.isfinite(values), values, 0.0)
    spread = np.median(np.abs(values - np.median(values, axis=1, keepdims=True)), axis=1)
    return np.where(spread > 0.0, spread, 1.0)


def objective_sizes(problem: CompiledProblem, quantities: Sequence[np.ndarray], parameters: Mapping[str, float]) -> np.ndarray:
    """The sizes of the terms of each objective, added up, (m,), from a column of quantities of each phase."""
    return np.array(_sizes(problem)(*quantities, np.array([parameters[v.name] for v in problem.parameters]))).ravel()


@remembered
def _sizes(problem: CompiledProblem) -> ca.Function:
    """Function of the arguments of the objectives: the sizes of the terms of each, added up."""
    inputs = problem.objectives.mx_in()
    (column,) = problem.objectives.call(inputs, True, False)
    rows = [column.dep(i) for i in range(column.n_dep())] if column.is_op(ca.OP_VERTCAT) else [column]
    sizes = [sum((abs(factor) * ca.fabs(term) for factor, term in terms(row)), ca.MX(0)) for row in rows]
    return ca.Function("sizes", inputs, [ca.vertcat(*sizes)])


def _checked(problem: CompiledProblem, labels: Sequence[Labels], p: np.ndarray, draws: Sequence[_Draw], count: int) -> list[np.ndarray]:
    """The first `count` samples. Raises ValueError if an expression is a number at none of them."""
    found = _all_quantities(problem, labels, p, draws, count)
    place = f"of problem '{problem.name}'"
    _finite(problem.objectives, found, [f"objective '{goal.name}' {place}" for goal in problem.goals])
    _finite(problem.constraints, found, [f"constraint '{limit.name}' {place}" for limit in problem.limits])
    return found


def _all_quantities(
    problem: CompiledProblem, labels: Sequence[Labels], p: np.ndarray, draws: Sequence[_Draw], count: int
) -> list[np.ndarray]:
    """Samples of the arguments of objectives and constraints."""
    phases = zip(problem.phases, labels, draws, strict=True)
    return [*(_quantities(phase, words, p, draw, count) for phase, words, draw in phases), p[:, :count]]


def check_links(problem: CompiledProblem, labels: Sequence[Labels]) -> None:
    """Raise a ValueError that names a constraint which only links make impossible, such as a jump of a state that a link continues."""
    if not (problem.links and problem.limits):
        return
    p, draws = _drawn(problem)
    apart = draws.copy()
    for link in sorted(problem.links, key=lambda link: problem.order_in_time.index(link.first)):
        names = [[state.name for state in problem.phases[i].states] for i in (link.first, link.second)]
        first = draws[link.second].first.copy()
        for name in link.states:
            first[names[1].index(name)] = draws[link.first].last[names[0].index(name)]
        draws[link.second] = replace(draws[link.second], t0=draws[link.first].tf, first=first)
    try:
        free, linked = (np.array(problem.constraints(*_all_quantities(problem, labels, p, one, FEW))) for one in (apart, draws))
    except ValueError:  # few samples are not enough to find numbers, so they say nothing
        return
    for limit, before, values in zip(problem.limits, free, linked, strict=True):
        same = np.ptp(values) <= NEGLIGIBLE * max(np.ptp(before), np.abs(values).max())
        if (
            same
            and np.ptp(before) > 0.0
            and not limit.lower - limit.scale * NEGLIGIBLE <= values[0] <= limit.upper + limit.scale * NEGLIGIBLE
        ):
            wanted = f"at least {limit.lower:g}" if values[0] < limit.lower else f"at most {limit.upper:g}"
            raise ValueError(
                f"constraint '{limit.name}' of problem '{problem.name}' is {values[0]:g} wherever the links hold, and must be {wanted}: "
                "a link continues all states that both phases have; name those that do: link(first, second, states=[...])"
            )


@dataclass(frozen=True)
class _Draw:
    """Samples of one phase: times, shares of the way, states at both ends and in between, controls; (size, MOST) each."""

    t0: np.ndarray
    tf: np.ndarray
    share: np.ndarray
    first: np.ndarray
    last: np.ndarray
    inside: np.ndarray
    controls: np.ndarray


def _drawn(problem: CompiledProblem) -> tuple[np.ndarray, list[_Draw]]:
    """Samples of the parameters, and of each phase, from the same seed."""
    rng = np.random.default_rng(0)
    p = _between(rng, problem.parameters)
    return p, [_phase_drawn(phase, rng) for phase in problem.phases]


def _phase_drawn(phase: CompiledPhase, rng: np.random.Generator) -> _Draw:
    t0, tf = _between(rng, [phase.t0]), _between(rng, [phase.tf])
    tf = np.where(tf > t0, tf, np.minimum(t0 + phase.duration[0], phase.tf.upper))
    share = rng.random(MOST)
    first, last = _within(rng, phase.initial), _within(rng, phase.final)
    # Half of the samples anywhere in the box, half of them near the ways from the initial to the final states.
    inside = np.where(np.arange(MOST) % 2, _between(rng, phase.states), first + share * (last - first))
    return _Draw(t0, tf, share, first, last, inside, _between(rng, phase.controls))


def _quantities(phase: CompiledPhase, labels: Labels, p: np.ndarray, draw: _Draw, count: int) -> np.ndarray:
    """Samples of a phase's quantities, shape (n_quantities, count)."""
    t0, tf, u, s = draw.t0, draw.tf, draw.controls, np.vstack([draw.t0, draw.tf, p])

    def values(function: ca.Function, *inputs: np.ndarray) -> np.ndarray:
        return _finite(function, [one[:, :count] for one in inputs], labels[function.name()])

    along = draw.inside, u, t0 + draw.share * (tf - t0), s
    values(phase.dynamics, *along)
    values(phase.path, *along)
    initials, finals = values(phase.initials, draw.first, u, t0, s), values(phase.finals, draw.last, u, tf, s)
    integrals = values(phase.integrands, *along) * (tf - t0)[:, :count]
    return np.vstack([t0[:, :count], tf[:, :count], initials, finals, integrals, values(phase.peaks, *along)])


def _between(rng: np.random.Generator, variables: Sequence[Variable]) -> np.ndarray:
    return _within(rng, [(v.lower, v.upper) for v in variables])


def _within(rng: np.random.Generator, ranges: Sequence[tuple[float, float]]) -> np.ndarray:
    lower, upper = np.array(ranges, dtype=float).reshape(-1, 2, 1).transpose(1, 0, 2)
    return lower + rng.random((len(ranges), MOST)) * (upper - lower)


def _finite(function: ca.Function, inputs: Sequence[np.ndarray], labels: Sequence[str]) -> np.ndarray:
    """Values of a Function (rows, count); those that are no numbers replaced by others of the same row."""
    if not labels:
        return np.empty((0, inputs[0].shape[1]))
    check_externals(function, inputs)
    values = np.array(mapped(function, inputs[0].shape[1])(*inputs))
    reraise()
    for label, row in zip(labels, values, strict=True):
        good = np.isfinite(row)
        if not good.any():
            raise ValueError(f"{label} is not a finite number anywhere within the bounds")
        row[~good] = np.resize(row[good], np.count_nonzero(~good))
    return values


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
    """The problem with those `sizes` only, of which the integral is minimised or bounded above and not used otherwise; of roots, those of
    what nearly vanishes without controls."""
    if not any(phase.sized for phase in problem.phases):
        return problem
    points = samples(problem)
    first = [2 + phase.initials.size1_out(0) + phase.finals.size1_out(0) for phase in problem.phases]
    columns = [at + np.array(phase.sized, dtype=int) for at, phase in zip(first, problem.phases, strict=True)]
    wrong = {(i, column - first[i]) for _, _, i, column in _wrong(problem, columns, points)}
    phases = []
    for i, phase in enumerate(problem.phases):
        kinks = _kinks(phase, problem.parameters)
        kept = [k for k, row in enumerate(phase.sized) if (i, row) not in wrong and kinks[k]]
        inputs = phase.sizes.mx_in()
        sizes = ca.Function("sizes", inputs, [phase.sizes(*inputs)[kept, :]], phase.sizes.name_in(), ["sizes"])
        duration = points[i][1] - points[i][0]
        scales = [float(np.median(points[i][columns[i][k]] / duration)) or 1.0 for k in kept]
        sized, roots = tuple(phase.sized[k] for k in kept), tuple(phase.roots[k] for k in kept)
        phases.append(replace(phase, sizes=sizes, sized=sized, roots=roots, size_scales=tuple(scales)))
    return replace(problem, phases=tuple(phases))


def _kinks(phase: CompiledPhase, parameters: Sequence[Variable]) -> np.ndarray:
    """Mask of the phase's `sizes` that are no roots, or roots that without controls are nearly nothing, in the middle of all else."""
    groups = (phase.states, (phase.t0,), (phase.t0, phase.tf, *parameters))
    x, t, s = (np.array([0.5 * (v.lower + v.upper) for v in group]) for group in groups)
    lower, upper = (np.array([getattr(v, side) for v in phase.controls]) for side in ("lower", "upper"))
    none, *most = (np.array(phase.sizes(x, u, t, s)).ravel() for u in (np.clip(0.0, lower, upper), lower, upper))
    return ~np.array(phase.roots, dtype=bool) | (none <= NEARLY * np.max(most, axis=0))


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
