"""A problem whose one objective is a function of the objectives of another: a preference, for gradient solves.

Objectives are mostly integrals or peaks, and depend on all of a trajectory. A function of them that is not linear would couple all of it in
its second derivatives, and a maximum of several has none. So the problem gets a further parameter for each objective, and one for each
maximum, which constraints tie to what they stand for; the function is one of these few parameters alone.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, Protocol

import casadi as ca
import numpy as np

from .compiled import CompiledPhase, CompiledProblem, Limit, Objective, Variable
from .sampling import NEGLIGIBLE, refuse_peaks, with_sizes


class Valuation(Protocol):
    """A function of objectives that is minimised; see `macs.preferences.stage.Stage`, which says more."""

    @property
    def name(self) -> str:
        """For messages."""

    @property
    def value(self) -> Callable[[Any, Any], Any]:
        """(objectives, maxima) -> the value, which rises with each of the maxima; objectives in the user's units and senses."""

    @property
    def groups(self) -> Callable[[Any], Any]:
        """objectives -> lists of expressions: the maxima are those of each."""

    @property
    def limits(self) -> Callable[[Any], Any]:
        """objectives -> expressions that may not be positive."""


@dataclass(frozen=True, eq=False)
class ObjectiveBox:
    """Where objectives (m,) are, in the user's units: best and worst as the one who decides sees them, and within which limits they are
    looked for, lower and upper."""

    best: np.ndarray
    worst: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def scales(self) -> np.ndarray:
        """What counts as one in each objective (m,): its range between best and worst."""
        span = np.abs(self.worst - self.best)
        return np.where(span > 0.0, span, np.maximum(np.abs(self.best), 1.0))

    def inner(self) -> np.ndarray:
        """Objectives (m, k) between best and worst."""
        return _inside(np.minimum(self.best, self.worst), np.maximum(self.best, self.worst))

    def outer(self) -> np.ndarray:
        """Objectives (m, k) between lower and upper."""
        return _inside(self.lower, self.upper)

    def not_better(self, signs: np.ndarray) -> np.ndarray:
        """Objectives (m, k) between lower and upper that are not better than the best."""
        return _inside(np.where(signs > 0, self.best, self.lower), np.where(signs > 0, self.upper, self.best))


@dataclass(frozen=True, eq=False)
class Valued:
    """A problem whose one objective is a function of those of another."""

    problem: CompiledProblem  # its objective is 1 + (value - zero) / unit
    original: CompiledProblem
    further: tuple[Variable, ...]  # its further parameters, which come after those of the original
    names: tuple[str, ...]  # names of its objective's objectives: those that the first of the further parameters stand for
    follow: ca.Function  # objectives (m, k), in the user's units -> the further parameters that belong to them
    zero: float  # zero, unit: A value that is nearly the least, and what counts as one in it
    unit: float

    def value(self, objective: float) -> float:
        """The value that belongs to an objective of the problem."""
        return self.zero + self.unit * (objective - 1.0)

    def lifted(self, variables: Sequence[Variable], places: Sequence[Variable], Z: np.ndarray, F: np.ndarray) -> np.ndarray:
        """Vectors (k, n') of the problem, of the variables `places`, from vectors Z (k, n) of the original, of `variables`, with objectives
        F (k, m), all minimised. What follows from an objective that is no number is in the middle of its range."""
        if not len(Z):
            return np.empty((0, len(places)))
        own = {v.name: column for v, column in zip(variables, np.asarray(Z).T, strict=True)}
        values = np.array(self.follow((F * self.original.signs).T)).reshape(len(self.further), len(Z))
        for v, row in zip(self.further, values, strict=True):
            own[v.name] = np.clip(np.where(np.isnan(row), 0.5 * (v.lower + v.upper), row), v.lower, v.upper)
        return np.array([own[v.name] for v in places]).T.reshape(len(Z), len(places))

    def dropped(self, places: Sequence[Variable], variables: Sequence[Variable], z: np.ndarray) -> np.ndarray:
        """The vector (n,) of the original that belongs to one of the problem."""
        own = dict(zip((v.name for v in places), z, strict=True))
        return np.array([own[v.name] for v in variables])

    def at_ends(self, parameters: Mapping[str, float]) -> list[str]:
        """Names of the objectives that are at an end of their range, which the original does not have."""
        return [
            name
            for name, v in zip(self.names, self.further, strict=False)
            if min(parameters[v.name] - v.lower, v.upper - parameters[v.name]) < 1e-3 * v.span
        ]


