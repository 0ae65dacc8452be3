"""A front: points of a problem, each of them a trajectory, with all that can be done with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, Self

from problems.compiled import CompiledProblem
from problems.problem import Problem
from transcription.base import Transcription

from .fronts import files
from .fronts.merging import merge
from .fronts.points import Points
from .fronts.simulated import simulated
from .fronts.tables import front_table, headline
from .gradients.front_polish import polished
from .gradients.mesh_refinement import refine_mesh

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


class Front(Points):
    """A set of points of one problem: the columns of `Points`, and what can be done with them."""

    @classmethod
    def of(cls, points: Points) -> Self:
        """The same columns, as a front."""
        front = cls.__new__(cls)
        front.__dict__.update(points.__dict__)
        return front

    def __repr__(self) -> str:
        return f"<Front: {headline(self)}>"

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
        return Front.of(refine_mesh(self, tolerance, limit, time_limit, progress))

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
        return Front.of(polished(self, transcription, solves, limit, verify, time_limit, progress))

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
        return Front.of(simulated(self, problem, tolerance, rtol, atol, method))

    def table(self, defects: Sequence[float] | None = None, columns: Mapping[str, Sequence[Any]] | None = None) -> str:
        """The front as plain text: a headline, a row for each point, and what there is to beware of.

        Parameters
        ----------
        defects : n floats, optional
            Largest defect of each point's simulation, for a column of its own.
        columns : mapping, optional
            More columns: header -> n values.
        """
        return front_table(self, defects, columns)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the objectives: two as a scatter, three with the third as colour, more as parallel coordinates. Returns the Axes."""
        from .fronts.front_plot import draw_front

        return draw_front(self, ax)

    def to_xarray(self, phase: str | None = None) -> xarray.Dataset:
        """The front as a labelled Dataset, or that of one phase's trajectories: what `save` writes in the root or the phase's group.

        Each variable has its `long_name` and `units`. In a phase, each state, control and path constraint is a variable `(point, node)` of
        its own name; a name that netCDF does not allow, or that the file needs itself, is changed, and remains as the `long_name`.

        Raises
        ------
        KeyError
            If there is no such phase.
        """
        from .fronts.dataset import phase_dataset, root_dataset

        return (root_dataset(self) if phase is None else phase_dataset(self, phase)).to_xarray()

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write objectives, violation, status and decisions, one row a point, under a header that names units."""
        files.save_csv(self, path)

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
    def load(path: str | PathLike[str], problem: Problem | CompiledProblem | None = None, trust: bool = False) -> Front:
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
        """The non-dominated feasible points of several fronts of one problem; what they cost is summed.

        Points are compared by the objectives of their own meshes: those of a coarse mesh may be better than when simulated, and so dominate
        points that are better in fact.

        Raises
        ------
        ValueError
            If there is none, or they differ in problem or objectives, or black boxes in variables.
        """
        return Front.of(merge(fronts))
