"""Compiled problems: plain data and named CasADi Functions, no symbols.

Everything above this floor reads a problem through these classes. They pickle, compare by their fingerprint, and never change.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from graphlib import TopologicalSorter
from heapq import heappop, heappush
from inspect import unwrap
from typing import Any, Concatenate, ParamSpec, TypeVar

import casadi as ca
import numpy as np

from .layers import calls_externals, mapped
from .switching import Switching

Owner = TypeVar("Owner", bound="Deriving")
Further = ParamSpec("Further")
Result = TypeVar("Result")


class Deriving:
    """A value that keeps what `remembered` functions compute from it. Pickles and copies begin without."""

    @cached_property
    def derived(self) -> dict[Hashable, Any]:
        """Results by (function, further arguments)."""
        return {}

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "derived"}


def remembered(function: Callable[Concatenate[Owner, Further], Result]) -> Callable[Concatenate[Owner, Further], Result]:
    """A function of a value, and perhaps of further hashable arguments by position, that computes each result once."""

    @wraps(function)
    def once(owner: Owner, *further: Further.args, **none: Further.kwargs) -> Result:
        key = (function, *further)
        if key not in owner.derived:
            owner.derived[key] = function(owner, *further, **none)
        result: Result = owner.derived[key]
        return result

    return once


def computed(
    function: Callable[Concatenate[Owner, Further], Result], owner: Owner, *further: Further.args, **none: Further.kwargs
) -> Result | None:
    """What a `remembered` function has computed already; None if it has not been asked."""
    result: Result | None = owner.derived.get((unwrap(function), *further))
    return result


@dataclass(frozen=True, slots=True)
class Variable:
    """A state, control, parameter or time: its bounds, and how it is shown and scaled.

    `scale` is in the variable's unit: 1 here, the span of the bounds for declared variables. `period` is None unless it is an angle-like
    quantity of which `bounds` are exactly one period. One of several `choices` has the number of its choice as its value, from 0.

    Parameters
    ----------
    name : str
    lower, upper : float
    unit : str
    scale : float
    period : float, optional
    integer : bool
        Whether its values are whole numbers.
    choices : tuple
        What the whole numbers from 0 stand for; empty if they are numbers.

    Examples
    --------
    >>> from problems import load
    >>> problem = load("goddard").compile()
    >>> problem.phases[0].controls[0].name
    'u'
    """

    name: str
    lower: float
    upper: float
    unit: str = ""
    scale: float = 1.0
    period: float | None = None
    # Not in the repr, of which fingerprints are made; see `kinds`.
    integer: bool = field(default=False, repr=False)
    choices: tuple[Any, ...] = field(default=(), repr=False)

    def __hash__(self) -> int:
        return hash(self.name)

    def meant(self, value: float) -> Any:
        """What a value stands for: a float, an int, or one of the choices."""
        if not self.integer or not math.isfinite(value):
            return float(value)
        return self.choices[round(value)] if self.choices else round(value)

    @property
    def span(self) -> float:
        return self.upper - self.lower

    def named(self, name: str) -> Variable:
        """The same under another name."""
        return replace(self, name=name)


def kinds(variables: Sequence[Variable]) -> list[tuple[str, tuple[Any, ...]]]:
    """Names and choices of the variables that are not real; nothing if all are."""
    return [(v.name, v.choices) for v in variables if v.integer]


@dataclass(frozen=True)
class Limit:
    """One named row `lower <= expression <= upper`; an equality where both are the same. Infinite where there is no limit.

    Parameters
    ----------
    name : str
    lower, upper : float
    scale : float
        What counts as one in residuals.
    unit : str
        Of the expression: a label, for tables, pictures and files.

    Examples
    --------
    >>> from problems import Limit
    >>> Limit("speed", 0.0, 5.0, unit="m/s").upper
    5.0
    """

    name: str
    lower: float
    upper: float
    scale: float = 1.0
    # Not in the repr, of which fingerprints are made: fronts from before limits had units still belong to their problems.
    unit: str = field(default="", repr=False)


def verified_scale(limit: Variable | Limit) -> float:
    """What counts as one where a value is verified to be within a limit: its scale, and for an equality or a limit on one side at least the
    size of that, since a default scale knows nothing of it."""
    if np.isfinite(limit.lower) and np.isfinite(limit.upper) and limit.lower < limit.upper:
        return limit.scale
    return max(limit.scale, *(abs(side) for side in (limit.lower, limit.upper) if np.isfinite(side)))


@dataclass(frozen=True)
class Objective:
    """A named objective as the user stated it; the compiled function returns `sign` times its value, which is always minimised.

    Parameters
    ----------
    name, unit : str
    sense : "minimize" or "maximize"
    scale : float, optional
        The difference that counts as one.

    Examples
    --------
    >>> from problems import load
    >>> problem = load("goddard").compile()
    >>> problem.goals[1].sense
    'maximize'
    """

    name: str
    unit: str = ""
    sense: str = "minimize"
    scale: float | None = None

    @property
    def sign(self) -> float:
        return 1.0 if self.sense == "minimize" else -1.0


@dataclass(frozen=True)
class Link:
    """`tf` and the final `states` of phase `first` are `t0` and the initial states of phase `second` (indices of phases).

    Parameters
    ----------
    first, second : int
    states : tuple of str

    Examples
    --------
    >>> from problems import load
    >>> load("standard/delta_iii").compile().links[0].first
    0
    """

    first: int
    second: int
    states: tuple[str, ...]


def in_time(count: int, links: Sequence[Link]) -> list[int]:
    """Indices of so many phases, each after those that lead into it; otherwise as declared. Raises CycleError if links close a circle."""
    sorter = TopologicalSorter[int](dict.fromkeys(range(count), ()))
    for link in links:
        sorter.add(link.second, link.first)
    sorter.prepare()
    ready: list[int] = []
    order = []
    while sorter.is_active():
        for i in sorter.get_ready():
            heappush(ready, i)
        order.append(heappop(ready))
        sorter.done(order[-1])
    return order


@dataclass(frozen=True, eq=False, repr=False)
class CompiledPhase(Deriving):
    """One phase as plain data and Functions.

    Every Function takes `(x, u, t, s)`: states (nx), controls (nu), time, and `s = [t0, tf, *parameters]`. `dynamics` returns the rates
    (nx) per `time_unit`; `path`, `initials`, `finals`, `integrands`, `peaks` return columns, one row for each expression of that kind.

    Attributes
    ----------
    name, time_unit : str
    t0, tf : Variable
    states, controls : tuple of Variable
    paths : tuple of Limit

    Examples
    --------
    >>> from problems import load
    >>> problem = load("goddard").compile()
    >>> problem.phases[0].name, len(problem.phases[0].states)
    ('ascent', 4)
    """

    name: str
    time_unit: str
    t0: Variable
    tf: Variable
    duration: tuple[float, float]
    states: tuple[Variable, ...]
    controls: tuple[Variable, ...]
    initial: tuple[tuple[float, float], ...]
    """Range of each state at t0; equal ends where the state is fixed."""
    final: tuple[tuple[float, float], ...]
    paths: tuple[Limit, ...]
    guesses: Mapping[str, Any]
    """By name (states, controls, "t0", "tf"): a number, a pair, or a pair of arrays (times, values)."""
    dynamics: ca.Function
    path: ca.Function
    initials: ca.Function
    finals: ca.Function
    integrands: ca.Function
    peaks: ca.Function
    peak_parts: ca.Function
    """Expressions without kinks, the greatest of which peaks are, ..."""
    peak_of: tuple[int, ...]
    """... and the row of `peaks` that each of them belongs to."""
    sizes: ca.Function
    """Expressions whose absolute values, or roots, are integrands, ..."""
    sized: tuple[int, ...]
    """... and which rows of `integrands` these are, as far as they are minimised or bounded above only; ..."""
    roots: tuple[bool, ...] = ()
    """... whether they are roots, ..."""
    size_scales: tuple[float, ...] = ()
    """... and how large they mostly are within the bounds."""
    switching: Switching | None = None
    """Where rates, integrands, path constraints or peaks may jump."""
    corners: tuple[float, ...] = ()
    """Times at which tables of time have corners, if the phase's own times are fixed."""

    def __repr__(self) -> str:
        names = ([v.name for v in group] for group in (self.states, self.controls))
        return "CompiledPhase('{}', states=[{}], controls=[{}])".format(self.name, *(", ".join(group) for group in names))

    @property
    def n_quantities(self) -> int:
        """Length of the column `q` that objectives and constraints see: t0, tf, initials, finals, integrals, peaks."""
        return 2 + sum(f.size1_out(0) for f in (self.initials, self.finals, self.integrands, self.peaks))


