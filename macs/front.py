"""What a search hands back: a front of points, each of them a trajectory that can be looked at, checked, drawn and saved.

A `Front` is arrays and plain data, one row a point; a `Point` is a light view of one row.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from problems.compiled import CompiledProblem, Objective, Variable

from .fronts.decision_table import Decisions
from .fronts.points import by_first, column, frozen, number, shared
from .fronts.provenance import STATS, Source, versions
from .point import Point

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from problems import Problem
    from transcription.base import Transcription
    from transcription.trajectories.trajectory import Trajectory


class Front:
    """A set of points, in the user's words.

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
        The entries of the decision vectors: the same for all points, or for each its own.
    violations : n dicts, optional
        Scaled residual by constraint.
    trajectories : n Trajectories, optional
        None for black boxes; an entry may be None where a point has none.
    excursions : n dicts or None, optional
        What leaves its bounds between nodes, scaled, by name.
    optimality : n floats or None, optional
    notes : n str, optional
        What there is to say of a point: why its mesh could not be refined enough, say.
    problem : CompiledProblem or Source, optional
        None for black boxes.
    transcription : dict, or n of them, optional
        `{"method": ..., "settings": {...}}`: how the problem was written for all points, or for each; None for black boxes.
    solver : dict, optional
        `{"name": ..., "settings": {...}}`.
    stats : dict, optional
        What the front cost; missing entries of `STATS` are added.
    message : str
        What there is to say of an empty front: the most violated constraint.
    closest : Point, optional
        The least infeasible point of a search that found nothing feasible.
    sort : bool
        By the first objective, in the user's value; else the order given is kept.

    Attributes
    ----------
    F, violation, status, goals, solver, stats, message, source
        As above; `source` says which problem it is, None for a black box.
    transcriptions : tuple of n dicts or None
        How the problem was written for each point. Points on one mesh share one dict.
    variables : tuple of Variable (D)
        Every variable that any point has. Those of one point, in the order of its decision vector, are `Point.variables`.
    decision : array (n, D)
        A column for each of `variables`; NaN where a point, on a mesh of its own, has no such variable. `Point.decision` is without these.
    """

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
        notes: Sequence[str | None] | None = None,
        problem: CompiledProblem | Source | None = None,
        transcription: Mapping[str, Any] | Sequence[Mapping[str, Any] | None] | None = None,
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
        self.source = Source.of(problem) if isinstance(problem, CompiledProblem) else problem
        self._problem = problem if isinstance(problem, CompiledProblem) else None

        rows = np.asarray(F, dtype=float).reshape(-1, len(self.goals))
        n = len(rows)
        order = by_first(rows * self._signs) if sort else np.arange(n)
        self.F = frozen(rows[order])
        self.violation = frozen(np.asarray(column(violation, n, "violation"), dtype=float)[order])
        self.status = frozen(np.asarray(column(status, n, "status"), dtype=str)[order])
        common = not len(variables) or isinstance(variables[0], Variable)
        own = variables if common else [column(variables, n, "variables")[i] for i in order]
        self._decisions = Decisions.of([column(decision, n, "decision")[i] for i in order], own)
        given = [transcription] * n if transcription is None or isinstance(transcription, Mapping) else transcription
        self.transcriptions = shared([column(given, n, "transcription")[i] for i in order])
        self._violations = [column(violations, n, "violations")[i] for i in order]
        self._trajectories = [column(trajectories, n, "trajectories")[i] for i in order]
        self._excursions = [column(excursions, n, "excursions")[i] for i in order]
        self._optimality = [number(column(optimality, n, "optimality")[i]) for i in order]
        self._notes = [column(notes, n, "notes")[i] or "" for i in order]

    # What it holds

    @property
    def _signs(self) -> np.ndarray:
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
        return self.F * self._signs

    @property
    def variables(self) -> tuple[Variable, ...]:
        """See the class."""
        return self._decisions.variables

    @property
    def decision(self) -> np.ndarray:
        """See the class."""
        return self._decisions.values

    @property
    def closest(self) -> Point | None:
        """The least infeasible point. None only if not one evaluation gave a number."""
        if self._closest is not None or not len(self):
            return self._closest
        return self[int(np.argmin(np.where(np.isnan(self.violation), np.inf, self.violation)))]

    @property
    def problem(self) -> CompiledProblem | None:
        """The problem, if it is here; a front from a file has it once `compiled` found it."""
        return self._problem

    def compiled(self) -> CompiledProblem:
        """The problem: what the front was made with, else what its address loads (which runs the code there).

        Raises
        ------
        ValueError
            For a black box, and where the problem is not found or is another one.
        """
        if self.source is None:
            raise ValueError("this front is of a black box: there are no dynamics to simulate")
        if self._problem is None:
            self._problem = self.source.load()
        return self._problem

    def __len__(self) -> int:
        return len(self.F)

    def __iter__(self) -> Iterator[Point]:
        return (Point(self, i) for i in range(len(self)))

    @overload
    def __getitem__(self, key: int) -> Point: ...
    @overload
    def __getitem__(self, key: slice | Sequence[int] | np.ndarray) -> Front: ...
    def __getitem__(self, key: Any) -> Point | Front:
        """A Point for a number; a Front, in that order, for a slice, a list of numbers or a mask."""
        if isinstance(key, (int, np.integer)) and not isinstance(key, bool):
            if not -len(self) <= key < len(self):
                raise IndexError(f"point {key} of a front of {len(self)}" + (f": {self.message}" if self.message and not len(self) else ""))
            return Point(self, int(key) % len(self))
        return self._take(np.arange(len(self))[key])

    def __repr__(self) -> str:
        return f"<Front: {self.table().splitlines()[0]}>"

    def _take(self, rows: Sequence[int] | np.ndarray) -> Front:
        """The front of some of the points, in the order given, with everything else as it is here."""
        front = Front.__new__(Front)
        front.__dict__.update(self.__dict__)
        index = np.asarray(rows, dtype=int)
        for name in ("F", "violation", "status"):
            setattr(front, name, frozen(getattr(self, name)[index]))
        front._decisions = self._decisions.take(index)
        front.transcriptions = tuple(self.transcriptions[i] for i in index)
        for name in ("_violations", "_trajectories", "_excursions", "_optimality", "_notes"):
            setattr(front, name, [getattr(self, name)[i] for i in index])
        front.stats = dict(self.stats)
        return front

    # What it becomes

    def refine_mesh(self, *, tolerance: float = 1e-7, limit: int = 8, time_limit: float | None = None, progress: bool = False) -> Front:
        """The front with each point solved anew on a mesh of its own, refined until what the point promises can be flown.

        Errors are estimated by integration element by element, by looking at states, controls and path constraints between the nodes, and
        by the objectives as flown. Elements are split where a solution is not smooth, and get a higher order where it is; controls that
        leave their bounds between nodes are written by their Bernstein coefficients, which bound them. A point keeps its place along the
        front: from its old objectives it is solved along the front's ranges (Pascoletti and Serafini); the best point of each objective is
        that of the refined front.

        Parameters
        ----------
        tolerance : float
            Largest defect. Ten times this, in ranges of the front, is by how much objectives may still change from mesh to mesh, or when
            flown. Controls may not leave their bounds at all, states and path constraints by the front's own tolerance.
        limit : int
            How many meshes are tried for each point.
        time_limit : float, optional
            Seconds after which the work ends with what there is; looked at, like Ctrl-C, before each solve.
        progress : bool
            Tell on the terminal how it stands.

        Returns
        -------
        Front
            As many points. Those that do not meet the tolerance say why (`Point.note`), and `message` says how many do. Ctrl-C ends the
            work with what there is.

        Raises
        ------
        ValueError
            For a black box, a problem that cannot be found, another transcription than DFET, and arguments that make no sense.
        """
        from .gradients.mesh_refinement import refine_mesh

        return refine_mesh(self, tolerance, limit, time_limit, progress)

    def polished(
        self,
        transcription: Transcription,
        *,
        solves: int | None = None,
        limit: int | None = None,
        verify: float | None = None,
        time_limit: float | None = None,
        progress: bool = False,
    ) -> Front:
        """The front brought down to the Pareto front by gradient solves, whichever solver found it on whichever transcription.

        A search wants candidates that are scored quickly, such as those of single shooting; gradients want a sparse problem, such as that
        of DFET. The solves begin from the front's trajectories, interpolated: first the best of each objective, then places all over the
        front, or along it; see `MACS`. Points that no solve came to better remain what they are, on their own transcription. Without any
        points, they begin from what is `closest` to one.

        Parameters
        ----------
        transcription : Transcription
            On which to solve.
        solves : int, optional
            How many gradient solves there may be. Default: as many as there are points, or one.
        limit : int, optional
            Most points of the result, well spread. Default: as many as there are.
        verify : float, optional
            By how much, in their scales, constraints may be missed when a point is flown. Points that miss more are solved once more, three
            times at most, inside of their limits by what they missed; these solves come beside, and `Point.note` tells of them. What still
            misses more then, also of the front's own points, is left out. Default: what the mesh says is believed.
        time_limit : float, optional
            Seconds after which the work ends with what there is; looked at, like Ctrl-C, before each solve.
        progress : bool
            Tell on the terminal how it stands.

        Returns
        -------
        Front
            Feasible, mutually non-dominated points; those that were solved for have their `optimality`, unless they were moved inside.
            Costs are added to those of the search. Ctrl-C ends the work with what there is.

        Raises
        ------
        ValueError
            For a black box, a problem that cannot be found, peaks that gradient tools refuse, and arguments that make no sense.
        """
        from .gradients.front_polish import polished

        return polished(self, transcription, solves, limit, verify, time_limit, progress)

    def simulate(
        self,
        problem: Problem | CompiledProblem | None = None,
        *,
        tolerance: float = 1e-2,
        rtol: float = 1e-6,
        atol: float = 1e-7,
        method: str = "DOP853",
    ) -> Front:
        """The same points as an independent integrator flies them: `Point.simulate` for all of them at once, as a front.

        Parameters
        ----------
        problem : Problem or CompiledProblem, optional
            Fly them under other data, such as another mass: a problem with the same phases, variables and objectives. Each flight begins
            where it began here, and its controls are as functions of time what they were. Default: the front's own.
        tolerance : float
            How much a flight may violate, in the constraints' scales, and still count as converged; times, initial states, parameters and
            controls at the nodes included, which may be outside the bounds of another problem.
        rtol, atol, method
            Of the integrator; see `Point.simulate`.

        Returns
        -------
        Front
            In the same order, with `objectives`, `violation`, `status` and trajectories as simulated.
            `Front.merge([front.simulate()])` are those that are feasible when simulated, without what is dominated.

        Raises
        ------
        ValueError
            For a black box, a problem that cannot be found, and one of which the points cannot be.
        """
        from .fronts.simulated import simulated

        return simulated(self, problem, tolerance, rtol, atol, method)

    def table(self, defects: Sequence[float] | None = None, columns: Mapping[str, Sequence[Any]] | None = None) -> str:
        """The front as plain text: a headline, a row for each point, and what there is to beware of.

        Parameters
        ----------
        defects : n floats, optional
            Largest defect of each point's simulation, for a column of its own.
        columns : mapping, optional
            More columns: header -> n values.
        """
        from .fronts.tables import front_table

        return front_table(self, defects, columns)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the objectives: two as a scatter, three with the third as colour, more as parallel coordinates. Returns the Axes."""
        from .fronts.front_plot import draw_front

        return draw_front(self, ax)

    def to_xarray(self, phase: str | None = None) -> xarray.Dataset:
        """The front as a labelled Dataset, or that of one phase's trajectories: what `save` writes in the root or the phase's group."""
        from .fronts.dataset import phase_dataset, root_dataset

        return (root_dataset(self) if phase is None else phase_dataset(self, phase)).to_xarray()

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write objectives, violation, status and decisions, one row a point, under a header that names units."""
        from .fronts.files import save_csv

        save_csv(self, path)

    def save(self, path: str | PathLike[str]) -> None:
        """Write everything to one netCDF-4 file, whole or not at all.

        Raises
        ------
        OSError
            If the folder is missing or cannot be written to, or the disk is full; a file that was there before is still there.
        """
        from .fronts.files import save

        save(self, path)

    @staticmethod
    def load(path: str | PathLike[str], problem: Any = None) -> Front:
        """Read a front that `save` wrote. No code is run: the problem that it names is loaded when a point is first simulated.

        Parameters
        ----------
        path : path
        problem : Problem or CompiledProblem, optional
            The problem the front is of; needed to simulate the points of one that was stated in a script.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ValueError
            If it is not a front, is damaged, of another version of the format, or of another problem.
        """
        from .fronts.files import load

        return load(path, problem)

    @staticmethod
    def merge(fronts: Sequence[Front]) -> Front:
        """The non-dominated feasible points of several fronts of one problem; what they cost is summed.

        Points of different meshes are taken at their word: a coarse mesh may promise more than can be flown, and so push out better points.

        Raises
        ------
        ValueError
            If there is none, or they differ in problem or objectives, or black boxes in variables.
        """
        from .fronts.merging import merge

        return merge(fronts)
