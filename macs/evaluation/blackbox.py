"""Evaluator of a black box: a plain vector function or a problem of pymoo."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from problems.compiled import Objective

from .evaluator import CONVERGED, FAILED, INFEASIBLE, Counts, Evaluation, Evaluator

SENSES = ("minimize", "maximize")

Outputs = np.ndarray | tuple[np.ndarray, np.ndarray]


class BlackBox(Evaluator):
    """Evaluator of a plain vector function.

    Parameters
    ----------
    function : callable or pymoo Problem
        `function(X: (n, d)) -> F: (n, m)` or `(F, G)`. A row with NaN is a failed evaluation.
    bounds : sequence of d pairs, pair of arrays (d,), or dict of pairs by name; None for a pymoo problem
        Two sequences of more than two numbers each are (lower, upper); all else is a list of pairs.
    constraints : callable, optional
        `constraints(X: (n, d)) -> G: (n, c)`; G <= 0 is feasible. Its columns come after those of the function's own G.
    names, units : sequences of m str, optional
        Of the objectives. Default: "f1", "f2", ..., and no units.
    senses : sequence of m of "minimize" or "maximize", optional
        Default: all minimised.
    tolerance : float, default 1e-6
        A point with max(G) at most this is feasible.

    Attributes
    ----------
    variables : tuple of d str
        Names of the variables: the keys of `bounds`, else "x1", "x2", ...
    names, units, senses : tuples of m str
        Of the objectives.

    Notes
    -----
    The number of objectives `m` is known from `names`, `units` or `senses`, from a pymoo problem, or from the first batch. Reading `m`
    before that costs one evaluation, of the centre of the box, which is counted.

    Raises
    ------
    ValueError
        If an argument, or the result of a function, has the wrong type or shape; the message names it.
    """

    def __init__(
        self,
        function: Any,
        bounds: Sequence | Mapping[str, Sequence[float]] | None = None,
        *,
        constraints: Callable[[np.ndarray], np.ndarray] | None = None,
        names: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        senses: Sequence[str] | None = None,
        tolerance: float = 1e-6,
    ) -> None:
        self.m_known: int | None = None
        if _is_pymoo(function):
            bounds = _pymoo_bounds(function) if bounds is None else bounds
            self.m_known = int(function.n_obj)
            function = _pymoo_function(function)
        if not callable(function):
            raise ValueError(f"function: must be callable or a pymoo Problem, not {type(function).__name__}")
        if constraints is not None and not callable(constraints):
            raise ValueError(f"constraints: must be callable, not {type(constraints).__name__}")
        if not (isinstance(tolerance, int | float) and 0 <= tolerance < np.inf):
            raise ValueError(f"tolerance: must be a number >= 0, not {tolerance!r}")
        self.function, self.constraints, self.tolerance = function, constraints, float(tolerance)
        self.variables, self.lower, self.upper = read_bounds(bounds)
        self.free = np.arange(len(self.lower))
        self.period = np.zeros(len(self.lower))
        self.counts = Counts()
        self._names, self._units, self._senses = _labels("names", names), _labels("units", units), _labels("senses", senses)
        for sense in self._senses or ():
            if sense not in SENSES:
                raise ValueError(f"senses: must be 'minimize' or 'maximize', not {sense!r}")
        if self._names and len(set(self._names)) < len(self._names):
            raise ValueError(f"names: {', '.join(self._names)} has a name twice")
        for name, labels in (("names", self._names), ("units", self._units), ("senses", self._senses)):
            if labels is not None:
                self._learn(len(labels), f"{name} has {len(labels)}")

    @property
    def m(self) -> int:
        """Number of objectives; see the notes of the class."""
        if self.m_known is None:
            self.evaluate((self.lower + self.upper)[None] / 2)
        assert self.m_known is not None
        return self.m_known

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objectives, (m,)."""
        return self._names or tuple(f"f{k + 1}" for k in range(self.m))

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the objectives, (m,)."""
        return self._units or ("",) * self.m

    @property
    def senses(self) -> tuple[str, ...]:
        """ "minimize" or "maximize" of each objective, (m,)."""
        return self._senses or ("minimize",) * self.m

    @property
    def goals(self) -> tuple[Objective, ...]:
        """See `Evaluator.goals`."""
        return tuple(Objective(*words) for words in zip(self.names, self.units, self.senses, strict=True))

    def resume(self, counts: Counts, m: int) -> None:
        """See `Evaluator.resume`. Raises ValueError if the function has another number of objectives."""
        super().resume(counts, m)
        self._learn(m, f"the checkpoint has {m}")

    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        """The candidates (k, d) themselves: all variables of a black box are free."""
        return np.array(candidates, dtype=float)

    def _evaluate(self, Z: np.ndarray) -> tuple[Evaluation, int]:
        outputs = self.function(Z.copy())
        F, G = outputs if isinstance(outputs, tuple) and len(outputs) == 2 else (outputs, None)
        F = _rows("function: the objectives", F, len(Z))
        self._learn(F.shape[1], f"function returned {F.shape[1]}")
        F = F * np.where([sense == "maximize" for sense in self.senses], -1.0, 1.0)
        columns = [] if G is None else [_rows("function: the constraints", G, len(Z))]
        if self.constraints is not None:
            columns.append(_rows("constraints: what it returned", self.constraints(Z.copy()), len(Z)))
        violations = np.maximum(np.hstack([np.empty((len(Z), 0)), *columns]), 0.0)
        violation = violations.max(axis=1, initial=0.0)
        failed = ~(np.isfinite(F).all(axis=1) & np.isfinite(violation))
        F[failed], violation[failed] = np.nan, np.inf
        status = np.where(failed, FAILED, np.where(violation <= self.tolerance, CONVERGED, INFEASIBLE))
        return Evaluation(Z=Z.copy(), F=F, violation=violation, status=status, itemise=lambda: violations), 0

    def _learn(self, count: int, source: str) -> None:
        """Set the number of objectives from `source`. Raises ValueError if it is known to be another."""
        if self.m_known is None and count > 0:
            self.m_known = count
        if self.m_known != count:
            raise ValueError(f"objectives: {source}, {self.m_known or 'at least 1'} expected")


def read_bounds(bounds: Any) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """Names (d,), lower and upper bounds (d,) from a sequence of pairs, a pair of sequences longer than two, or a dict of pairs by name.

    Raises
    ------
    ValueError
        If they are not pairs, not finite, reversed or empty; the message names the variable.
    """
    if bounds is None:
        raise ValueError("bounds: missing")
    names = tuple(str(name) for name in bounds) if isinstance(bounds, Mapping) else None
    pairs = list(bounds.values()) if isinstance(bounds, Mapping) else list(bounds)
    if not pairs:
        raise ValueError("bounds: empty")
    if names is None and len(pairs) == 2 and all(np.ndim(side) == 1 and len(side) > 2 for side in pairs):
        if len(pairs[0]) != len(pairs[1]):
            raise ValueError(f"bounds: {len(pairs[0])} lower and {len(pairs[1])} upper ones")
        pairs = list(zip(*pairs, strict=True))
    names = names or tuple(f"x{i + 1}" for i in range(len(pairs)))
    limits = np.empty((len(pairs), 2))
    for i, (name, pair) in enumerate(zip(names, pairs, strict=True)):
        try:
            limits[i] = np.asarray(pair, dtype=float).reshape(2)
        except (TypeError, ValueError):
            raise ValueError(f"bounds: variable '{name}' has {pair!r}, a pair (lower, upper) expected") from None
        lower, upper = limits[i]
        if not (np.isfinite(lower) and np.isfinite(upper) and np.isfinite(upper - lower)):
            raise ValueError(f"bounds: variable '{name}' has ({lower:g}, {upper:g}), finite numbers expected")
        if lower >= upper:
            raise ValueError(f"bounds: variable '{name}' has lower {lower:g} >= upper {upper:g}")
    return names, limits[:, 0].copy(), limits[:, 1].copy()


def _labels(name: str, labels: Sequence[str] | None) -> tuple[str, ...] | None:
    """The labels as a tuple; a single string is refused."""
    if labels is None:
        return None
    if isinstance(labels, str) or not all(isinstance(label, str) for label in labels):
        raise ValueError(f"{name}: must be a sequence of strings, one for each objective, not {labels!r}")
    return tuple(labels)


def _rows(what: str, values: Any, count: int) -> np.ndarray:
    """Copy (count, k) of the values that a user's function returned for `count` points; (count,) counts as one column."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{what} must be an array of numbers, not {type(values).__name__}") from None
    if array.shape == (count,):
        array = array[:, None]
    if array.ndim != 2 or len(array) != count:
        raise ValueError(f"{what} have shape {array.shape} for {count} points, ({count}, k) expected")
    return array