@dataclass(frozen=True, eq=False, repr=False)
class CompiledProblem(Deriving):
    """A whole problem. `objectives` and `constraints` take `(q of phase 1, ..., q of phase n, parameters)`.

    `objectives` returns the column that is minimised (m); `constraints` the column that `limits` bounds.

    Attributes
    ----------
    name : str
    phases : tuple of CompiledPhase
    parameters : tuple of Variable
    goals : tuple of Objective
    limits : tuple of Limit
    links : tuple of Link

    Examples
    --------
    >>> from problems import load
    >>> problem = load("goddard").compile()
    >>> [goal.name for goal in problem.goals]
    ['flight time', 'horizontal speed']
    """

    name: str
    phases: tuple[CompiledPhase, ...]
    parameters: tuple[Variable, ...]
    guesses: Mapping[str, float]
    goals: tuple[Objective, ...]
    limits: tuple[Limit, ...]
    links: tuple[Link, ...]
    objectives: ca.Function
    constraints: ca.Function
    address: str = ""
    """The name or address that `problems.load` made it from; empty for a problem built in a script."""
    data: Mapping[str, Any] = field(default_factory=dict)
    """The keyword arguments that `problems.load` was given."""

    def __repr__(self) -> str:
        phases, goals = (", ".join(one.name for one in group) for group in (self.phases, self.goals))
        return f"CompiledProblem('{self.name}', phases=[{phases}], objectives=[{goals}])"

    def compile(self) -> CompiledProblem:
        """Itself: so that every function of a Problem takes a compiled one as well."""
        return self

    @property
    def signs(self) -> np.ndarray:
        """+1 for a minimised, -1 for a maximised objective, shape (m,)."""
        return np.array([goal.sign for goal in self.goals])

    @property
    def order_in_time(self) -> list[int]:
        """Indices of the phases, each after those that lead into it; otherwise as declared."""
        return in_time(len(self.phases), self.links)

    @cached_property
    def fingerprint(self) -> str:
        """A hash of everything that decides what the problem's trajectories are: two problems with the same one are the same.

        Of each Function it takes the operations and the values at fixed points, to nine digits. Its serialised form would not do: that of
        a table changes once its derivatives are asked for.
        """
        digest = hashlib.sha256()
        digest.update(repr((self.name, self.parameters, self.goals, self.limits, self.links, *kinds(self.parameters))).encode())
        for phase in self.phases:
            digest.update(repr((phase.name, phase.time_unit, phase.t0, phase.tf, phase.duration, phase.states, phase.controls)).encode())
            digest.update(repr((phase.initial, phase.final, phase.paths)).encode())
            groups = [phase.states, phase.controls, (phase.tf,), (phase.t0, phase.tf, *self.parameters)]
            inputs = [[(v.lower, v.upper) for v in group] for group in groups]
            for function in (phase.dynamics, phase.path, phase.initials, phase.finals, phase.integrands, phase.peaks):
                digest.update(_essence(function, inputs))
        for function in (self.objectives, self.constraints):
            digest.update(_essence(function, [[(-1.0, 1.0)] * function.size1_in(i) for i in range(function.n_in())]))
        return digest.hexdigest()[:32]


