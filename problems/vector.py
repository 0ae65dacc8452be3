"""Compiled vector problems: named variables, objectives and limits, and one function of batches of rows, as plain data.

Everything above this floor reads a vector problem through `CompiledVectorProblem`, whether a user stated it by name, as a plain function,
or in another library.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from .compiled import Limit, Objective, Variable

FINGERPRINT_ROWS = 8
"""Rows at which a function is evaluated for the fingerprint of its problem: few, since a row may take long."""


def without_dynamics(name: str) -> str:
    """The reason why a vector problem is refused where dynamics or derivatives are needed."""
    return f"'{name}' is a vector problem, which has no dynamics and no derivatives"


Rows = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""`rows(X: (n, d)) -> (objectives (n, m) in the user's senses, values (n, c) that the limits bound)`."""


def real_numbers(values: Any) -> np.ndarray:
    """A copy, as floats, of what a user's function returned. Masked values are NaN: an evaluation that failed.

    Raises TypeError or ValueError for anything but real numbers; a complex number is none, even if its imaginary part is 0, nor is a date.
    """
    if isinstance(values, np.ma.MaskedArray) or (
        isinstance(values, list | tuple) and any(isinstance(one, np.ma.MaskedArray) for one in values)
    ):
        values = np.ma.array(values)
        if not np.iscomplexobj(values):
            values = values.astype(float).filled(np.nan)
    if (kind := np.asarray(values).dtype.kind) in "cmM":
        raise TypeError("complex numbers" if kind == "c" else "dates or durations")
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
        None: as many columns as the function returns, each at most 0, with a scale of 1.
    rows : callable
        See `Rows`. A row with NaN is a failed evaluation.
    equalities : tuple of int
        Without `limits`: columns that have to be 0, instead of at most 0.
    address, data
        As of `CompiledProblem`.

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
            return F, np.where(equal, bounded, np.maximum(bounded, 0.0))
        lower, upper, scale = (np.array([getattr(limit, side) for limit in self.limits]) for side in ("lower", "upper", "scale"))
        return F, (np.maximum(bounded - upper, 0.0) - np.maximum(lower - bounded, 0.0)) / scale

    @cached_property
    def fingerprint(self) -> str:
        """A hash of names, bounds, senses, limits, and of the function's values at fixed rows, to nine digits: two problems with the same
        one are the same. The function is evaluated at `FINGERPRINT_ROWS` rows for it, once."""
        rng = np.random.default_rng(0)
        lower, upper = (np.array([getattr(v, side) for v in self.variables]) for side in ("lower", "upper"))
        values = np.hstack(self.rows(rng.uniform(lower, upper, (FINGERPRINT_ROWS, len(lower)))))
        told = ("vector", self.name, self.variables, self.goals, self.limits, *([self.equalities] if self.equalities else []))
        digest = hashlib.sha256(repr(told).encode())
        digest.update(" ".join(f"{value + 0.0:.8e}" if math.isfinite(value) else "not finite" for value in values.ravel()).encode())
        return digest.hexdigest()[:32]