def valued(
    problem: CompiledProblem, aim: Valuation, box: ObjectiveBox, *, kept: Sequence[tuple[Valuation, float]] = (), zero: float = 0.0
) -> Valued:
    """The problem with a function of its objectives in their place."""
    program = _Program(problem, [aim, *(one for one, _ in kept)], box)
    values, scales, unit = program.values, program.spreads, program.spreads[0]
    objective = 1.0 + (values[0] - zero) / unit
    limits = [
        *program.limits,
        *(Limit(f"value of {one.name}", -np.inf, most, scale) for (one, most), scale in zip(kept, scales[1:], strict=True)),
    ]
    rows = [*program.rows, *values[1:]]
    phases = [ca.MX.sym(f"q{i}", phase.n_quantities) for i, phase in enumerate(problem.phases)]
    parameters = ca.MX.sym("p", len(problem.parameters) + len(program.further))
    given = parameters[: len(problem.parameters)]
    of_objectives = problem.objectives.call([*phases, given], True, False)[0] * problem.signs
    of_constraints = problem.constraints.call([*phases, given], True, False)[0]
    inputs = [*phases, parameters]
    arguments = [of_objectives, parameters[len(problem.parameters) :]]
    symbols = [program.exact, program.symbols]
    inner = ca.Function("rows", symbols, [ca.densify(ca.vertcat(objective)), ca.densify(ca.vertcat(ca.MX(0, 1), *rows))])
    value, found = inner.call(arguments, True, False)
    names = [f"q{i}" for i in range(len(phases))] + ["p"]
    derived = replace(
        problem,
        name=f"{problem.name}: {aim.name}",
        phases=tuple(_with_parameters(phase, len(problem.parameters), len(program.further)) for phase in problem.phases),
        parameters=(*problem.parameters, *program.further),
        goals=(Objective(aim.name, scale=1.0),),
        limits=(*problem.limits, *limits),
        objectives=ca.Function("objectives", inputs, [value], names, ["objectives"]),
        constraints=ca.Function("constraints", inputs, [ca.vertcat(of_constraints, found)], names, ["constraints"]),
        address="",
        data={},
    )
    derived = with_sizes(derived)
    try:
        refuse_peaks(derived)
    except ValueError as error:
        refuse_peaks(problem)
        exactly = ", ".join(f"'{name}'" for name in program.exactly)
        words = "gradient tools can only minimise a peak or bound it above; preference.rank(front) needs no derivatives"
        raise ValueError(f"{aim.name} may ask for a worse value of {exactly} than there need be: {words}") from error
    return Valued(derived, problem, program.further, program.names, program.follow, zero, unit)


class _Program:
    """Functions of the objectives as rows of constraints in a few further parameters.

    `symbols` are these parameters, `exact` the objectives themselves; `rows` has an expression for each of `limits`.
    """

    def __init__(self, problem: CompiledProblem, aims: Sequence[Valuation], box: ObjectiveBox) -> None:
        m = len(problem.goals)
        self.exact = ca.MX.sym("J", m)
        J = [ca.MX.sym(f"J{i}") for i in range(m)]
        groups = [[[ca.MX(one) for one in group] for group in aim.groups(J)] for aim in aims]
        peaks = [[ca.MX.sym(f"peak{k}") for k in range(len(of_aim))] for of_aim in groups]
        self.values = [ca.MX(aim.value(J, own)) for aim, own in zip(aims, peaks, strict=True)]
        below = [[ca.MX(one) for one in aim.limits(J)] for aim in aims]
        flat = [peak for own in peaks for peak in own]
        every = [group for of_aim in groups for group in of_aim]
        members = [one for group in every for one in group]
        bounded = [one for of_aim in below for one in of_aim]
        column = ca.vertcat(*self.values, *members, *bounded)
        used = [i for i in range(m) if ca.depends_on(column, J[i])]
        maxima = [reduce(ca.fmax, group) for group in every]
        whole = list(ca.substitute(self.values, flat, maxima)) if flat else self.values
        rising = _rising(J, [*whole, *bounded], box, problem.signs)
        inner, outer = (_finite(_at(J, maxima, objectives)) for objectives in (box.inner(), box.outer()))
        self.spreads = [_spread(row) for row in _at(J, whole, box.inner())]
        low, high = outer.min(axis=1, initial=np.inf), outer.max(axis=1, initial=-np.inf)
        # A maximum may leave its range among those values by as much as that.
        wide = np.where(high > low, high - low, 1.0)
        self.names = tuple(problem.goals[i].name for i in used)
        self.exactly = [problem.goals[i].name for i in used if not rising[i]]
        taken = {v.name for v in problem.parameters}
        self.further = (
            *(
                Variable(_new(f"value of {goal.name}", taken), box.lower[i], box.upper[i], goal.unit, box.scales[i])
                for i, goal in enumerate(problem.goals)
                if i in used
            ),
            *(
                Variable(_new(f"maximum {k}", taken), low[k] - wide[k], high[k] + wide[k], "", float(np.ptp(inner[k])) or wide[k])
                for k in range(len(flat))
            ),
        )
        self.symbols = ca.MX.sym("further", len(used) + len(flat))
        self.follow = ca.Function("follow", [ca.vertcat(*J)], [ca.vertcat(ca.MX(0, 1), *(J[i] for i in used), *maxima)])
        rows, limits = [], []
        for i in used:
            sign = problem.goals[i].sign
            rows.append(sign * (self.exact[i] - J[i]))
            limits.append(Limit(f"objective '{problem.goals[i].name}'", -np.inf if rising[i] else 0.0, 0.0, box.scales[i]))
        for k, group in enumerate(every):
            rows += [one - flat[k] for one in group]
            limits += [Limit(f"maximum {k}", -np.inf, 0.0, self.further[len(used) + k].scale)] * len(group)
        for aim, of_aim in zip(aims, below, strict=True):
            rows += of_aim
            limits += [Limit(f"limit of {aim.name}", -np.inf, 0.0)] * len(of_aim)
        old = [*(J[i] for i in used), *flat]
        new = [self.symbols[k] for k in range(len(old))]
        # What is not used is in no row: its symbol needs no value.
        self.rows = list(ca.substitute(rows, old, new)) if old else rows
        self.values = list(ca.substitute(self.values, old, new)) if old else self.values
        self.limits = limits