def _is_pymoo(function: Any) -> bool:
    """Whether this is a pymoo Problem, by its attributes, without importing pymoo."""
    return all(hasattr(function, name) for name in ("n_var", "n_obj", "xl", "xu", "evaluate"))


def _pymoo_bounds(problem: Any) -> list[tuple[float, float]]:
    """Pairs of bounds of a pymoo Problem with real variables."""
    lower, upper = problem.xl, problem.xu
    if lower is None or upper is None or isinstance(lower, dict):
        raise ValueError(f"bounds: pymoo problem {type(problem).__name__} has no bounds of real variables")
    lower, upper = np.broadcast_to(lower, problem.n_var), np.broadcast_to(upper, problem.n_var)
    return list(zip(lower.tolist(), upper.tolist(), strict=True))


def _pymoo_function(problem: Any) -> Callable[[np.ndarray], Outputs]:
    """A pymoo Problem, vectorised or elementwise, as function that returns (F, G); of equality constraints G has the absolute values."""

    def function(X: np.ndarray) -> Outputs:
        out = problem.evaluate(X, return_values_of=["F", "G", "H"], return_as_dictionary=True)
        inequality, equality = out.get("G"), out.get("H")
        columns = [] if inequality is None or not np.size(inequality) else [inequality]
        columns += [] if equality is None or not np.size(equality) else [np.abs(equality)]
        return (out["F"], np.hstack(columns)) if columns else out["F"]

    return function
