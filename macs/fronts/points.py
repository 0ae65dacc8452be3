"""Points of a front as columns; independent of files, tables, figures and solvers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, overload

import numpy as np

from problems.compiled import CompiledProblem, Objective, Variable
from problems.vector import without_dynamics
from transcription.trajectories.costates import Costates
from transcription.trajectories.trajectory import Trajectory

from ..io.text import counted
from .point import Point, number
from .provenance import STATS, AnyCompiled, Source, versions


def frozen(array: Any) -> np.ndarray:
    """A read-only copy."""
    copy = np.array(array)
    copy.setflags(write=False)
    return copy


def by_first(objectives: np.ndarray) -> np.ndarray:
    """Rows sorted by the first objective, ties by the next ones; NaN last."""
    return np.lexsort(objectives.T[::-1])


def column(values: Any, n: int, name: str) -> Any:
    """The `values`, which must be n; n times None for None."""
    if values is None:
        return [None] * n
    if len(values) != n:
        raise ValueError(f"{name} has {len(values)} entries, F has {n} rows")
    return values


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
        each = [tuple(own) for own in variables if not isinstance(own, Variable)] or [common] * len(rows)
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

    Parameters
    ----------
    F : array (n, m)
        Objectives, all minimised.
    decision : n arrays
        Decision vectors in the user's units.
    violation, status : (n,)
        Largest scaled residual of any constraint; "converged", "infeasible", "failed" or "timeout".
    goals : tuple of Objective
        The m objectives as the user stated them.
    variables : tuple of Variable, or n of them
        Variables of the decision vectors: the same for all points, or one tuple for each point.
    violations : n dicts, optional
        Scaled residual by constraint.
    trajectories : n Trajectories, optional
        None for black boxes, and for a point without a trajectory.
    excursions, optimality : n dicts or None, n floats or None, optional
        Excess, scaled, of quantities that leave their bounds between nodes; scaled residual of the conditions of Pareto optimality.
    costates : n Costates or None, optional
        Of points that are optimal.
    notes : n str, optional
        Remarks, for example why a mesh could not be refined enough.
    defect, simulated_violation, simulated_F, verified : (n,), (n,), (n, m), (n,), optional
        By a simulation: largest difference of a state from the transcription, in spans of its bounds; largest scaled residual of any
        constraint; objectives, all minimised; whether these agree with the point within `stats["verify"]`. NaN and False without it.
    transcriptions : dict, or n of them, optional
        `{"method": ..., "settings": {...}}`: the transcription of all points, or one for each; None for black boxes.
    problem : CompiledProblem, CompiledVectorProblem or Source, optional
        None for black boxes.
    solver : dict, optional
        `{"name": ..., "settings": {...}}`.
    stats : dict, optional
        Costs of the points; missing entries of `STATS` are added.
    message, closest : str and Point, optional
        For an empty front: the reason, with the most violated constraint, and the least infeasible point.
    sort : bool
        Sort by the first objective, in the user's value; otherwise keep the order.

    Attributes
    ----------
    F, violation, status, defect, simulated_violation, simulated_F, verified : read-only arrays
    violations, trajectories, excursions, optimality, costates, notes, transcriptions : tuples of n
        Points on one mesh share one dict of `transcriptions`.
    source : Source or None
        Identity of the problem, None for a black box.
    variables : tuple of Variable (D)
        All variables of all points. Those of one point, in the order of its decision vector, are `Point.variables`.
    decision : array (n, D)
        A column for each of `variables`; NaN if the point, on a mesh of its own, does not have the variable. `Point.decision` has no NaN.
    """

    ROWS = (
        *("F", "violation", "status", "violations", "trajectories", "excursions", "optimality", "costates", "notes"),
        *("transcriptions", "defect", "simulated_violation", "simulated_F", "verified"),
    )
    """Columns with one entry for each point, besides the decision vectors."""

    def __init__(
        self,
        *,
        F: Any,
        decision: Any,
        violation: Any,
        status: Any,
        goals: Sequence[Objective],
        variables: Sequence[Variable | Sequence[Variable]] = (),
        violations: Sequence[Mapping[str, float] | None] | None = None,
        trajectories: Sequence[Trajectory | None] | None = None,
        excursions: Sequence[Mapping[str, float] | None] | None = None,
        optimality: Sequence[float | None] | None = None,
        costates: Sequence[Costates | None] | None = None,
        notes: Sequence[str | None] | None = None,
        transcriptions: Mapping[str, Any] | Sequence[Mapping[str, Any] | None] | None = None,
        defect: Any = None,
        simulated_violation: Any = None,
        simulated_F: Any = None,
        verified: Any = None,
        problem: AnyCompiled | Source | None = None,
        solver: Mapping[str, Any] | None = None,
        stats: Mapping[str, Any] | None = None,
        message: str = "",
        closest: Point | None = None,
        sort: bool = True,
    ):
        self.goals = tuple(goals)
        self.solver = dict(solver or {})
        self.stats: dict[str, Any] = {**STATS, "failures": {}, "versions": versions(), **(stats or {})}
        self.stats["failures"] = dict(self.stats["failures"])
        self.message = message
        self._closest = closest
        self.source = Source.of(problem) if isinstance(problem, AnyCompiled) else problem
        self._problem = problem if isinstance(problem, AnyCompiled) else None

        rows = np.asarray(F, dtype=float).reshape(-1, len(self.goals))
        n = len(rows)
        order = by_first(rows * self.signs) if sort else np.arange(n)

        def ordered(values: Any, name: str) -> list[Any]:
            entries = column(values, n, name)
            return [entries[i] for i in order]

        def numbers(values: Any, name: str) -> np.ndarray:
            return frozen(np.asarray(ordered(np.full(n, np.nan) if values is None else values, name), dtype=float))

        self.F = frozen(rows[order])
        self.violation = numbers(violation, "violation")
        self.status = frozen(np.asarray(ordered(status, "status"), dtype=str))
        common = not len(variables) or isinstance(variables[0], Variable)
        self._decisions = Decisions.of(ordered(decision, "decision"), variables if common else ordered(variables, "variables"))
        given = [transcriptions] * n if isinstance(transcriptions, Mapping) else transcriptions
        self.transcriptions = shared(ordered(given, "transcriptions"))
        self.violations: tuple[Mapping[str, float] | None, ...] = tuple(ordered(violations, "violations"))
        self.trajectories: tuple[Trajectory | None, ...] = tuple(ordered(trajectories, "trajectories"))
        self.excursions: tuple[Mapping[str, float] | None, ...] = tuple(ordered(excursions, "excursions"))
        self.optimality = tuple(number(value) for value in ordered(optimality, "optimality"))
        self.costates: tuple[Costates | None, ...] = tuple(ordered(costates, "costates"))
        self.notes = tuple(note or "" for note in ordered(notes, "notes"))
        self.defect = numbers(defect, "defect")
        self.simulated_violation = numbers(simulated_violation, "simulated_violation")
        self.simulated_F = numbers(np.full(rows.shape, np.nan) if simulated_F is None else simulated_F, "simulated_F").reshape(rows.shape)
        self.verified = frozen(np.asarray(ordered(np.zeros(n) if verified is None else verified, "verified"), dtype=bool))

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
        for name in self.ROWS:
            entries = getattr(self, name)
            setattr(taken, name, frozen(entries[index]) if isinstance(entries, np.ndarray) else tuple(entries[i] for i in index))
        return taken

    def replace(self, **changes: Any) -> Self:
        """The same points with other columns of `ROWS`, or another problem, solver, stats, message or closest.

        Raises
        ------
        ValueError
            If a column does not have one entry for each point.
        """
        changed = self._copy()
        for name, value in changes.items():
            if name in self.ROWS:
                entries = column(value, len(self), name)
                setattr(changed, name, frozen(entries) if isinstance(getattr(self, name), np.ndarray) else tuple(entries))
            elif name == "problem":
                changed._problem, changed.source = value, Source.of(value)
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
        all_rows: dict[str, Any] = {name: [entry for points in several for entry in getattr(points, name)] for name in cls.ROWS}
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