def _with_parameters(phase: CompiledPhase, own: int, more: int) -> CompiledPhase:
    """The phase of a problem with so many more parameters, on which nothing in it depends."""

    def widened(function: ca.Function) -> ca.Function:
        x, u, t, _ = function.mx_in()
        s = ca.MX.sym("s", 2 + own + more)
        value = function.call([x, u, t, s[: 2 + own]], True, False)
        return ca.Function(function.name(), [x, u, t, s], value, function.name_in(), function.name_out())

    names = ("dynamics", "path", "initials", "finals", "integrands", "peaks", "peak_parts", "sizes")
    functions: dict[str, Any] = {name: widened(getattr(phase, name)) for name in names}
    return replace(phase, **functions, switching=None)


def _new(name: str, taken: Container[str]) -> str:
    """A name that is not taken."""
    return name if name not in taken else _new(f"{name}'", taken)


def _rising(J: Sequence[ca.MX], rows: Sequence[ca.MX], box: ObjectiveBox, signs: np.ndarray) -> np.ndarray:
    """Mask (m,) of the objectives, all minimised, with which no row falls where they are not better than what is known to be best: for
    these, a bound from above does as well as the objective itself, and better, since it leaves room."""
    column = ca.vertcat(*rows)
    slopes = [ca.densify(ca.jacobian(column, one)) for one in J]
    found = np.array([_at(J, [of_one], box.not_better(signs)) for of_one in slopes]) * signs[:, None, None]
    found = np.where(np.isfinite(found), found, 0.0)
    return (found >= -NEGLIGIBLE * np.abs(found).max(axis=(1, 2), initial=0.0)[:, None, None]).all(axis=(1, 2))


def _at(J: Sequence[ca.MX], rows: Sequence[ca.MX], objectives: np.ndarray) -> np.ndarray:
    """Values (k, n) of rows at objectives (m, n)."""
    column = ca.densify(ca.vertcat(ca.MX(0, 1), *rows))
    values = ca.Function("values", [ca.vertcat(*J)], [column])(objectives)
    return np.array(values).reshape(column.numel(), objectives.shape[1])


def _finite(rows: np.ndarray) -> np.ndarray:
    """The same rows with the largest number of each in place of what is none."""
    return np.array([np.where(np.isfinite(row), row, row[np.isfinite(row)].max(initial=0.0)) for row in rows]).reshape(rows.shape)


def _spread(values: np.ndarray) -> float:
    """The difference between values that counts as one: the range of the middle four fifths, 1 where that is 0."""
    values = values[np.isfinite(values)]
    spread = float(np.subtract(*np.quantile(values, [0.9, 0.1]))) if len(values) else 0.0
    return spread if spread > 0.0 else 1.0


def _inside(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Values (m, k) between two corners: 512 random ones, and all corners, of at most eight objectives."""
    m = len(lower)
    rng = np.random.default_rng(0)
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * m)).reshape(m, -1) if m <= 8 else np.empty((m, 0))
    # Just inside, where there are no kinks.
    share = np.clip(np.hstack([corners, rng.random((m, 512))]), 1e-6, 1.0 - 1e-6)
    return lower[:, None] + share * (upper - lower)[:, None]
