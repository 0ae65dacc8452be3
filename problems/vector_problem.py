"""The builder of vector problems: named variables, objectives and constraints, computed by one function of batches of rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from . import checks
from .compiled import Limit, Objective, Variable
from .vector import CompiledVectorProblem, real_numbers

Outputs = Callable[[np.ndarray], Mapping[str, Any]]
Kind = TypeVar("Kind", bound=Outputs)


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
        What studies, and searches that need a number, use by default: rows that a search evaluates (None: it has to be stated there; MACS
        searches until it is done); and how much a point of a front may differ, in ranges of the front and in the constraints' scales, when
        it is evaluated again.

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
        self._function: Outputs | None = None

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

    def variable(self, name: str, *, bounds: Any, unit: str = "", period: float | None = None) -> None:
        """Add a decision variable within finite bounds; with a `period`, bounds are one period wide, and values wrap around."""
        what = checks.new_name("variable", name, self._variables, f"problem '{self.name}'")
        lower, upper = checks.interval(bounds, f"the bounds of {what}")
        if lower == upper:
            raise ValueError(f"the bounds of {what} leave nothing to decide: {lower:g} on both sides")
        length = checks.period(period, (lower, upper), what)
        self._variables[name] = Variable(name, lower, upper, checks.unit(unit, what), upper - lower, length)

    def minimize(self, name: str, *, unit: str = "", scale: float | None = None) -> None:
        """Add an objective to be minimised; `scale` is the difference in it that counts as one where objectives are compared, by default
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
        return CompiledVectorProblem(
            name=self.name,
            variables=tuple(self._variables.values()),
            goals=tuple(self._objectives.values()),
            limits=tuple(self._constraints.values()),
            rows=NamedRows(place, self._function, tuple(self._objectives), tuple(self._constraints)),
            address=self.address,
            data=dict(self.data),
        )

    def _objective(self, name: str, unit: str, sense: str, scale: float | None) -> None:
        what = self._new_output("objective", name)
        self._objectives[name] = Objective(name, checks.unit(unit, what), sense, None if scale is None else checks.scale(scale, 1.0, what))

    def _new_output(self, kind: str, name: Any) -> str:
        """Objectives and constraints share their names, which are the keys of what the function returns."""
        return checks.new_name(kind, name, (*self._objectives, *self._constraints), f"problem '{self.name}'")


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
