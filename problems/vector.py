"""Vector problems: named variables, objectives and constraints, computed by one function of batches of rows.

Everything above this floor reads a vector problem through `CompiledVectorProblem`, whether a user stated it by name, as a plain function,
or in another library.
"""

from __future__ import annotations

import hashlib
import math
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any, NoReturn, TypeVar

import numpy as np

from . import checks
from .compiled import Limit, Objective, Variable, kinds
from .limited import LimitedRows


def without_dynamics(name: str) -> str:
    """The reason why a vector problem is refused where dynamics or derivatives are needed."""
    return f"'{name}' is a vector problem, which has no dynamics and no derivatives"


def filled(found: Sequence[Row], columns: Sequence[int], first: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows together, NaN where they failed; where all did, there must be known numbers of `columns`. The `first` in words."""
    columns = next((tuple(part.shape[1] for part in one) for one in found if not isinstance(one, str)), columns)
    if not columns:
        raise ValueError(f"the function failed at all designs; {found[0]}, at {first}")
    none = tuple(np.full((1, count), np.nan) for count in columns)
    values, bounded = zip(*(none if isinstance(one, str) else one for one in found), strict=True)
    return np.vstack(values), np.vstack(bounded)


def is_of_statement(error: BaseException) -> bool:
    """Whether it was raised where what a function returned is checked, and not by that function."""
    module = [*traceback.walk_tb(error.__traceback__)][-1][0].f_globals.get("__name__", "")
    return module in (__name__, "macs.evaluation.blackbox")


Outputs = Callable[[np.ndarray], Mapping[str, Any]]
Kind = TypeVar("Kind", bound=Outputs)
SAMPLED = 8
"""Number of rows at which a function is evaluated to know it: few, since one may take long."""
Row = tuple[np.ndarray, np.ndarray] | str  # what a function gives for one row, (1, m) and (1, c), or why it failed
Rows = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""`rows(X: (n, d)) -> (objectives (n, m) in the user's senses, values (n, c) that the limits bound)`."""


def real_numbers(values: Any) -> np.ndarray:
    """A copy, as floats, of what a user's function returned. Masked values are NaN: an evaluation that failed.

    Raises TypeError or ValueError for anything but real numbers. A complex number is none, even if its imaginary part is 0, nor is a date,
    nor what a comparison gives: x <= 3 would be 1, beyond a limit of 0, where it holds.
    """
    if isinstance(values, np.ma.MaskedArray) or (
        isinstance(values, list | tuple) and any(isinstance(one, np.ma.MaskedArray) for one in values)
    ):
        values = np.ma.array(values)
        if not np.iscomplexobj(values):
            values = values.astype(float).filled(np.nan)
    if np.asarray(values).dtype.kind in "bcmM":
        raise TypeError("truth values, complex numbers, dates or durations")
    return np.array(values, dtype=float)


@dataclass(frozen=True, eq=False, repr=False)
class CompiledVectorProblem:
    """A vector problem: what a search needs to know of a function without trajectories.

    Attributes
    ----------
    name : str
    variables : tuple of d Variables
    goals : tuple of m Objectives
        Empty: as many as the function returns, all minimised, without names.
    limits : tuple of c Limits, or None
        None: as many columns as the function returns, each at most 0 in units of its own.
    rows : callable
        See `Rows`. A row with NaN is a failed evaluation.
    equalities : tuple of int
        Without `limits`: columns that have to be 0, instead of at most 0. With any, residuals are divided by the `sizes`.
    address, data
        As of `CompiledProblem`.
    by_row : bool
        Whether the function computes one row at a time.

    Examples
    --------
    >>> from problems import load
    >>> [variable.name for variable in load("four_bar_truss").compile().variables]
    ['area 1', 'area 2', 'area 3', 'area 4']
    """

    name: str
    variables: tuple[Variable, ...]
    goals: tuple[Objective, ...]
    limits: tuple[Limit, ...] | None
    rows: Rows
    address: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)
    equalities: tuple[int, ...] = ()
    by_row: bool = False

    def __repr__(self) -> str:
        variables, goals = (", ".join(one.name for one in group) for group in (self.variables, self.goals))
        return f"CompiledVectorProblem('{self.name}', variables=[{variables}], objectives=[{goals}])"

    def compile(self) -> CompiledVectorProblem:
        """Itself: so that every function of a VectorProblem takes a compiled one as well."""
        return self

    @property
    def phases(self) -> NoReturn:
        """Raises ValueError: there are none, whatever was to be done with them."""
        raise ValueError(f"{without_dynamics(self.name)}: use a search, such as MACS().solve(problem)")

    @property
    def signs(self) -> np.ndarray:
        """+1 for a minimised, -1 for a maximised objective, (m,)."""
        return np.array([goal.sign for goal in self.goals])

    def evaluate(self, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Objectives (n, m), all minimised, and residuals (n, c) of rows (n, d).

        A residual is the excess over a limit divided by the limit's scale, negative below a lower limit, and 0 within both. NaN where the
        function returned it.
        """
        values, bounded = self.rows(X.copy())
        if self.goals and values.shape[1] != len(self.goals):
            raise ValueError(f"objectives: function returned {values.shape[1]}, {len(self.goals)} expected")
        F = values * self.signs if self.goals else values
        if self.limits is None:
            equal = np.isin(np.arange(bounded.shape[1]), self.equalities)
            return F, np.where(equal, bounded, np.maximum(bounded, 0.0)) / (self.sizes if equal.any() else 1.0)
        lower, upper, scale = (np.array([getattr(limit, side) for limit in self.limits]) for side in ("lower", "upper", "scale"))
        return F, (np.maximum(bounded - upper, 0.0) - np.maximum(lower - bounded, 0.0)) / scale

    @property
    def sample(self) -> np.ndarray:
        """The `SAMPLED` rows (n, d), drawn from the box and always the same, by which the function is known."""
        lower, upper = (np.array([getattr(v, side) for v in self.variables]) for side in ("lower", "upper"))
        X, whole = np.random.default_rng(0).uniform(lower, upper, (SAMPLED, len(lower))), [v.integer for v in self.variables]
        return np.where(whole, X.round(), X)

    @cached_property
    def _sampled(self) -> tuple[np.ndarray, np.ndarray]:
        """What `rows` returns at the `sample`; NaN where it raises an error."""
        columns = (len(self.goals), len(self.limits)) if self.goals and self.limits is not None else ()
        try:
            if not self.by_row:
                return self.rows(self.sample)
        except Exception as error:
            if isinstance(error, MemoryError) or is_of_statement(error):
                raise
        return filled([self.attempt(row, "rows") for row in self.sample], columns, self.named(self.sample[0]))

    def attempt(self, row: np.ndarray, what: str, passing: tuple[type[Exception], ...] = ()) -> Row:
        """What the method of this name returns for one row (d,), or the error that the user's function raised, but those `passing` and one
        for want of memory."""
        try:
            return getattr(self, what)(row[None].copy())
        except Exception as error:
            if isinstance(error, (MemoryError, *passing)) or (not self.by_row and is_of_statement(error)):
                raise
            return f"{type(error).__name__}: {' '.join(str(error).split())}"

    def named(self, row: np.ndarray) -> str:
        """A row (d,) in words: "height = 0.5, material = steel"."""
        return ", ".join(f"{v.name} = {v.meant(value)}" for v, value in zip(self.variables, row.tolist(), strict=True))

    @cached_property
    def sizes(self) -> np.ndarray:
        """Typical absolute value of each column, over the `sample`: what an equality may miss follows from its unit."""
        found = np.abs(self._sampled[1])
        usual = [np.median(one[np.isfinite(one)]) if np.isfinite(one).any() else 0.0 for one in found.T]
        return np.array([size or 1.0 for size in usual])

    @cached_property
    def fingerprint(self) -> str:
        """A hash of names, bounds, senses, limits, and of the function's values at fixed rows, to nine digits: two problems with the same
        one are the same. The function is evaluated at the `sample` for it, once."""
        values = np.hstack(self._sampled)
        own = [self.equalities] if self.equalities else []
        told = ("vector", self.name, self.variables, self.goals, self.limits, *own, *kinds(self.variables))
        digest = hashlib.sha256(repr(told).encode())
        digest.update(" ".join(f"{value + 0.0:.8e}" if math.isfinite(value) else "not finite" for value in values.ravel()).encode())
        return digest.hexdigest()[:32]


class VectorProblem:
    """A multi-objective problem without trajectories: variables, objectives and constraints by name, and a function that computes them.

    The function takes a batch of rows, an array X (n, d) with a column for each variable in the order in which they were stated, and
    returns a dict with an array (n,) for each objective and constraint by its name, in the user's units and senses. Rows come as an array,
    so that `h, l = X.T` names them and numerical code takes them as they are; results go by name, so that they cannot be confused, and an
    error says which one is wrong. A row with NaN or a masked value in it is a failed evaluation, not an error. The same row must always
    give the same values.

    Every mistake that can be seen at once raises a ValueError that names it.

    Attributes
    ----------
    default_evaluations, default_verify : int or None, float
        Number of rows that studies, and searches that need a number, evaluate by default (None: the call must state it; MACS
        searches until it is done); and by how much, in ranges of the front and scales of constraints, a verified point may differ when
        `macs verify` or `macs solve` evaluates it again.

    Examples
    --------
    >>> from problems import VectorProblem
    >>> problem = VectorProblem("Schaffer")
    >>> problem.variable("x", bounds=(-10, 10), unit="m")
    >>> problem.minimize("near", unit="m2")
    >>> problem.minimize("far", unit="m2")
    >>> problem.constraint("side", upper=1.5, unit="m")
    >>> @problem.function
    ... def evaluate(X):
    ...     (x,) = X.T
    ...     return {"near": x**2, "far": (x - 2) ** 2, "side": x}
    """

    def __init__(self, name: str) -> None:
        checks.new_name("problem", name, (), "VectorProblem")
        self.name = name
        self.address = ""
        self.data: Mapping[str, Any] = {}
        self.default_evaluations: int | None = None
        self.default_verify = 1e-6
        self._variables: dict[str, Variable] = {}
        self._objectives: dict[str, Objective] = {}
        self._constraints: dict[str, Limit] = {}
        self._function: Callable[..., Mapping[str, Any]] | None = None
        self._by_row = False
        self._limit: float | None = None

    def __repr__(self) -> str:
        return f"VectorProblem('{self.name}', variables=[{', '.join(self._variables)}], objectives=[{', '.join(self._objectives)}])"

    @property
    def variables(self) -> Mapping[str, Variable]:
        """Variables by name, in the order of the function's columns."""
        return MappingProxyType(self._variables)

    @property
    def objectives(self) -> Mapping[str, Objective]:
        """Objectives by name."""
        return MappingProxyType(self._objectives)

    @property
    def constraints(self) -> Mapping[str, Limit]:
        """Limits by name."""
        return MappingProxyType(self._constraints)

    def variable(
        self, name: str, *, bounds: Any = None, unit: str = "", period: float | None = None, integer: bool = False, choices: Any = None
    ) -> None:
        """Add a decision variable within finite bounds; with a `period`, bounds are one period wide, and values wrap around.

        `integer`: a whole number within the bounds, which belong to it. `choices`, in place of bounds: one of two or more different texts,
        numbers or truth values, without an order. A `function` of arrays gets whole numbers as floats, and a choice as its number, counted
        from 0; a `row` function gets an int, and the choice itself.
        """
        what = checks.new_name("variable", name, self._variables, f"problem '{self.name}'")
        if choices is not None:
            if bounds is not None or period is not None or integer:
                raise ValueError(f"{what} has choices, and so neither bounds nor a period")
            labels = checks.choices(choices, what)
            last = len(labels) - 1.0
            self._variables[name] = Variable(name, 0.0, last, checks.unit(unit, what), last, None, True, labels)
            return
        if bounds is None:
            raise ValueError(f"{what} has neither bounds nor choices")
        lower, upper = checks.whole(bounds, what) if integer else checks.interval(bounds, f"the bounds of {what}")
        if integer and period is not None:
            raise ValueError(f"{what} is a whole number, and so has no period")
        if lower == upper:
            raise ValueError(f"the bounds of {what} leave nothing to decide: {lower:g} on both sides")
        if not math.isfinite(upper - lower):
            raise ValueError(f"the bounds of {what}, ({lower:g}, {upper:g}), are too far apart")
        length = checks.period(period, (lower, upper), what)
        self._variables[name] = Variable(name, lower, upper, checks.unit(unit, what), upper - lower, length, integer)

    def minimize(self, name: str, *, unit: str = "", scale: float | None = None) -> None:
        """Add an objective to be minimised; its differences are divided by `scale` where points are compared, by default
        its range over the front."""
        self._objective(name, unit, "minimize", scale)

    def maximize(self, name: str, *, unit: str = "", scale: float | None = None) -> None:
        """Add an objective to be maximised; otherwise as `minimize`."""
        self._objective(name, unit, "maximize", scale)

    def constraint(self, name: str, *, lower: Any = None, upper: Any = None, unit: str = "", scale: float | None = None) -> None:
        """Limit a value that the function returns.

        A violation is the excess divided by `scale`, so that those of several constraints are comparable. By default that is the distance
        of two limits; of one limit, or an equality, its size, so that the violation is a fraction of it; and 1 for a limit of 0.
        """
        what = self._new_output("constraint", name)
        limit = checks.limit(name, lower, upper, unit, scale, what)
        sizes = [abs(side) for side in (limit.lower, limit.upper) if np.isfinite(side)]
        if scale is None and (len(sizes) == 1 or limit.lower == limit.upper):
            limit = replace(limit, scale=sizes[0] or 1.0)
        self._constraints[name] = limit

    def function(self, function: Kind) -> Kind:
        """Say what computes objectives and constraints: a decorator, see the class. Returns the function as it is."""
        if not callable(function):
            raise ValueError(f"problem '{self.name}': its function must be callable, not {type(function).__name__}")
        if self._function is not None:
            raise ValueError(f"problem '{self.name}' has a function already")
        self._function = function
        return function

    def row(self, function: Any = None, *, limit: float | None = None) -> Any:
        """Say what computes one design: a decorator, in place of `function`. Returns the function as it is.

        It takes a dict with the value of each variable by its name: a float, an int, or what was chosen. It returns a dict with a number
        for each objective and constraint; what else is in it is ignored. A design at which it raises an error, or returns NaN or None, is
        a failed evaluation. With `workers=` designs are computed side by side.

        `limit`, as in `@problem.row(limit=60)`: seconds after which a design has failed. Designs are then computed in a process of their
        own, which is killed and replaced; one that ends its process has failed, too.
        """
        if limit is not None:
            checks.check_positive(f"problem '{self.name}': the limit of a row", limit)
        if function is None:
            return partial(self.row, limit=limit)
        self._function, self._by_row, self._limit = self.function(function), True, limit
        return function

    def compile(self) -> CompiledVectorProblem:
        """Check the whole and turn it into plain data.

        Raises
        ------
        ValueError
            No variable, no objective, or no function.
        """
        place = f"problem '{self.name}'"
        if not self._variables:
            raise ValueError(f"{place} has no variable")
        if not self._objectives:
            raise ValueError(f"{place} has no objective; add one with minimize or maximize")
        if self._function is None:
            raise ValueError(f"{place} has no function; give it one with @problem.function")
        variables, names = tuple(self._variables.values()), (*self._objectives, *self._constraints)
        function = ByRow(self._function, variables, names) if self._by_row else self._function
        rows: Rows = NamedRows(place, function, tuple(self._objectives), tuple(self._constraints))
        return CompiledVectorProblem(
            name=self.name,
            variables=variables,
            goals=tuple(self._objectives.values()),
            limits=tuple(self._constraints.values()),
            rows=rows if self._limit is None else LimitedRows(rows, self._limit),
            address=self.address,
            data=dict(self.data),
            by_row=self._by_row,
        )

    def _objective(self, name: str, unit: str, sense: str, scale: float | None) -> None:
        what = self._new_output("objective", name)
        self._objectives[name] = Objective(name, checks.unit(unit, what), sense, None if scale is None else checks.scale(scale, 1.0, what))

    def _new_output(self, kind: str, name: Any) -> str:
        """Objectives and constraints share their names, which are the keys of what the function returns."""
        return checks.new_name(kind, name, (*self._objectives, *self._constraints), f"problem '{self.name}'")


@dataclass(frozen=True)
class ByRow:
    """A function of one design, dict in and dict out, as one of rows (n, d)."""

    function: Callable[[dict[str, Any]], Mapping[str, Any]]
    variables: tuple[Variable, ...]
    names: tuple[str, ...]

    def __call__(self, X: np.ndarray) -> Any:
        found = [self.function({v.name: v.meant(x) for v, x in zip(self.variables, row, strict=True)}) for row in X.tolist()]
        if wrong := [one for one in found if not isinstance(one, Mapping)]:
            return wrong[0]
        return {name: [one[name] for one in found] for name in self.names if all(name in one for one in found)}


@dataclass(frozen=True)
class NamedRows:
    """A function that returns a dict by name, as `vector.Rows`. What it returns is checked; errors begin with `place`."""

    place: str
    function: Outputs
    objectives: tuple[str, ...]
    constraints: tuple[str, ...]

    def __call__(self, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = self.function(X)
        names = (*self.objectives, *self.constraints)
        if not isinstance(found, Mapping):
            raise ValueError(
                f"{self.place}: its function must return a dict with an array of {len(X)} values, one for each row, for each of "
                f"{', '.join(names)}, not {type(found).__name__}"
            )
        for name in found:
            if name not in names:
                raise ValueError(f"{self.place}: its function returned an {checks.unknown('objective or constraint', name, names)}")
        missing = [name for name in names if name not in found]
        if missing:
            quoted = ", ".join(f"'{name}'" for name in missing)
            raise ValueError(f"{self.place}: its function did not return {quoted}")
        columns = [self._column(name, found[name], len(X)) for name in names]
        values = np.array(columns).T.reshape(len(X), len(names))
        m = len(self.objectives)
        return values[:, :m].copy(), values[:, m:].copy()

    def _column(self, name: str, values: Any, count: int) -> np.ndarray:
        what = f"{self.place}: what its function returned for '{name}'"
        try:
            column = real_numbers(values)
        except (TypeError, ValueError):
            raise ValueError(f"{what} must be an array of real numbers, not {checks.shown(values)}") from None
        if column.shape != (count,):
            raise ValueError(f"{what} has shape {column.shape} for {count} rows, ({count},) expected")
        return column
