"""Points of a front as columns; independent of files, tables, figures and solvers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self, overload

import numpy as np

from problems.compiled import CompiledProblem, Objective, Variable
from problems.vector import without_dynamics
from transcription.trajectories.costates import Costates
from transcription.trajectories.trajectory import Trajectory

from ..io.netcdf import COUNT, NUMBER, TEXT, FileArray
from ..io.text import counted, numbers
from .point import Point, number
from .provenance import STATS, AnyCompiled, ProblemSource, versions


def frozen(array: Any) -> np.ndarray:
    """A read-only copy."""
    copy = np.array(array)
    copy.setflags(write=False)
    return copy


def by_first(objectives: np.ndarray) -> np.ndarray:
    """Rows sorted by the first objective, ties by the next ones; NaN last."""
    return np.lexsort(objectives.T[::-1])


def shared(dicts: Sequence[Mapping[str, Any] | None]) -> tuple[dict[str, Any] | None, ...]:
    """The dicts, with equal ones as one object."""
    distinct: list[dict[str, Any]] = []
    found: list[dict[str, Any] | None] = []
    for given in dicts:
        known = next((one for one in distinct if one == given), None)
        if known is None and given is not None:
            known = dict(given)
            distinct.append(known)
        found.append(known)
    return tuple(found)


def _array(kind: type) -> Callable[[Sequence[Any]], np.ndarray]:
    return lambda entries: frozen(np.asarray(entries, dtype=kind))


def _notes(entries: Sequence[Any]) -> tuple[str, ...]:
    return tuple(note or "" for note in entries)


def _optional_numbers(entries: Sequence[Any]) -> tuple[float | None, ...]:
    return tuple(number(value) for value in entries)


class PointColumn(NamedTuple):
    """A column of points with one entry for each of them."""

    keep: Callable[[Sequence[Any]], Any]  # the column, from its entries
    default: Any = None  # entry of a point for which there is none; of rows of objectives, of each of them
    array: str = ""  # what it is called in a file, where it has its own array
    stored: FileArray | None = None


def _stored(array: str, kind: str, long_name: str, optional: bool = False) -> tuple[str, FileArray]:
    return array, FileArray(("point",), kind, long_name, optional=optional)


COLUMNS = {
    "F": PointColumn(_array(float)),
    "violation": PointColumn(_array(float), np.nan, *_stored("violation", NUMBER, "largest scaled residual of any constraint")),
    "status": PointColumn(_array(str), "", *_stored("status", TEXT, "converged, infeasible, failed or timeout")),
    "violations": PointColumn(tuple),
    "trajectories": PointColumn(tuple),
    "excursions": PointColumn(tuple),
    "optimality": PointColumn(
        _optional_numbers, None, *_stored("optimality", NUMBER, "scaled residual of Pareto optimality, NaN if not computed")
    ),
    "costates": PointColumn(tuple),
    "weighted_gain": PointColumn(
        _array(float),
        np.nan,
        *_stored("weighted_gain", NUMBER, "what other controls would gain in the weighted sum of objectives, NaN if not known", True),
    ),
    "notes": PointColumn(_notes, "", *_stored("note", TEXT, "remark on the point")),
    "transcriptions": PointColumn(shared),
    "defect": PointColumn(
        _array(float), np.nan, *_stored("defect", NUMBER, "largest scaled difference of a simulated state, NaN if not simulated", True)
    ),
    "simulated_violation": PointColumn(
        _array(float), np.nan, *_stored("simulated_violation", NUMBER, "largest scaled residual of any constraint as simulated", True)
    ),
    "simulated_F": PointColumn(_array(float), np.nan),
    "tolerances": PointColumn(_array(float), np.nan),
    "within": PointColumn(
        _array(float),
        np.nan,
        *_stored("within", NUMBER, "what the point may miss in states and constraints, scaled; NaN if not judged", True),
    ),
    "verified": PointColumn(_array(bool), False, *_stored("verified", COUNT, "1 if the simulation agrees with the point, else 0", True)),
}
"""What points consist of besides their decision vectors: the one table behind `Points`, its selections, unions, and its file."""


@dataclass(frozen=True, eq=False)
class Decisions:
    """n decision vectors as one table, a column for each variable that any of them has."""

    variables: tuple[Variable, ...]  # in the order of the first point, then those that only later ones have
    values: np.ndarray  # (n, D): NaN where a point has no such variable
    places: tuple[np.ndarray, ...]  # the columns that a point's own vector consists of, in its order

    @classmethod
    def of(cls, rows: Sequence[Any], variables: Sequence[Variable | Sequence[Variable]]) -> Decisions:
        """From n vectors and their variables: one sequence for all of them, or one for each.

        Raises ValueError if a vector has not as many entries as variables.
        """
        common = tuple(v for v in variables if isinstance(v, Variable))
        each = [tuple(own) for own in variables if not isinstance(own, Variable)]
        if not each and all(len(row) == len(common) for row in rows):
            return cls.placed(common, np.array(rows, dtype=float).reshape(len(rows), len(common)), [np.arange(len(common))] * len(rows))
        each = each or [common] * len(rows)
        columns: dict[Variable, int] = {}
        places = {own: np.array([columns.setdefault(v, len(columns)) for v in own], dtype=int) for own in dict.fromkeys([common, *each])}
        values = np.full((len(rows), len(columns)), np.nan)
        for i, (row, own) in enumerate(zip(rows, each, strict=True)):
            if len(row) != len(own):
                raise ValueError(f"decision {i} has {len(row)} entries, its variables are {len(own)}")
            values[i, places[own]] = row
        return cls.placed(tuple(columns), values, [places[own] for own in each])

    @classmethod
    def placed(cls, variables: tuple[Variable, ...], values: np.ndarray, places: Sequence[np.ndarray]) -> Decisions:
        """From the parts; the arrays are made read-only."""
        for array in (values, *places):
            array.setflags(write=False)
        return cls(variables, values, tuple(places))

    def row(self, i: int) -> np.ndarray:
        """The vector of point i, read-only."""
        row = self.values[i, self.places[i]]
        row.setflags(write=False)
        return row

    def variables_of(self, i: int) -> tuple[Variable, ...]:
        """What its entries are."""
        return tuple(self.variables[column] for column in self.places[i].tolist())

    def take(self, rows: Sequence[int] | np.ndarray) -> Decisions:
        """Some of the points, in the order given, without the variables that none of them has."""
        places = [self.places[i] for i in rows]
        used = np.zeros(len(self.variables), dtype=bool)
        for place in places or [np.arange(len(used))]:
            used[place] = True
        column = np.cumsum(used) - 1
        kept = tuple(v for v, keep in zip(self.variables, used.tolist(), strict=True) if keep)
        return self.placed(kept, self.values[np.asarray(rows, dtype=int)][:, used], [column[place] for place in places])


class Points:
    """Points of one problem as columns with one entry for each point.

    They are made of `F`, `decision`, `variables`, `goals` and the columns of `COLUMNS`, each with n entries; those left out have their
    defaults. `variables` are the same for all points, or one tuple for each; so are `transcriptions`. `sort`: by the first objective, in
    the user's value; otherwise the order is kept. Missing entries of `stats` are those of `STATS`.
    """

    goals: tuple[Objective, ...]  # the m objectives as the user stated them
    F: np.ndarray  # (n, m), all minimised
    violation: np.ndarray  # (n,): largest scaled residual of any constraint
    status: np.ndarray  # (n,): "converged", "infeasible", "failed" or "timeout"
    violations: tuple[Mapping[str, float] | None, ...]  # scaled residual by constraint
    trajectories: tuple[Trajectory | None, ...]  # None for black boxes, and for a point without a trajectory
    excursions: tuple[Mapping[str, float] | None, ...]  # excess, scaled, of quantities that leave their bounds between nodes
    optimality: tuple[float | None, ...]  # scaled residual of the conditions of Pareto optimality
    costates: tuple[Costates | None, ...]  # of points that are optimal
    weighted_gain: np.ndarray  # (n,): of these, what other controls would gain in the sum to which the costates belong; else NaN
    notes: tuple[str, ...]  # remarks, for example why a mesh could not be refined enough
    transcriptions: tuple[dict[str, Any] | None, ...]  # {"method": ..., "settings": {...}}: one dict for points on one mesh
    # By a simulation, NaN and False without one:
    defect: np.ndarray  # (n,): largest difference of a state from the transcription, in spans of its bounds
    simulated_violation: np.ndarray  # (n,)
    simulated_F: np.ndarray  # (n, m)  # noqa: N815
    verified: np.ndarray  # (n,): whether all of these agree with the point, within these:
    tolerances: np.ndarray  # (n, m): in the units of the objectives. Fixed when a point is first judged, and part of it from then on
    within: np.ndarray  # (n,): of states, in spans of their bounds, and constraints, in their scales
    source: ProblemSource | None  # identity of the problem; None for a black box
    solver: dict[str, Any]  # {"name": ..., "settings": {...}}
    stats: dict[str, Any]  # costs of the points
    message: str  # of an empty front: why there is no point

    def __init__(
        self,
        *,
        F: Any,
        decision: Any,
        violation: Any,
        status: Any,
        goals: Sequence[Objective],
        variables: Sequence[Variable | Sequence[Variable]] = (),
        problem: AnyCompiled | ProblemSource | None = None,
        solver: Mapping[str, Any] | None = None,
        stats: Mapping[str, Any] | None = None,
        message: str = "",
        closest: Point | None = None,
        sort: bool = True,
        **columns: Any,
    ):
        self.goals = tuple(goals)
        self.solver = dict(solver or {})
        self.stats = {**STATS, "failures": {}, "versions": versions(), **(stats or {})}
        self.stats["failures"] = dict(self.stats["failures"])
        self.message = message
        self._closest = closest
        self.source = ProblemSource.of(problem) if isinstance(problem, AnyCompiled) else problem
        self._problem = problem if isinstance(problem, AnyCompiled) else None

        rows = np.asarray(F, dtype=float).reshape(-1, len(self.goals))
        n = len(rows)
        order = (by_first(rows * self.signs) if sort else np.arange(n)).tolist()
        columns |= {"violation": violation, "status": status}
        unknown = columns.keys() - COLUMNS.keys()
        if unknown:
            raise TypeError(f"points have no column '{min(unknown)}'")
        for name in COLUMNS:
            entries = self._entries(name, rows if name == "F" else columns.get(name), n)
            self._set(name, [entries[i] for i in order])
        if len(decision) != n:
            raise ValueError(f"decision has {len(decision)} entries, F has {n} rows")
        common = not len(variables) or isinstance(variables[0], Variable)
        if not common and len(variables) != n:
            raise ValueError(f"variables has {len(variables)} entries, F has {n} rows")
        self._decisions = Decisions.of([decision[i] for i in order], variables if common else [variables[i] for i in order])

    def _entries(self, name: str, values: Any, n: int) -> Any:
        """The n entries of a column."""
        if values is None:
            return [COLUMNS[name].default] * n
        if isinstance(values, Mapping):
            return [values] * n
        if len(values) != n:
            raise ValueError(f"{name} has {len(values)} entries, F has {n} rows")
        return values

    def _set(self, name: str, entries: Sequence[Any]) -> None:
        """Set a column from its entries."""
        values = COLUMNS[name].keep(entries)
        if name in ("F", "simulated_F", "tolerances") and values.ndim < 2:  # no points, or the same for all objectives
            values = frozen(np.tile(values[:, None], (1, len(self.goals))))
        setattr(self, name, values)

    @property
    def signs(self) -> np.ndarray:
        """+1 for a minimised, -1 for a maximised objective, (m,)."""
        return np.array([goal.sign for goal in self.goals])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objectives."""
        return tuple(goal.name for goal in self.goals)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the objectives."""
        return tuple(goal.unit for goal in self.goals)

    @property
    def senses(self) -> tuple[str, ...]:
        """ "minimize" or "maximize", for each objective."""
        return tuple(goal.sense for goal in self.goals)

    @property
    def objectives(self) -> np.ndarray:
        """Objectives (n, m) in the user's units and senses."""
        return self.F * self.signs

    @property
    def was_simulated(self) -> np.ndarray:
        """Mask (n,) of the points that were simulated."""
        return ~np.isnan(self.defect)

    @property
    def resolution(self) -> np.ndarray:
        """Least tolerance (m,) of a point in each objective, in its unit: as far as its digits are verified; NaN where none was judged."""
        return np.fmin.reduce(self.tolerances, axis=0, initial=np.nan)

    def texts(self, objectives: Iterable[float]) -> list[str]:
        """Objectives (m,) of one point, in the user's units and senses, with the digits that tables of these points have."""
        columns = zip(objectives, self.resolution, self.objectives.T, strict=True)
        return [numbers([value], tolerance, among)[0] for value, tolerance, among in columns]

    @property
    def gain(self) -> np.ndarray:
        """What other controls would gain in all objectives together (n,), to first order, in what counts as one in each; NaN: not known."""
        weights = [np.full(len(self.goals), np.nan) if one is None else one.weights for one in self.costates]
        units = self.tolerances / self.within[:, None]
        return self.weighted_gain / (np.reshape(weights, units.shape) * units).sum(axis=1)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All variables of all points, (D,)."""
        return self._decisions.variables

    @property
    def decision(self) -> np.ndarray:
        """Decision vectors (n, D), a column for each of `variables`; NaN if the point does not have the variable."""
        return self._decisions.values

    @property
    def places(self) -> tuple[np.ndarray, ...]:
        """For each point, the columns of `decision` that form its own vector, in the order of that vector."""
        return self._decisions.places

    @property
    def closest(self) -> Point | None:
        """The least infeasible point; None only if all evaluations failed."""
        if self._closest is not None or not len(self):
            return self._closest
        return self[int(np.argmin(np.where(np.isnan(self.violation), np.inf, self.violation)))]

    @property
    def problem(self) -> AnyCompiled | None:
        """The problem, if it is known; for points from a file, after `stated` has loaded it."""
        return self._problem

    @property
    def dynamic(self) -> bool:
        """Whether the points are trajectories: neither of a black box nor of a vector problem."""
        return self.source is not None and not self.source.vector

    def stated(self) -> AnyCompiled:
        """The problem of the points, with dynamics or without; from a file it is loaded from its address, which runs the code there.

        Raises
        ------
        ValueError
            For a black box, and if the problem is not found or is another one.
        """
        if self.source is None:
            raise ValueError("this front is of a black box: its function has no name, so there is nothing to simulate or evaluate again")
        if self._problem is None:
            self._problem = self.source.load().compile()
        assert self._problem is not None
        return self._problem

    def compiled(self) -> CompiledProblem:
        """The problem of the points if it has dynamics; see `stated`. Raises ValueError if it has none."""
        if self.source is not None and self.source.vector:
            raise ValueError(without_dynamics(self.source.name))
        found = self.stated()
        assert isinstance(found, CompiledProblem)
        return found

    def __len__(self) -> int:
        return len(self.F)

    def __repr__(self) -> str:
        name = self.source.name if self.source else "black box"
        return f"<{type(self).__name__}: {name}: {counted(len(self), 'point')}, {counted(len(self.goals), 'objective')}>"

    def __iter__(self) -> Iterator[Point]:
        return (Point(self, i) for i in range(len(self)))

    @overload
    def __getitem__(self, key: int) -> Point: ...
    @overload
    def __getitem__(self, key: slice | Sequence[int] | np.ndarray) -> Self: ...
    def __getitem__(self, key: Any) -> Point | Self:
        """A `Point` for a number; points of the same class for a slice, a list of numbers or a mask."""
        if isinstance(key, (int, np.integer)) and not isinstance(key, bool):
            if not -len(self) <= key < len(self):
                raise IndexError(f"point {key} of a front of {len(self)}" + (f": {self.message}" if self.message and not len(self) else ""))
            return Point(self, int(key) % len(self))
        return self.take(np.arange(len(self))[key])

    def take(self, rows: Sequence[int] | np.ndarray) -> Self:
        """The points of `rows`, in that order; all other data are unchanged."""
        index = np.asarray(rows, dtype=int)
        taken = self._copy()
        taken._decisions = self._decisions.take(index)
        for name in COLUMNS:
            entries = getattr(self, name)
            setattr(taken, name, frozen(entries[index]) if isinstance(entries, np.ndarray) else tuple(entries[i] for i in index))
        return taken

    def replace(self, **changes: Any) -> Self:
        """The same points with other columns of `COLUMNS`, or another problem, solver, stats, message or closest.

        Raises
        ------
        ValueError
            If a column does not have one entry for each point.
        """
        changed = self._copy()
        for name, value in changes.items():
            if name in COLUMNS:
                changed._set(name, self._entries(name, value, len(self)))
            elif name == "problem":
                changed._problem, changed.source = value, ProblemSource.of(value)
            elif name == "closest":
                changed._closest = value
            elif name in ("solver", "stats", "message"):
                setattr(changed, name, value)
            else:
                raise TypeError(f"points have no '{name}' to replace")
        return changed

    def sorted(self) -> Self:
        """The same points in the order of the first objective, in the user's value."""
        return self.take(by_first(self.objectives))

    @classmethod
    def concatenate(cls, several: Sequence[Points]) -> Self:
        """The points of several sets, one after the other; all other data are those of the first set whose problem is known."""
        known = next((points for points in several if points.problem is not None), several[0])
        all_rows: dict[str, Any] = {name: [entry for points in several for entry in getattr(points, name)] for name in COLUMNS}
        every = [point for points in several for point in points]
        return cls(
            **all_rows,
            decision=[point.decision for point in every],
            variables=[point.variables for point in every] or known.variables,
            goals=known.goals,
            problem=known.problem or known.source,
            solver=known.solver,
            stats=known.stats,
            message=known.message,
            closest=known._closest,
            sort=False,
        )

    def _copy(self) -> Self:
        copy = type(self).__new__(type(self))
        copy.__dict__.update(self.__dict__)
        copy.stats = dict(self.stats)
        return copy
