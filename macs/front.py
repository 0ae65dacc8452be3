"""Front: points of one problem, with methods to simulate, polish, refine, show and store them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from problems.compiled import CompiledProblem
from problems.problem import Problem
from problems.vector import CompiledVectorProblem, VectorProblem
from transcription.base import Transcription

from .fronts import files
from .fronts.builders import merge
from .fronts.curve import FrontCurve, curve_of
from .fronts.point import Point
from .fronts.points import Points
from .fronts.spreadsheets import save_csv
from .fronts.tables import front_html, front_table, headline
from .fronts.verified import VERIFY, fixed_scales, simulated, unmarked, verified
from .gradients.front_polish import polished
from .io.text import counted
from .io.workers import Workers, processes
from .pareto.dominance import normalised
from .refinement.front_refinement import refine_mesh
from .refinement.mending import mended
from .refinement.places import dense_curve, dense_front, nearest_point, point_at

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Front(Points):
    """Points of one problem, usually its Pareto front as found by a solver; sorted by the first objective.

    `front[3]` is a `Point`, `front[:5]` or `front[mask]` a smaller front; `len(front)` and iteration work as for a list. The data are
    columns with one entry for each point: `objectives` (in the user's units and senses), `F` (all minimised), `violation`, `status`,
    `trajectories` and more, see `Points`. `stats` has the costs and the seed. If no feasible point was found, the front is empty: `message`
    says why, and `closest` is the least infeasible point.

    - See: `table()`, `plot()`, `plot_trajectories()`, `plot_variables()`, `front[i].plot()`
    - Verify: `verified`, `verify()`, `simulate()`, `front[i].simulate()`
    - Between the points: `curve()`, `knee()`; solved: `at()`, `nearest()`, `dense()`
    - Improve: `mended()`, `polished()`, `refine_mesh()`
    - Combine and store: `Front.merge`, `save()`, `Front.load`, `to_csv()`, `to_xarray()`

    Attributes
    ----------
    objectives, F : array (n, m)
        In the user's units and senses; all minimised.
    violation, defect : array (n,)
        Largest scaled residual; largest difference of a simulated state.
    status : array (n,) of str
    verified : array (n,) of bool
    stats : dict
        Costs, seed, and why it ended.
    message : str
    closest : Point or None

    Examples
    --------
    >>> from macs import Front, sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> len(front), front.names
    (3, ('flight time', 'horizontal speed'))
    >>> front.save("front.nc")
    >>> print(Front.load("front.nc")[1].verified)
    True
    """

    @classmethod
    def of(cls, points: Points) -> Self:
        """A front with the same columns."""
        front = cls.__new__(cls)
        front.__dict__.update(points.__dict__)
        return front

    def __repr__(self) -> str:
        return f"<Front: {headline(self)}>"

    def _repr_html_(self) -> str:
        """For notebooks: the table and a small picture."""
        from .fronts.pictures.front_plot import front_figure
        from .fronts.pictures.style import rendered

        return front_html(self, rendered(front_figure(self), "png", 80))

    def at(self, goals: Mapping[str, float] | None = None, *, weights: Mapping[str, float] | None = None) -> Point:
        """Any point of the front, solved from the points around its place in a few iterations, certified and simulated as these are.

        A solve begins with controls, states and multipliers between those of its neighbours, on the mesh of the nearest one. If its result
        is worse than what these promise, as between two valleys, each of them is a start, too. What a simulation does not confirm is solved
        again, as by `refine`.

        Parameters
        ----------
        goals : dict
            Name -> value, for some of the objectives: the other one is best there, several others together in proportion to their ranges. A
            goal is a limit. Where the front has no such value, as in a gap or beyond an end, the `note` of the point says so: it has a
            better one, or the nearest.
        weights : dict
            In place of goals: the least sum of the objectives, each minimised, in ranges of the front, times these weights. Where the front
            is not convex, it is a local one near the best of the front's points.

        Raises
        ------
        ValueError
            For a black box or a vector problem, which have no dynamics to solve; a problem that is not known, see `Front.load`; fewer than
            two points; unknown names; goals for all objectives, see `nearest`; and peaks without derivatives.

        Examples
        --------
        >>> import macs, problems
        >>> front = macs.sweep(problems.load("goddard"), points=5, starts=1)
        >>> point = front.at({"flight time": 180.0})
        >>> print(round(point.objectives["flight time"], 3), point.verified)
        180.0 True
        """
        return point_at(self, goals, weights)[0]

    def nearest(self, reference: Mapping[str, float]) -> Point:
        """The point of the front nearest to a reference, solved as by `at`: where the line from it, along the ranges of the front, meets
        the front (Pascoletti and Serafini 1984). Its `note` says how far the reference lies off the front.

        Parameters
        ----------
        reference : dict
            Name -> value, for each objective, on either side of the front: `front.nearest({"flight time": 150, "horizontal speed": 0.4})`.

        Raises
        ------
        ValueError
            As for `at`; also for an objective without a value.
        """
        return nearest_point(self, reference)[0]

    def dense(
        self,
        n: int | None = None,
        *,
        error: float | None = None,
        time_limit: float | None = None,
        workers: Workers | None = None,
        progress: bool | None = None,
    ) -> Front:
        """A front of n points, solved from their neighbours as by `at`: of two objectives in even steps along the line between the ends, of
        more on a lattice on the simplex between these, and at most n. `message` says how many places have no point of their own, as in a
        gap.

        Parameters
        ----------
        n : int, optional
            The ends of this front included.
        error : float, optional
            Instead of n, with two objectives: these points, and as many between them as it takes until the error of their `curve` is less.
        time_limit, workers, progress
            As for `optimize`.

        Raises
        ------
        ValueError
            As for `at`; also for fewer points than objectives, both or neither of n and error, and where there is no `curve`.

        Examples
        --------
        >>> import macs, problems
        >>> dense = macs.sweep(problems.load("goddard"), points=3, starts=1).dense(9)
        >>> len(dense), bool(dense.verified.all())
        (9, True)
        """
        if (n is None) == (error is None):
            raise ValueError("dense takes either a number of points or error=, what the curve may err by")
        call = time_limit, progress, workers
        return Front.of(dense_front(self, n or 0, *call) if error is None else dense_curve(self, error, *call))

    def refine(
        self,
        until: float | Transcription | None = None,
        *,
        limit: int | None = None,
        more: bool = True,
        solves: int | None = None,
        verify: float | None = None,
        time_limit: float | None = None,
        workers: Workers | None = None,
        progress: bool | None = None,
    ) -> Front:
        """The front with points solved again by gradients, from their trajectories, on other meshes.

        By default, those that a simulation did not confirm; if the front was not simulated, it is now. Each is solved where it misses: on
        finer meshes of its own; by a method that has none, inside of the limits that it exceeds. This takes at most four tenths of what the
        front cost, in iterations times variables, or a little where that was little. What then misses only in its objectives, such as an
        integral over a kink, gets those of its simulation. The others stay as they are. Points that are verified
        are compared by their simulated objectives; what is still not verified stays only if no verified point is as good.

        With a tolerance, each point is solved on a mesh of its own, refined until an independent simulation confirms it: errors are
        estimated by integration over each element, by states, controls and path constraints between the nodes, by the simulated
        objectives, and by their change from mesh to mesh. Elements are split where the solution is not smooth; elsewhere states and
        controls get a higher order; elements that are not needed become one. Where controls switch, elements end, and these ends move.
        Controls that leave their bounds between nodes are written in the Bernstein basis, whose coefficients bound them. A point is solved
        from its old objectives along the front's ranges (Pascoletti and Serafini 1984), so that it keeps its place along the front; an end
        of the front is solved as such, and where ends move far, the points between them keep their places between these. Intervals of
        multiple shooting keep their order: they are short where the trajectory bends, and become more where errors ask for it.

        With a transcription, the front is moved to the Pareto front on that. A search needs candidates that are evaluated quickly, as in
        single shooting; gradient solves need a sparse problem, such as that of DFET. First the best point of each objective is solved, then
        points along the front; see `MACS`. Points that no solve improved stay on their own transcription. For an empty front, the solve
        starts from `closest`.

        Parameters
        ----------
        until : float or Transcription, optional
            A tolerance: the largest defect of a state, relative to its range on the trajectory. In ranges of the front, the objectives
            may change by ten times this from mesh to mesh, and when simulated. Controls may not leave their bounds at all; states and path
            constraints by the front's tolerance. Where dynamics are so unstable that no simulation can follow, each element is simulated by
            itself, and `Point.note` says so. Or a transcription. Default: until points are verified.
        limit : int, optional
            With a tolerance, the largest number of meshes for each point, 12 by default; with a transcription, the largest number of points
            of the result, well spread, by default as many as there are.
        more : bool
            With a tolerance, whether there may be more elements, and of higher order. If not, there are as many as before: they move to
            where the trajectory bends, by a density function. Made for methods with many elements of low order, such as shooting.
        solves : int, optional
            With a transcription, the largest number of gradient solves. Default: the number of points, at least 1.
        verify : float, optional
            With a transcription, the largest violation, in the constraints' scales, of a point when simulated. A point with more is solved
            again, at most three times, with its limits tightened by the excess; these solves are additional, and `Point.note` reports
            them. Points that are still infeasible when simulated are left out, also those of the front itself, and the others are marked as
            `verify` does. Default: no point is left out; points are marked if those of the front were.
        time_limit : float, optional
            Seconds after which the work ends with the results so far. Checked, like Ctrl-C, before each solve.
        workers : int, "all" or Executor, optional
            Processes that work side by side, see `optimize`.
        progress : bool, optional
            Show the progress on stderr. Default: on a terminal and in a notebook, from the third second on.

        Returns
        -------
        Front
            Costs are added to those of the front. With a tolerance, the same number of points; `Point.note` says why one does not meet it,
            or that it is worse than what its simulation on an earlier mesh achieved, and `message` how many do. With a transcription,
            feasible, mutually non-dominated points; new ones have their `optimality`, except those solved with tightened limits.

        Raises
        ------
        ValueError
            For a black box, a problem that cannot be found, a transcription whose mesh cannot be refined, peaks without derivatives, and
            invalid arguments.
        """
        with processes(workers):
            if until is None:
                marked = self if self.was_simulated.any() else self.verify()
                return Front.of(mended(marked, marked.stats["verify"], time_limit, progress))
            if isinstance(until, int | float):
                refined = refine_mesh(unmarked(self), until, 12 if limit is None else limit, time_limit, progress, more)
                return Front.of(refined).verify(self.stats.get("verify"))
            found = Front.of(polished(self, until, solves, limit, verify, time_limit, progress))
            return Front.of(verified(found, self.stats.get("verify") if verify is None else verify, fixed_scales(self)))

    def refine_mesh(self, *, tolerance: float = 1e-7, limit: int = 12, more: bool = True, **limits: Any) -> Front:
        """Each point on a mesh of its own: `refine` until a tolerance."""
        return self.refine(tolerance, limit=limit, more=more, **limits)

    def polished(self, transcription: Transcription, **limits: Any) -> Front:
        """The front moved to the Pareto front on another transcription: `refine` on that."""
        return self.refine(transcription, **limits)

    def mended(self, **limits: Any) -> Front:
        """The points that a simulation did not confirm, solved again: `refine`."""
        return self.refine(**limits)

    def verify(self, tolerance: float | None = VERIFY, *, workers: Workers | None = None) -> Front:
        """The same points, simulated by an independent integrator, and marked by whether they are as they say.

        Points of a vector problem are evaluated again. Every solver and gradient tool does so at its end. A point is `verified` if nothing
        differs by more than the tolerance: its states, in spans of their bounds; its bounds, final values, paths and constraints, controls
        between nodes included, in their scales (the scale of an equality or a limit on one side is at least its size); and its objectives,
        in units that are fixed at a point's first verification (`Point.tolerances`), so that parts and unions of fronts are judged
        alike. The unit is the objective's `scale`; without one, its range over the points that are best in one objective, as simulated
        and feasible; for a single objective, its size or the sum of the sizes of its terms, whichever is larger.

        Parameters
        ----------
        tolerance : float or None
            Largest error of a verified point, in the units above. None: the points are not simulated.
        workers : int, "all" or Executor, optional
            Processes that simulate side by side, see `optimize`.

        Returns
        -------
        Front
            With the columns `defect`, `simulated_violation`, `simulated_F`, `tolerances` and `verified`, and a `note` where something is
            missed.

        Raises
        ------
        ValueError
            For a tolerance that is not positive, and a problem that cannot be found.
        """
        with processes(workers):
            return verified(self, tolerance)

    def simulate(
        self,
        problem: Problem | CompiledProblem | VectorProblem | CompiledVectorProblem | None = None,
        *,
        tolerance: float = 1e-2,
        rtol: float = 1e-6,
        atol: float = 1e-7,
        method: str = "DOP853",
    ) -> Front:
        """The same points as simulated by an independent integrator: `Point.simulate` for all points at once. Those of a vector problem are
        evaluated again.

        Parameters
        ----------
        problem : Problem or CompiledProblem, optional
            Problem with other data, such as another mass, but the same phases, variables and objectives. Initial states, and controls as
            functions of time, are those of the front. Default: the problem of the front.
        tolerance : float
            Largest violation, in the constraints' scales, of a simulated point whose status is "converged". The bounds of times, initial
            states, parameters and controls at the nodes are checked too, since another problem may have other bounds.
        rtol, atol, method
            Settings of the integrator; see `Point.simulate`.

        Returns
        -------
        Front
            The points in the same order, with `objectives`, `violation`, `status` and trajectories as simulated.
            `Front.merge([front.simulate()])` has those that are feasible when simulated and non-dominated.

        Raises
        ------
        ValueError
            For a black box, a problem that cannot be found, and a problem with other phases, variables or objectives.
        """
        return Front.of(simulated(self, problem, tolerance, rtol, atol, method))

    def curve(self) -> FrontCurve:
        """The front of two objectives as a curve through its points, with their slopes: `front.curve()(175.0)` has both objectives where
        the first one is 175. Its `error` is estimated, its `pieces` end at kinks and gaps, and `rates` are its slopes.

        Points that are not feasible, not verified (if the front was simulated), dominated, or without `weights` are left out, as the
        curve's `message` says. Without any weights, as of a vector problem or a search without gradients, there is no curve: such points
        may lie above the front, by an unknown amount. A front from a file has the same curve.

        Returns
        -------
        FrontCurve

        Raises
        ------
        ValueError
            With more or fewer than two objectives, and with fewer than two points on the front that have weights.

        Examples
        --------
        >>> import macs, problems
        >>> front = macs.sweep(problems.load("goddard"), points=7, starts=1)
        >>> time, speed = front.curve()(175.0)
        >>> round(float(speed), 2)
        0.6
        """
        return curve_of(self)

    def knee(self) -> Point:
        """The knee of a front of two objectives: the point farthest below the line between its ends, in ranges of the objectives (Das 1999,
        see `FrontCurve.knee`), so that on either side little more of one costs much of the other. Units do not matter. Raises ValueError
        with more or fewer than two objectives, and without points.

        Examples
        --------
        >>> import macs, problems
        >>> macs.sweep(problems.load("goddard"), points=7, starts=1).knee().index
        2
        """
        if len(self.goals) != 2 or not len(self):
            raise ValueError(f"the knee is a point between two ends, and this front has {headline(self)}")
        return self[int(np.nanargmin(normalised(self.F, np.nanmin(self.F, axis=0), np.nanmax(self.F, axis=0)).sum(axis=1)))]

    def table(self, columns: Mapping[str, Sequence[Any]] | None = None, *, details: bool = False) -> str:
        """The front as plain text: a headline, a row for each point, those that are not verified apart, and warnings.

        Objectives have the digits within which points were judged to be verified (`Point.tolerances`), and at least four of their range.

        Parameters
        ----------
        columns : mapping, optional
            Further columns: header -> n values.
        details : bool
            With violation, defect, differences of a simulation, optimality and numbers of elements. They are there in any case where a
            point did not converge or is not verified.
        """
        return front_table(self, columns, details)

    def plot(self, ax: Axes | None = None, *, marked: Sequence[int] = (), beside: Mapping[str, Any] | None = None) -> Axes:
        """Axes with the objectives: two as points on their `curve`, three with the third as colour, more as parallel coordinates.

        `front.plot().figure.savefig("front.png")` writes the picture to a file.

        Parameters
        ----------
        ax : Axes, optional
            Default: those of a new figure.
        marked : numbers of points
            Points to mark, in the colours of `plot_trajectories`. Default: of two objectives, the best of each.
        beside : mapping, optional
            Name -> two objectives (k, 2) of other points, such as a known front; drawn in black and grey.
        """
        from .fronts.pictures.front_plot import draw_front

        return draw_front(self, ax, marked, beside)

    def plot_trajectories(self, points: Sequence[int], figure: Figure | None = None) -> np.ndarray:
        """Axes with the states, controls and path constraints of a few points over time, a colour for each point.

        Parameters
        ----------
        points : numbers of points
            From one to seven.
        figure : matplotlib Figure, optional
            Empty figure to draw into. Default: a new one.

        Raises
        ------
        ValueError
            If there are none or too many, or one has no trajectory.
        """
        from .fronts.pictures.flight_plot import draw_flights

        return draw_flights([self[i] for i in points], figure)

    def plot_variables(self, figure: Figure | None = None) -> np.ndarray:
        """Axes with each variable of a black box or vector problem along the front, over the first objective, within its bounds.

        Raises
        ------
        ValueError
            For trajectories: `front[i].plot()` draws one of them.
        """
        from .fronts.pictures.front_plot import draw_designs

        if self.dynamic:
            raise ValueError("these points are trajectories: draw one of them, front[i].plot()")
        title = f"{self.source.name if self.source else 'black box'}: {counted(len(self), 'point')}"
        return draw_designs(self, title, figure)

    def to_xarray(self, phase: str | None = None) -> xarray.Dataset:
        """The front as a labelled Dataset, or that of one phase's trajectories: what `save` writes in the root or the phase's group.

        Each variable has its `long_name` and `units`. In a phase, each state, control and path constraint is a variable `(point, node)` of
        its own name; a name that netCDF does not allow, or that the file needs itself, is changed, and remains as the `long_name`.
        `curve_objectives` are places along the `curve`, if there is one.

        Raises
        ------
        KeyError
            If there is no such phase.
        """
        from .fronts.dataset import phase_dataset, root_dataset

        return (root_dataset(self) if phase is None else phase_dataset(self, phase)).to_xarray()

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write a table for a spreadsheet, a row for each point, under a header that names units.

        Its columns are the number of the point, objectives, whether it is verified, status, parameters, the times at which phases begin
        and end (of points without trajectories all their variables), violation and what a simulation found. `front[i].to_csv()` writes a
        trajectory.
        """
        save_csv(self, path)

    def save(self, path: str | PathLike[str]) -> None:
        """Write everything to one netCDF-4 file with a checksum, whole or not at all.

        A symbolic link stays, and the file that it leads to is replaced; a file that is replaced keeps its permissions.

        Raises
        ------
        OSError
            If the folder is missing or cannot be written to, or the disk is full; a file that was there before is still there.
        ValueError
            If the front has more than 1 GiB.
        """
        files.save(self, path)

    @staticmethod
    def load(
        path: str | PathLike[str],
        problem: Problem | CompiledProblem | VectorProblem | CompiledVectorProblem | None = None,
        trust: bool = False,
    ) -> Front:
        """Read a front that `save` wrote. No code is run: the problem is loaded when a point is first simulated.

        Parameters
        ----------
        path : path
        problem : Problem or CompiledProblem, optional
            The problem of the front; needed to simulate the points of one that was stated in a script.
        trust : bool
            Whether the code at the address of the problem may be run, to simulate points. A problem of the catalogue needs no trust.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ValueError
            If it is not a front, is damaged, of a later version of the format, or of another problem.

        Warns
        -----
        UserWarning
            If an earlier MACS wrote it, without a checksum.
        """
        return Front.of(files.load(path, problem, trust))

    @staticmethod
    def merge(fronts: Sequence[Front]) -> Front:
        """The non-dominated feasible points of several fronts of one problem; costs are summed.

        Verified points are compared by their simulated objectives, and none is removed by a point that is not verified. Points that are
        not verified are compared by the objectives on their own meshes, which on a coarse mesh may be too good; `verify` first.

        Raises
        ------
        ValueError
            If there are no fronts, or they differ in problem or objectives or, for black boxes, in variables.
        """
        return Front.of(merge(fronts))
