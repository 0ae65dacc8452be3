"""Vector problems: built from plain functions or pymoo problems, evaluated for a search, and evaluated again at its end."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any

import numpy as np

from problems.checks import check_text, choices, interval, shown, unknown, whole
from problems.compiled import Objective, Variable
from problems.vector import SAMPLED, CompiledVectorProblem, Row, filled, is_of_statement, real_numbers
from transcription.stopping import Stopped
from transcription.trajectories.limits import excess

from ..io.interrupts import at_once, work_on_trajectories
from ..io.workers import each
from .evaluator import CONVERGED, FAILED, INFEASIBLE, Counts, Evaluation, Evaluator, masks

log = logging.getLogger(__name__)


class RowCache(sqlite3.Connection):
    """Objectives (1, m), all minimised, and residuals (1, c) of rows of one problem, in a file of SQLite that one process has open.

    A row is known by the problem's fingerprint and its exact values. What is kept are numbers, which nothing executes. A batch is written
    whole or not at all, wherever the process is killed. ValueError for another file, or one in use.
    """

    ID = 7_725_301  # `PRAGMA application_id` of these files

    def __init__(self, path: str | PathLike[str], problem: str) -> None:
        self._problem = problem
        try:
            super().__init__(path, timeout=1.0)
            self.execute("PRAGMA locking_mode = EXCLUSIVE")
            self.execute("BEGIN EXCLUSIVE")
            if self.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,):
                self.execute(f"PRAGMA application_id = {self.ID}")
                self.execute("CREATE TABLE rows (problem, row, objectives, residuals, PRIMARY KEY (problem, row)) WITHOUT ROWID")
            own = self.execute("PRAGMA application_id").fetchone() == (self.ID,)
            self.commit()
        except sqlite3.OperationalError as error:
            raise ValueError(f"cache: '{path}' cannot be used, perhaps since another search does: {error}") from None
        except sqlite3.DatabaseError:
            own = False
        if not own:
            raise ValueError(f"cache: '{path}' is no cache of rows")

    def known(self, X: np.ndarray) -> dict[int, Row]:
        """What is known of rows X (k, d), by their numbers."""
        asked = "SELECT objectives, residuals FROM rows WHERE problem = ? AND row = ?"
        found = {i: self.execute(asked, (self._problem, row.tobytes())).fetchone() for i, row in enumerate(X)}
        return {i: (np.frombuffer(one[0])[None], np.frombuffer(one[1])[None]) for i, one in found.items() if one is not None}

    def add(self, X: Sequence[np.ndarray], values: Sequence[Row]) -> None:
        """Keep the values of rows (d,) that did not raise an error: they may succeed another time, with a licence or more time."""
        pairs = [(row, one) for row, one in zip(X, values, strict=True) if not isinstance(one, str)]
        with self:
            data = [(self._problem, row.tobytes(), one[0].tobytes(), one[1].tobytes()) for row, one in pairs]
            self.executemany("INSERT OR REPLACE INTO rows VALUES (?, ?, ?, ?)", data)


class BlackBox(Evaluator):
    """Evaluator of a vector problem. A point none of whose violations exceeds the tolerance is feasible.

    Without limits, as of a plain function, G <= 0 is meant as it stands, whatever its unit, and only an equality has a tolerance, in its
    `sizes`: to know these, `SAMPLED` rows are evaluated and counted.

    The number of objectives `m` is known from the problem, or from the first batch. Reading `m` before that costs one evaluation, of the
    centre of the box, which is counted. ValueError where the result of a function has the wrong type or shape; the message names it.
    """

    def __init__(self, problem: CompiledVectorProblem, tolerance: float = 1e-6, apart: bool = False, cache: RowCache | None = None) -> None:
        if not (isinstance(tolerance, int | float) and 0 <= tolerance < np.inf):
            raise ValueError(f"tolerance: must be a number >= 0, not {tolerance!r}")
        plain = problem.limits is None
        self.problem, self.tolerance, self._missed = problem, 0.0 if plain else float(tolerance), float(tolerance)
        self._equalities = list(problem.equalities) if plain else []
        self.m_known: int | None = len(problem.goals) or None
        self.lower, self.upper = (np.array([getattr(v, side) for v in problem.variables]) for side in ("lower", "upper"))
        self.period = np.array([v.period or 0.0 for v in problem.variables])
        self.free = np.arange(len(problem.variables))
        self.kinds = masks(problem.variables)
        self.known_designs: dict[bytes, np.ndarray] = {}
        self.apart = apart or problem.by_row or cache is not None  # whether each row is evaluated by itself
        self._alike, self._cache = apart, cache  # whether rows have one thread of BLAS, as they have in processes
        self._columns: Sequence[int] = (len(problem.goals), len(problem.limits)) if problem.goals and problem.limits is not None else ()
        self._why: dict[int, str] = {}  # of the last batch, why rows failed
        self._failing = 0  # evaluations that failed since the last one that did not
        self.counts = Counts(evaluations=SAMPLED if self._equalities else 0)

    @property
    def m(self) -> int:
        """Number of objectives; see the class."""
        if self.m_known is None:
            self.evaluate((self.lower + self.upper)[None] / 2)
        assert self.m_known is not None
        return self.m_known

    @property
    def sizes(self) -> dict[str, int]:
        """See `Evaluator.sizes`; the number of objectives is compared by `resume`, whose error says where it is from."""
        return {"d": len(self.free), "D": len(self.free)}

    @property
    def goals(self) -> tuple[Objective, ...]:
        """See `Evaluator.goals`."""
        return self.problem.goals or default_goals(self.m)

    def resume(self, counts: Counts, m: int, memory: np.ndarray) -> None:
        """See `Evaluator.resume`. Raises ValueError if the function has another number of objectives."""
        super().resume(counts, m, memory)
        self.m_known = learned(self.m_known, m, f"the checkpoint has {m}")
        d = len(self.free)
        if memory.dtype != float or (len(memory) and memory.shape[1:2] < (d + m + 1,)):
            raise ValueError("the checkpoint has known designs of another problem")
        self.known_designs = {row[:d].tobytes(): row for row in memory}

    @property
    def memory(self) -> np.ndarray:
        """See `Evaluator.memory`: variables, objectives, violation and residuals."""
        return np.array([*self.known_designs.values()]) if self.known_designs else np.empty((0, 0))

    @property
    def over(self) -> str:
        """See `Evaluator.over`."""
        if len(self.known_designs) >= self.box.designs:
            return "done"
        return "failed" if self._failing >= 100 else ""

    def knows(self, Z: np.ndarray) -> np.ndarray:
        """See `Evaluator.knows`."""
        return np.array([row.tobytes() in self.known_designs for row in Z], dtype=bool)

    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        """The candidates (k, d) themselves: all variables of a black box are free."""
        return np.array(candidates, dtype=float)

    def _values(self, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `CompiledVectorProblem.evaluate`; of a batch in which an error was raised each row by itself, NaN where it is raised again.
        Ctrl-C that the function hears ends the search."""
        try:
            with at_once(), work_on_trajectories() if self._alike else nullcontext():
                try:
                    found: list[Any] = [] if self.apart else [self.problem.evaluate(Z)]
                except Exception as error:
                    if isinstance(error, Stopped | MemoryError) or is_of_statement(error):
                        raise
                    found = []
                found = found or self._each(Z)
        except KeyboardInterrupt:
            raise Stopped("interrupted") from None
        self._why = {i: one for i, one in enumerate(found) if isinstance(one, str)}
        F, residuals = filled(found, self._columns, self.problem.named(Z[0]))
        self._columns = F.shape[1], residuals.shape[1]
        return F, residuals

    def _each(self, Z: np.ndarray) -> list[Row]:
        """What the function gives for each of the rows (k, d) by itself, if the cache does not know."""
        known = {} if self._cache is None else self._cache.known(Z)
        left = [row for i, row in enumerate(Z) if i not in known]
        found = each(CompiledVectorProblem.attempt, self.problem, [(row, "evaluate", (Stopped,)) for row in left])
        if self._cache is not None:
            self._cache.add(left, found)
            self.counts.from_cache += len(known)
        return [known[i] if i in known else found.pop(0) for i in range(len(Z))]

    def room(self, Z: np.ndarray, left: int) -> int:
        """See `Evaluator.room`."""
        if np.isinf(self.box.designs):
            return super().room(Z, left)
        new = set[bytes]()
        for i, row in enumerate(Z):
            new |= {row.tobytes()} - self.known_designs.keys()
            if len(new) > left:
                return i
        return len(Z)

    def evaluate(self, Z: np.ndarray, way: int | None = None) -> Evaluation:
        """See `Evaluator.evaluate`. Where all variables are whole numbers, no design is evaluated, or counted, twice."""
        if np.isinf(self.box.designs):
            return super().evaluate(Z, way)
        keys = [row.tobytes() for row in Z]
        new = [*{key: i for i, key in reversed([*enumerate(keys)]) if key not in self.known_designs}.values()][::-1]
        if new:
            one = super().evaluate(Z[new], way)
            assert one.residuals is not None
            for i, *row in zip(new, one.F, one.violation[:, None], one.residuals, strict=True):
                self.known_designs[keys[i]] = np.concatenate([Z[i], *row])
        rows, d, m = np.array([self.known_designs[key] for key in keys]), len(self.free), self.m
        F, violation, residuals = rows[:, d : d + m], rows[:, d + m], rows[:, d + m + 1 :]
        return Evaluation(Z.copy(), F, violation, self._status(violation), residuals=residuals)

    def _status(self, violation: np.ndarray) -> np.ndarray:
        return np.where(np.isinf(violation), FAILED, np.where(violation <= self.tolerance, CONVERGED, INFEASIBLE))

    def _evaluate(self, Z: np.ndarray, way: int | None = None) -> tuple[Evaluation, int]:
        F, residuals = self._values(Z)
        self.m_known = learned(self.m_known, F.shape[1], f"function returned {F.shape[1]}")
        equal = residuals[:, self._equalities]
        residuals[:, self._equalities] = np.copysign(np.maximum(np.abs(equal) - self._missed, 0.0), equal)
        violation = np.abs(residuals).max(axis=1, initial=0.0)
        failed = ~(np.isfinite(F).all(axis=1) & np.isfinite(violation))
        F[failed], violation[failed] = np.nan, np.inf
        self._failing = self._failing + len(failed) if failed.all() else int(np.argmin(failed[::-1]))
        if failed.any() and not self.counts.first_failure:
            i = int(np.argmax(failed))
            self.counts.first_failure = f"{self._why.get(i, 'a value is no finite number')}, at {self.problem.named(Z[i])}"
            log.warning("an evaluation failed: %s", self.counts.first_failure)
        return Evaluation(Z=Z.copy(), F=F, violation=violation, status=self._status(violation), residuals=residuals), 0


