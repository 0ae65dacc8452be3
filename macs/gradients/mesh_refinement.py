"""Mesh refinement of a front: each point gets a mesh of its own, fine enough for an independent simulation to confirm it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from problems.checks import check_count, check_positive
from transcription import from_dict
from transcription.base import NLP, Meshed
from transcription.inner import Ipopt
from transcription.meshes.adaptation import COST, Verdict, judge, next_method
from transcription.nlp.optimality import optimality
from transcription.nlp.scalarized import Solved
from transcription.stopping import Stopped, stopping
from transcription.trajectories.trajectory import Trajectory

from ..evaluation.evaluator import CONVERGED, Counts
from ..fronts.builders import vectors_points
from ..fronts.points import Point, Points
from ..fronts.provenance import more_costs
from ..fronts.verification import missed, objective_scales
from ..io.console import working
from ..pareto.dominance import extremes
from .multistart import GradientSolves

OPTIMAL = 1e-6
"""A point with at most this optimality is not solved again on its first mesh."""


PATIENCE = 5
"""Number of meshes without progress after which the mesh of a point is not refined further."""


LEAST_TOLERANCE = 1e-10
"""Smallest tolerance that double precision and the integrator can resolve."""


def refine_mesh(front: Points, tolerance: float, limit: int, time_limit: float | None, progress: bool | None) -> Points:
    """The points on refined meshes; see `Front.refine_mesh`."""
    check_positive("tolerance", tolerance)
    if tolerance < LEAST_TOLERANCE:
        raise ValueError(f"tolerance must be at least {LEAST_TOLERANCE:g}, not {tolerance!r}")
    check_count("limit", limit, 1)
    if time_limit is not None:
        check_positive("time_limit", time_limit)
    front.compiled()
    return MeshRefinement(front, float(tolerance), int(limit)).go(time_limit, progress) if len(front) else front


@dataclass
class _Refined:
    """Point with its present mesh.

    Attributes
    ----------
    point : Point
        Point of the original front.
    end : int or None
        Objective in which the point is the best of the front; None for other points.
    method, trajectory, verdict
        Transcription with the present mesh, trajectory on it, and its verification by an independent simulation.
    solved : SolvedPoint or None
        Solution on the present mesh; None for the original one.
    change : float
        Largest change of an objective from the previous mesh, in ranges of the front.
    history : list of float
        Error on each mesh, relative to the tolerance.
    active : bool
        Whether the mesh is to be refined further.
    trouble : str
        Reason why the mesh is not refined further although the tolerance is not met.
    """

    point: Point
    end: int | None
    method: Meshed
    trajectory: Trajectory
    verdict: Verdict
    solved: SolvedPoint | None = None
    change: float = np.inf
    history: list[float] = field(default_factory=list)
    active: bool = True
    trouble: str = ""

    @property
    def F(self) -> np.ndarray:
        """Objectives (m,), all minimised."""
        return self.point.F if self.solved is None else self.solved.F


class MeshRefinement:
    """Refinement of the meshes of a front's points, in rounds; each round solves all unfinished points on finer meshes.

    Parameters
    ----------
    front : Points
    tolerance : float
        Largest defect, and largest excess of limits between nodes. Objectives may change by `COST` times that from mesh to mesh, in ranges
        of the front.
    rounds : int
        Largest number of meshes for each point.
    """

    def __init__(self, front: Points, tolerance: float, rounds: int) -> None:
        self.front, self.tolerance, self.rounds = front, tolerance, rounds
        self.problem = front.compiled()
        self.good = np.flatnonzero(front.status == CONVERGED)
        ranges = np.ptp(front.F[self.good], axis=0) if len(self.good) else np.zeros(len(front.goals))
        self.ranges = np.where(ranges > 0, ranges, objective_scales(front))
        self.solver = PointSolver(self.ranges, front.F[self.good], 0.1 * tolerance)
        self.points: dict[int, _Refined] = {}

    def go(self, time_limit: float | None, progress: bool | None) -> Points:
        """The refined points; after Ctrl-C or the time limit, on the meshes reached by then."""
        with working(time_limit, progress) as (show, interrupts):
            try:
                self._begin()
                self._polish()
                self._rounds(show)
            except Stopped:
                pass  # in the middle of a point: it stays on the mesh that it had
            reached = sum(not self._complaints(point) for point in self.points.values())
            found = Points.concatenate([self._refined(i) for i in range(len(self.front))]).sorted()
            elapsed, stopped = interrupts.elapsed, interrupts.reason
        return found.replace(
            solver=dict(self.front.solver),
            stats=more_costs(self.front.stats, self.solver.counts, elapsed, stopped) | {"mesh_tolerance": self.tolerance},
            message=f"{reached} of {len(self.front)} points meet the mesh tolerance of {self.tolerance:.0e}.",
        )

    def _rounds(self, show: Callable[[str], None]) -> None:
        """All rounds, until no point is active any more."""
        for k in range(self.rounds):
            active = sum(point.active for point in self.points.values())
            show(f"meshes of the front: round {k + 1} of at most {self.rounds}, {active} of {len(self.front)} points")
            if not active or stopping():
                return
            self._round()

    def _begin(self) -> None:
        """Judge all points on their present meshes."""
        for i in self.good.tolist():
            self.points[i] = self._begun(i)

    def _begun(self, i: int) -> _Refined:
        point, F = self.front[i], self.front.F
        method = None if point.transcription is None else from_dict(point.transcription)
        if not isinstance(method, Meshed) or point.trajectory is None:
            raise ValueError(f"only meshes of DFET and other methods on elements can be refined; point {i} is of {type(method).__name__}")
        best: Any = np.flatnonzero(self.good[extremes(F[self.good])] == i) if len(self.good) > 1 else []
        verdict = self._judge(point.trajectory)
        return _Refined(point, int(best[0]) if len(best) else None, method, point.trajectory, verdict)

    def _judge(self, trajectory: Trajectory) -> Verdict:
        return judge(self.problem, trajectory, self.tolerance, self.front.stats["tolerance"])

    def _polish(self) -> None:
        """Solve points that are not known to be optimal on their own meshes: rough controls would need finer meshes."""
        rough: dict[Meshed, list[int]] = {}
        for i, point in self.points.items():
            if point.point.optimality is None or point.point.optimality > OPTIMAL:
                rough.setdefault(point.method, []).append(i)
        for method, members in rough.items():
            nlp = method.transcribe(self.problem)
            for i in _until_stopped(members):
                solved = self.solver.solve(nlp, self.points[i].point.F, self.points[i].end, self._starts(i, nlp))
                if solved.status == CONVERGED and solved.by_gradients:
                    self._take(self.points[i], method, solved)

    def _round(self) -> None:
        """Solve and verify every active point on a finer mesh, grouped by meshes."""
        finer: dict[Meshed, list[int]] = {}
        for i, point in self.points.items():
            if point.active:
                settled = self._missed(point) <= COST * self.tolerance
                method = next_method(point.method, point.verdict, point.trajectory, integrals=not settled)
                point.active = method != point.method
                point.trouble = "" if point.active else "its mesh cannot be refined further"
                if point.active:
                    finer.setdefault(method, []).append(i)
        for method, members in finer.items():
            nlp = method.transcribe(self.problem)
            for i in _until_stopped(members):
                self._solve(i, method, nlp)

    def _solve(self, i: int, method: Meshed, nlp: NLP) -> None:
        point = self.points[i]
        solved = self.solver.solve(nlp, point.point.F, point.end, self._starts(i, nlp))
        if solved.status != CONVERGED:
            if not stopping():
                point.active, point.trouble = False, f"on the next finer mesh its status is '{solved.status}'"
            return
        change = float((np.abs(solved.F - point.F) / self.ranges).max())
        self._take(point, method, solved)
        point.change = change
        point.active = bool(self._complaints(point))
        point.history.append(max(point.verdict.error, change / (COST * self.tolerance)))
        earlier, latest = point.history[:-PATIENCE], point.history[-PATIENCE:]
        if point.active and earlier and min(latest) > 0.8 * min(earlier):
            point.active, point.trouble = False, "finer meshes do not help"

    def _take(self, point: _Refined, method: Meshed, solved: SolvedPoint) -> None:
        trajectory = solved.nlp.unpack(solved.z)
        verdict = self._judge(trajectory)  # this may be stopped
        point.method, point.solved, point.trajectory, point.verdict = method, solved, trajectory, verdict

    def _starts(self, i: int, nlp: NLP) -> Iterator[np.ndarray]:
        """Start vectors: the trajectory of point i, then those of the nearest points, all interpolated to the mesh of `nlp`."""
        here = self.points[i].point.F
        distance = {j: float(np.linalg.norm((other.point.F - here) / self.ranges)) for j, other in self.points.items()}
        for j in sorted(distance, key=lambda j: distance[j])[:3]:
            yield nlp.interpolate(self.points[j].trajectory)

    def _missed(self, point: _Refined) -> float:
        """Largest difference between the simulated objectives and those on the mesh, in ranges of the front."""
        objectives = dict(zip(self.front.names, (point.F * self.problem.signs).tolist(), strict=True))
        return missed(point.verdict.simulation, objectives, self.ranges)

    def _complaints(self, point: _Refined) -> list[str]:
        """Reasons why a point does not meet the tolerance; empty if it does."""
        found = point.verdict.complaints()
        off, settled = self._missed(point), COST * self.tolerance
        if not found and not off <= settled:
            found.append(f"when simulated, its objectives differ by {off:.1e} of the front's range")
        if np.isinf(point.change):
            found.append("it was not solved on a finer mesh")
        elif not point.change <= settled:
            found.append(f"its objectives still change by {point.change:.1e} of the front's range from mesh to mesh")
        return found

    def _refined(self, i: int) -> Points:
        """Point i on its present mesh, as a set of one point."""
        point, front = self.points.get(i), self.front
        if point is None:
            return front[[i]]
        complaints = self._complaints(point)
        if complaints:
            complaints.append(point.verdict.worst_place(point.method, point.trajectory))
        note = "; ".join([*complaints, *([point.trouble] if point.trouble else [])])
        solved = point.solved
        if solved is None:
            return front[[i]].replace(notes=[note or point.point.note])
        certified = optimality(solved.nlp, solved.z, self.ranges) if solved.by_gradients and not stopping() else None
        return vectors_points(solved.nlp, solved.z[None], front.solver, front.stats, optimality=[certified], notes=[note])


def _until_stopped(members: Iterable[int]) -> Iterator[int]:
    """The members in order, until the work is asked to end."""
    for i in members:
        if stopping():
            return
        yield i


DRIFT = 1e-3
"""If a point gets worse by more than this, in ranges of the front, other starts are tried too."""


CAP = 1e-9
"""Fraction of its range that the best objective of an end may lose while the others are improved."""


@dataclass(frozen=True, eq=False)
class SolvedPoint:
    """Solution of a point on another mesh.

    Attributes
    ----------
    nlp : NLP
    z : array (n,)
        Vector of `nlp`.
    F : array (m,)
        Objectives, all minimised.
    status : str
    by_gradients : bool
        True: a local optimum. False: only the nearest feasible point.
    """

    nlp: NLP
    z: np.ndarray
    F: np.ndarray
    status: str
    by_gradients: bool


class PointSolver:
    """Solver of a front's points on other meshes.

    Parameters
    ----------
    ranges : array (m,)
        Ranges of the objectives on the front.
    F : array (n, m)
        Objectives of the front, all minimised.
    tolerance : float
        Largest scaled residual of a feasible point.
    """

    def __init__(self, ranges: np.ndarray, F: np.ndarray, tolerance: float) -> None:
        self.ranges, self.F, self.tolerance = ranges, F, tolerance
        self._solve = GradientSolves(tolerance)

    @property
    def counts(self) -> Counts:
        """Costs of all solves."""
        return self._solve.counts

    def solve(self, nlp: NLP, position: np.ndarray, end: int | None, starts: Iterable[np.ndarray]) -> SolvedPoint:
        """The Pareto point on this mesh in the direction of the front's ranges from `position` (Pascoletti and Serafini 1984).

        The old objectives are no limits, since a finer mesh may make a point worse.

        Parameters
        ----------
        nlp : NLP
        position : array (m,)
            Objectives of the point on the first mesh.
        end : int or None
            For the best point of an objective: this objective is minimised, then the others.
        starts : iterable of vectors (n,)
            The first is the point itself; the next are used only if the solve fails or makes the point worse.

        Returns
        -------
        SolvedPoint
            The feasible point nearest to the first start, if objectives have no derivatives (a peak that is maximised) or all gradient
            solves fail.
        """
        found: list[Solved] = []
        first = None
        try:
            for start in starts:
                first = start if first is None else first
                found.append(self._scalarized(nlp, position, end, start))
                if found[-1].status == CONVERGED and self._worse(found[-1], position, end) <= DRIFT:
                    break
        except ValueError:
            pass  # a use of peaks without derivatives
        good = [solved for solved in found if solved.status == CONVERGED]
        if good:
            best = min(good, key=lambda solved: self._worse(solved, position, end))
            return SolvedPoint(nlp, best.z, best.F, best.status, True)
        assert first is not None
        near = Ipopt().solve(nlp, first[None, nlp.free], first[None], tolerance=self.tolerance)
        self.counts.inner_iterations += int(near.iterations.sum())
        self.counts.clocked += near.clocked
        return SolvedPoint(nlp, near.z[0], near.F[0], str(near.status[0]), False)

    def _worse(self, solved: Solved, position: np.ndarray, end: int | None) -> float:
        """Largest increase of an objective from `position`, in ranges; for an end, of its own objective."""
        change = (solved.F - position) / self.ranges
        return float(change.max() if end is None else change[end])

    def _scalarized(self, nlp: NLP, position: np.ndarray, end: int | None, start: np.ndarray) -> Solved:
        if end is not None:
            solved = self._lexicographic(nlp, position, end, start)
            others = np.linalg.norm((self.F - position) / self.ranges, axis=1)
            nearest = others[others > 0].min(initial=np.inf)
            # A point that moves by more than half the distance to the next one was not an end of the whole front.
            if solved.status != CONVERGED or np.linalg.norm((solved.F - position) / self.ranges) <= 0.5 * nearest:
                return solved
        return self._solve(nlp, start, position, self.ranges)

    def _lexicographic(self, nlp: NLP, position: np.ndarray, end: int, start: np.ndarray) -> Solved:
        """The least value of one objective, and for that the least values of the others."""
        mine = np.arange(len(position)) == end
        alone = np.where(mine, position, np.inf)
        first = self._solve(nlp, start, alone, self.ranges)
        if first.status != CONVERGED or len(position) == 1:
            return first
        ceiling = np.where(mine, first.F + CAP * self.ranges, np.inf)
        others = np.where(mine, np.inf, first.F)
        second = self._solve(nlp, first.z, others, self.ranges, ceiling)
        return second if second.status == CONVERGED else first