def _essence(function: ca.Function, ranges: Sequence[Sequence[tuple[float, float]]]) -> bytes:
    """The identity of a Function: its operations, and its values at fixed points within the ranges of its inputs."""
    rng = np.random.default_rng(0)
    points = [np.array([rng.uniform(*limits, 64) for limits in group]).reshape(-1, 64) for group in ranges]
    values = np.array(mapped(function, 64)(*points)) if function.size1_out(0) else np.empty(0)
    text = "external" if calls_externals(function) else function.str(True)
    return text.encode() + " ".join(f"{value:.8e}" for value in values.ravel()).encode()


def vector_function(name: str, groups: Mapping[str, Sequence[ca.MX]], expressions: Sequence[ca.MX]) -> ca.Function:
    """A Function that takes one vector a group of scalar symbols and returns the column of expressions."""
    inputs = [ca.MX.sym(word, len(symbols)) for word, symbols in groups.items()]
    scalars = [symbol for symbols in groups.values() for symbol in symbols]
    entries = [vector[i] for vector, symbols in zip(inputs, groups.values(), strict=True) for i in range(len(symbols))]
    column = ca.vertcat(*expressions) if expressions else ca.MX(0, 1)
    (column,) = ca.substitute([ca.densify(column)], scalars, entries)
    function = ca.Function(name, inputs, [column], list(groups), [name])
    # In one graph, so that externals in it are found at once.
    return ca.Function(name, inputs, [column], list(groups), [name], {"always_inline": True}) if calls_externals(function) else function