SENSES = ("minimize", "maximize")

Outputs = np.ndarray | tuple[np.ndarray, np.ndarray]


def plain_problem(
    function: Any,
    bounds: Sequence | Mapping[str, Sequence[float]] | None = None,
    *,
    constraints: Callable[[np.ndarray], np.ndarray] | None = None,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    senses: Sequence[str] | None = None,
    integer: bool | Sequence[str] = False,
    name: str = "",
) -> CompiledVectorProblem:
    """The vector problem of a plain vector function or a pymoo Problem; see `Solver.minimize` for the arguments and what is refused.

    Its variables are called as the keys of `bounds`, else "x1", "x2", ...; its `goals` are empty if nothing says how many there are. A
    front keeps the `name`; without one it does not say what it is of.
    """
    m: int | None = None
    equalities: tuple[int, ...] = ()
    if is_pymoo(function):
        equalities = tuple(range(int(function.n_ieq_constr), int(function.n_ieq_constr + function.n_eq_constr)))
        m = int(function.n_obj)
        variables = _pymoo_variables(function, bounds)
        function = PymooFunction(function, variables)
    else:
        variables = read_bounds(bounds)
    if not callable(function):
        raise ValueError(f"function: must be callable or a pymoo Problem, not {type(function).__name__}")
    if constraints is not None and not callable(constraints):
        raise ValueError(f"constraints: must be callable, not {type(constraints).__name__}")
    labels = {"names": _labels("names", names), "units": _labels("units", units), "senses": _labels("senses", senses)}
    for sense in labels["senses"] or ():
        if sense not in SENSES:
            raise ValueError(f"senses: must be 'minimize' or 'maximize', not {sense!r}")
    given = labels["names"]
    if given and len(set(given)) < len(given):
        raise ValueError(f"names: {', '.join(given)} has a name twice")
    for key, words in labels.items():
        if words is not None:
            m = learned(m, len(words), f"{key} has {len(words)}")
    return CompiledVectorProblem(
        name=name,
        variables=_whole(variables, integer),
        goals=() if m is None else default_goals(m, labels["names"], labels["units"], labels["senses"]),
        limits=None,
        rows=PlainRows(function, constraints),
        equalities=equalities,
    )


def default_goals(
    m: int, names: Sequence[str] | None = None, units: Sequence[str] | None = None, senses: Sequence[str] | None = None
) -> tuple[Objective, ...]:
    """m objectives: "f1", "f2", ..., without units and minimised, unless said otherwise."""
    words = names or [f"f{k + 1}" for k in range(m)], units or [""] * m, senses or [SENSES[0]] * m
    return tuple(Objective(*those) for those in zip(*words, strict=True))


def learned(known: int | None, count: int, source: str) -> int:
    """The number of objectives from `source`. Raises ValueError if it is known to be another."""
    if count < 1 or (known is not None and known != count):
        raise ValueError(f"objectives: {source}, {known or 'at least 1'} expected")
    return count


@dataclass(frozen=True)
class PlainRows:
    """A plain function, with its constraints in its values or as a separate function, as `problems.vector.Rows`."""

    function: Callable[[np.ndarray], Outputs]
    constraints: Callable[[np.ndarray], np.ndarray] | None

    def __call__(self, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        given = X.copy()  # the function may change its own
        outputs = self.function(X)
        F, G = outputs if isinstance(outputs, tuple) and len(outputs) == 2 else (outputs, None)
        values = _rows("function: the objectives", F, len(X))
        columns = [] if G is None else [_rows("function: the constraints", G, len(X))]
        if self.constraints is not None:
            columns.append(_rows("constraints: what it returned", self.constraints(given), len(X)))
        return values, np.hstack([np.empty((len(X), 0)), *columns])


def read_bounds(bounds: Any) -> tuple[Variable, ...]:
    """The variables of a sequence of pairs, a pair of sequences longer than two (lower and upper bounds), or a dict of pairs by name."""
    if bounds is None:
        raise ValueError("bounds: missing")
    named = isinstance(bounds, Mapping)
    try:
        pairs = list(bounds.values() if named else bounds)
    except TypeError:
        raise ValueError(f"bounds: pairs (lower, upper) expected, or a mapping of them by name, not {shown(bounds)}") from None
    if not pairs:
        raise ValueError("bounds: empty")
    if not named and len(pairs) == 2 and all(np.ndim(side) == 1 and len(side) > 2 for side in pairs):
        if len(pairs[0]) != len(pairs[1]):
            raise ValueError(f"bounds: {len(pairs[0])} lower and {len(pairs[1])} upper ones")
        pairs = list(zip(*pairs, strict=True))
    variables = []
    for name, pair in zip(map(str, bounds) if named else (f"x{i + 1}" for i in range(len(pairs))), pairs, strict=True):
        check_text(name, "bounds: the name of a variable")
        what = f"the bounds of variable '{name}'"
        lower, upper = interval(pair, what)
        if lower == upper or not np.isfinite(upper - lower):
            raise ValueError(f"{what}, ({lower!r}, {upper!r}), leave nothing to decide, or are too far apart")
        variables.append(Variable(name, lower, upper, "", upper - lower))
    return tuple(variables)


def _labels(name: str, labels: Sequence[str] | None) -> tuple[str, ...] | None:
    """The labels as a tuple; a single string is refused."""
    if labels is None:
        return None
    if isinstance(labels, str) or not all(isinstance(label, str) for label in labels):
        raise ValueError(f"{name}: must be a sequence of strings, one for each objective, not {labels!r}")
    for label in labels:
        check_text(label, f"{name}: one")
    return tuple(labels)


def _rows(what: str, values: Any, count: int) -> np.ndarray:
    """Copy (count, k) of the values that a user's function returned for `count` points; (count,) counts as one column."""
    try:
        array = real_numbers(values)
    except (TypeError, ValueError):
        raise ValueError(f"{what} must be an array of real numbers, not {shown(values)}") from None
    if array.shape == (count,):
        array = array[:, None]
    if array.ndim != 2 or len(array) != count:
        raise ValueError(f"{what} have shape {array.shape} for {count} points, ({count}, k) expected")
    return array


def is_pymoo(problem: Any) -> bool:
    """Whether this is a pymoo Problem, by its attributes, without importing pymoo."""
    return all(hasattr(problem, name) for name in ("n_var", "n_obj", "xl", "xu", "evaluate"))


def _whole(variables: tuple[Variable, ...], integer: bool | Sequence[str]) -> tuple[Variable, ...]:
    """The variables, of which all, or those of some names, are whole numbers."""
    named = [v.name for v in variables] if integer is True else [integer] if isinstance(integer, str) else list(integer or ())
    for name in named:
        if name not in [v.name for v in variables]:
            raise ValueError(f"integer: {unknown('variable', name, (v.name for v in variables))}")
    for v in variables:
        if v.name in named:
            whole((v.lower, v.upper), f"variable '{v.name}'")
    return tuple(replace(v, integer=v.integer or v.name in named) for v in variables)


def _pymoo_variables(problem: Any, bounds: Any) -> tuple[Variable, ...]:
    """The variables of a pymoo Problem: of `vars` with their names, else of `xl`, `xu` and `vtype`, or with other bounds."""
    own, kind, what = getattr(problem, "vars", None), getattr(problem, "vtype", None), f"pymoo problem {type(problem).__name__}"
    if own:
        return tuple(_pymoo_variable(str(name), one, what) for name, one in own.items())
    if bounds is None:
        lower, upper = (0, 1) if kind is bool and problem.xl is None else (problem.xl, problem.xu)
        if lower is None or upper is None:
            raise ValueError(f"bounds: {what} has no bounds of its variables")
        sides = (np.broadcast_to(side, problem.n_var).tolist() for side in (lower, upper))
        bounds = list(zip(*sides, strict=True))
    if kind is not None and not (isinstance(kind, type) and (issubclass(kind, float | int | np.number) or kind.__name__ in _PYMOO)):
        raise ValueError(f"function: {what} has variables of type {getattr(kind, '__name__', kind)}, which are neither numbers nor choices")
    real = kind is None or issubclass(kind, float | np.floating) or kind.__name__ == "Real"
    return _whole(read_bounds(bounds), not real)


_PYMOO = ("Real", "Integer", "Binary", "Choice")  # classes of pymoo's variables


def _pymoo_variable(name: str, one: Any, what: str) -> Variable:
    kind = next((word for word in _PYMOO if word in [each.__name__ for each in type(one).__mro__]), "")
    if kind == "Choice":
        labels = [str(option) for option in one.options]
        labels = labels if len(set(labels)) == len(labels) else [f"{label} ({i})" for i, label in enumerate(labels)]
        return Variable(name, 0.0, len(labels) - 1.0, "", len(labels) - 1.0, integer=True, choices=choices(labels, f"variable '{name}'"))
    if not kind:
        raise ValueError(f"function: {what} has a variable '{name}' of the class {type(one).__name__}, one of {', '.join(_PYMOO)} expected")
    bounds = (0, 1) if kind == "Binary" else one.bounds
    return _whole(read_bounds({name: bounds}), kind != "Real")[0]


@dataclass(frozen=True)
class PymooFunction:
    """A pymoo Problem, vectorised or elementwise, as function that returns (F, G); the last columns of G are its equality constraints."""

    problem: Any
    variables: tuple[Variable, ...]

    def __call__(self, X: np.ndarray) -> Outputs:
        given = pymoo_rows(self.problem, self.variables, X)
        out = self.problem.evaluate(given, return_values_of=["F", "G", "H"], return_as_dictionary=True)
        columns = [out[key] for key in ("G", "H") if out.get(key) is not None and np.size(out[key])]
        return (out["F"], np.hstack(columns)) if columns else out["F"]


def pymoo_rows(problem: Any, variables: Sequence[Variable], X: np.ndarray) -> np.ndarray:
    """Rows X (k, d) as a pymoo Problem wants them: dicts by name where it has `vars`, whole numbers where its `vtype` is that."""
    own = getattr(problem, "vars", None)
    if not own:
        whole = [v.integer for v in variables]
        return X if not all(whole) else X.astype(bool if problem.vtype is bool else int)
    rows = np.empty(len(X), dtype=object)
    for i, row in enumerate(X.tolist()):
        rows[i] = {name: _pymoo_value(one, v, value) for (name, one), v, value in zip(own.items(), variables, row, strict=True)}
    return rows


def pymoo_numbers(problem: Any, variables: Sequence[Variable], rows: Any) -> np.ndarray:
    """Rows as a pymoo Problem wants them as numbers (k, d)."""
    own = getattr(problem, "vars", None)
    if not own:
        return np.array(rows, dtype=float)
    pairs = [*zip(own.items(), variables, strict=True)]
    numbers = [[[*one.options].index(row[name]) if v.choices else row[name] for (name, one), v in pairs] for row in rows]
    return np.array(numbers, dtype=float)


def _pymoo_value(one: Any, variable: Variable, value: float) -> Any:
    if variable.choices:
        return one.options[round(value)]
    return bool(value) if getattr(type(one), "vtype", None) is bool else variable.meant(value)


@dataclass(frozen=True)
class Reevaluation:
    """One point evaluated again; with the names of a `Simulation`."""

    objectives: Mapping[str, float]  # by name, in the user's units and senses
    violations: Mapping[str, float]  # scaled residual by constraint, and of bounds that are exceeded
    violation: float  # the largest of them; infinite if the evaluation failed
    # defect, max_defect, trajectory: Empty, 0 and None: there are no states.
    defect: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    max_defect: float = 0.0
    trajectory: Any = None


def evaluated_again(problem: CompiledVectorProblem, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[dict[str, float]]]:
    """Objectives (n, m), all minimised, largest violations (n,), and violations by name of decisions (n, d), those of bounds included.

    A failed evaluation has NaN and infinity. Constraints without names are called g1, g2, ...
    """
    if not len(Z):
        return np.empty((0, len(problem.goals))), np.empty(0), []
    F, found = BlackBox(problem)._values(np.array(Z, dtype=float))
    beyond = excess(np.asarray(Z, dtype=float)[:, None], problem.variables)
    limits = [f"g{k + 1}" for k in range(found.shape[1])] if problem.limits is None else [limit.name for limit in problem.limits]
    names = [*limits, *(f"bounds of {v.name}" for v in problem.variables)]
    amounts = np.hstack([np.abs(found), beyond])
    failed = ~(np.isfinite(F).all(axis=1) & np.isfinite(found).all(axis=1))
    F = np.where(failed[:, None], np.nan, F)
    violations = [
        {name: float(amount) for k, (name, amount) in enumerate(zip(names, row, strict=True)) if k < len(limits) or amount > 0.0}
        for row in amounts
    ]
    return F, np.where(failed, np.inf, amounts.max(axis=1, initial=0.0)), violations


def reevaluation(problem: CompiledVectorProblem, z: np.ndarray) -> Reevaluation:
    """One decision (d,) evaluated again."""
    F, violation, violations = evaluated_again(problem, z[None])
    objectives = {goal.name: float(goal.sign * value) for goal, value in zip(problem.goals, F[0], strict=True)}
    return Reevaluation(objectives, violations[0], float(violation[0]))
