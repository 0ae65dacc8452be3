"""Mesh refinement of a front: its points on meshes of their own, fine enough for simulations to confirm them, or all on one finer mesh.

The ends of the front are solved first, each for the least value of its own objective, then the points between them, from the nearest on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from problems.checks import check_count, check_positive
from transcription import from_dict
from transcription.meshed import Meshed
from transcription.meshes.minimum import OptimumMultipliers
from transcription.meshes.verdict import Wanted
from transcription.nlp.optimality import Conditions, optimality
from transcription.stopping import Stopped, stopping
from transcription.trajectories.trajectory import Trajectory

from ..evaluation.evaluator import CONVERGED
from ..fronts.builders import certified, trajectory_columns
from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.provenance import more_costs
from ..fronts.verified import fixed_scales
from ..gradients.ends import moved_along
from ..gradients.scalarised import MOST_ITERATIONS, GradientSolves, LexicographicEnd, Scalarised
from ..io.console import working
from ..io.interrupts import spending
from ..io.text import counted
from ..io.workers import TOGETHER
from ..pareto.dominance import extremes
from .mesh_loop import MeshLoop, OnMesh, Programs, differentiable


@dataclass(frozen=True)
class FrontLimits:
    """Limits of the refinement of a front."""

    tolerance: float = 1e-10  # smallest that double precision and the integrator can resolve
    optimal: float = 1e-6  # a point with at most this optimality is not solved again on its first mesh
    # An optimal point whose best objective alone cannot fall faster than this, in units per span of the variables, or that moves by no more
    # than this, in units, to the optimum of that objective alone, is an end of the front.
    stationary: float = 1e-2
    nearby: float = 0.5  # of others: an end is no further away than so many times the distance to the nearest point
    hinted: float = 1e2  # a point with more times the error that it may have begins on the meshes of its nearest neighbour
    of_end: float = 6.0  # what an end may take of the work that is allowed, in equal shares of it
    of_one: float = 2.0  # the same for any other point
    neighbours: int = 2  # points whose trajectories are further starts of one


FRONT = FrontLimits()
NOT_BEGUN = "it was not solved on a finer mesh"
"""Note of a point that was still to be refined when the work was to end."""


@spending("meshes")
def refine_mesh(front: Points, tolerance: float, limit: int, time_limit: float | None, progress: bool | None, more: bool = True) -> Points:
    """The points on refined meshes; see `Front.refine_mesh`."""
    check_positive("tolerance", tolerance)
    if tolerance < FRONT.tolerance:
        raise ValueError(f"tolerance must be at least {FRONT.tolerance:g}, not {tolerance!r}")
    check_count("limit", limit, 1)
    if time_limit is not None:
        check_positive("time_limit", time_limit)
    front.compiled()
    if not len(front):
        return front
    wanted = Wanted(float(tolerance), feasible=front.stats["tolerance"])
    with working(time_limit, progress) as (show, interrupts):
        job = FrontRefinement(front, wanted, int(limit), more=more)
        job.go(show)
        elapsed, stopped = interrupts.elapsed, interrupts.reason
    return job.points(elapsed, stopped).sorted()


@dataclass(frozen=True, eq=False)
class RefinedPoint:
    """What the others and the front need of a refined point."""

    F: np.ndarray  # (m,)
    trajectory: Trajectory
    method: Meshed  # the best of its `meshes`
    meshes: list[Meshed]
    note: str
    good: bool
    gain: float  # of other controls, see `Verdict.gain`
    settled: bool  # whether it is good and gains no more than it may
    columns: dict[str, Any] | None  # as a set of one point, see `Points`; None where it is as it was


@dataclass(frozen=True, eq=False)
class PointToRefine:
    """A point on its first mesh, and where it goes from there."""

    method: Meshed
    z: np.ndarray  # (n,)
    F: np.ndarray  # (m,)
    trajectory: Trajectory
    optimal: bool  # whether it is known to be, on this mesh
    gaining: bool  # whether other controls are known to gain more than they may
    others: Sequence[Trajectory]  # of its neighbours: further starts
    hints: Sequence[Meshed]  # to begin on
    far: Sequence[Meshed]  # the same if its error is large

    def __call__(self, loop: MeshLoop, task: Scalarised, tolerance: float) -> RefinedPoint:
        """The point of a task on finer meshes; within a tolerance it is feasible."""
        nlp, z = loop.programs(self.method), self.z
        # What gains already is to be seen where it begins.
        conditions = Conditions.of(nlp, z, task.units) if self.gaining else None
        multipliers = None if conditions is None else conditions.multipliers()
        optimum = None if multipliers is None else OptimumMultipliers.of(nlp, z, multipliers)
        begun = loop.on_mesh(self.method, z, self.F, self.trajectory, task.units, self.optimal, optimum)
        hints = self.far if begun.verdict.error > FRONT.hinted else self.hints
        # Rough controls would need finer meshes than optimal ones.
        own = [] if self.optimal or hints else [self.method]
        found = loop.refine(begun, task, self.others, list(dict.fromkeys([*hints, *own])))
        best, columns = found.best, None
        if not np.array_equal(best.z, z):
            nlp = loop.programs(best.method)
            certificate = certified(nlp, best.z[None], task.units) if best.by_gradients else {}
            columns = trajectory_columns(nlp, best.z[None], tolerance) | certificate | {"trajectories": [best.trajectory]}
        gain, good = best.verdict.gain, not found.complaints()
        settled = good and gain <= loop.wanted.gained
        return RefinedPoint(best.F, best.trajectory, best.method, found.meshes, found.note, good, gain, settled, columns)


def _refined(loop: MeshLoop, begun: PointToRefine, task: Scalarised, tolerance: float) -> RefinedPoint:
    """One piece of `FrontRefinement`."""
    return begun(loop, task, tolerance)


class FrontRefinement:
    """Refinement of the meshes of a front's points: first of its ends, then of the points between them, from the nearest on; all `first` on
    one mesh, if it is given."""

    def __init__(
        self,
        front: Points,
        wanted: Wanted,
        limit: int,
        chosen: Sequence[int] | None = None,
        most_work: float = np.inf,
        programs: Programs | None = None,
        enough: Callable[[OnMesh], bool] | None = None,
        max_iterations: int = MOST_ITERATIONS,
        more: bool = True,
        first: Meshed | None = None,
    ) -> None:
        self.front, self.wanted = front, wanted
        # Beside verified points, one that a simulation refutes is no end.
        known = front.verified if front.verified[slice(None) if chosen is None else list(chosen)].all() else True
        self.good = np.flatnonzero((front.status == CONVERGED) & known)
        self.chosen = [i for i in self.good.tolist() if chosen is None or i in set(chosen)]
        self.solves = GradientSolves(min(0.1 * wanted.tolerance, float(front.stats["tolerance"])), max_iterations)
        self.loop = MeshLoop(programs or Programs(front.compiled()), self.solves, wanted, limit, most_work, enough=enough, more=more)
        self.methods = {i: self._method(front[i]) for i in self.chosen}
        self.rows, self._first = [front[[i]] for i in range(len(front))], first
        self.found: dict[int, RefinedPoint] = {}

    def go(self, show: Any = lambda words: None) -> None:
        """Refine all chosen points, or as many as the limits allow."""
        # Asked to end in the middle of a point, it stays as it was.
        with suppress(Stopped):
            self._go(show)

    def _go(self, show: Any) -> None:
        if not self.chosen:
            return
        first = self.chosen[0]
        nlp = self.loop.programs(self.methods[first])
        fixed, found = fixed_scales(self.front), self.loop.units(self.front.F[self.good], nlp, self.rows[first][0].decision)
        self.units = np.where(np.isnan(fixed), found, fixed)
        ends = self._ends()
        between = [i for i in self.chosen if i not in ends]
        for i, task in ends.items():
            self._refine({i: task}, show)  # each begins on the mesh of the one before
        F, m = self.front.F, len(self.units)
        known = [i for i in ends if i in self.found] if len(ends) == m else []
        moved = np.array([self.found[i].F for i in known]).reshape(-1, m)
        # The points between move along with the ends.
        references, weights = moved_along(F[between], F[known], moved, self.units)
        tasks = {i: Scalarised(one, weights, units=self.units) for i, one in zip(between, references, strict=True)}
        left = dict(tasks)
        while left and not self.loop.ended:
            # First those that gain most, then from the nearest on; the next ones begin on the meshes of these.
            row = sorted(left, key=lambda j: (-self._gaining(j), min((self._distance(j, k) for k in self.found), default=0.0)))
            self._refine({i: left.pop(i) for i in row[: TOGETHER // 2]}, show)
        # Some began before their neighbours were done.
        poor = {i: task for i, task in tasks.items() if i in self.found and not self.found[i].settled}
        self._refine({i: task for i, task in poor.items() if self._hints(i, task)}, show)

    def points(self, elapsed: float, stopped: str) -> Points:
        """The front with the refined points, in the same order, and their costs."""
        front, reached = self.front, sum(point.good for point in self.found.values())
        left = {i: self.rows[i].replace(notes=[NOT_BEGUN]) for i in self.chosen if i not in self.found}
        return Points.concatenate([left.get(i, row) for i, row in enumerate(self.rows)]).replace(
            tolerances=front.tolerances,
            within=front.within,
            solver=dict(front.solver),
            stats=more_costs(front.stats, self.solves.counts, elapsed, stopped) | {"mesh_tolerance": self.wanted.tolerance},
            message=f"{reached} of {len(front)} points meet the mesh tolerance of {self.wanted.tolerance:.0e}.",
        )

    def _method(self, point: Point) -> Meshed:
        method = None if point.transcription is None else from_dict(point.transcription)
        if not isinstance(method, Meshed) or point.trajectory is None:
            raise ValueError(
                f"only meshes of DFET and other methods on elements can be refined; point {point.index} is of {type(method).__name__}"
            )
        return method

    def _ends(self) -> dict[int, LexicographicEnd]:
        """The points that are ends of the whole front, not only of this part of it, by solves on their own meshes."""
        ends: dict[int, LexicographicEnd] = {}
        if not differentiable(self.loop.problem):
            return ends
        for objective, row in enumerate(extremes(self.front.F[self.good])):
            i = int(self.good[row])
            if i not in self.methods or i in ends or stopping():
                continue
            if len(self.units) == 1 or self._is_end(i, np.arange(len(self.units)) == objective):
                ends[i] = LexicographicEnd.of(objective, self.units, self.front.F[i])
        return ends

    def _is_end(self, i: int, mine: np.ndarray) -> bool:
        """Whether the best point in the objective that is marked (m,) is an optimum of that alone. Another local optimum may be better."""
        nlp, point = self.loop.programs(self.methods[i]), self.rows[i][0]
        known = self._known(i)
        if known and optimality(nlp, point.decision, np.where(mine, self.units, np.inf)) <= FRONT.stationary:
            return True
        solved = self.solves(nlp, point.decision, Scalarised(np.where(mine, 0.0, np.inf), self.units))
        if solved.status != CONVERGED:
            return not known
        others = np.array([self._distance(i, j) for j in self.good.tolist() if j != i])
        nearby = FRONT.stationary if known else FRONT.nearby * others[others > 0].min(initial=0.0 if len(others) == 0 else np.inf)
        return float(np.linalg.norm((solved.F - point.F) / self.units)) <= nearby

    def _known(self, i: int) -> bool:
        """Whether a point is known to be optimal on its own mesh."""
        certified = self.rows[i][0].optimality
        return certified is not None and certified <= FRONT.optimal

    def _gaining(self, i: int) -> float:
        """What a point is known to gain where it begins, if that is more than it may."""
        gain = self.found[i].gain if i in self.found else float(self.front.gain[i])
        return gain if gain > self.wanted.gained else 0.0

    def _distance(self, i: int, j: int) -> float:
        return float(np.linalg.norm((self.front.F[i] - self.front.F[j]) / self.units))

    def _refine(self, tasks: Mapping[int, Scalarised], show: Any) -> None:
        """Refine some points side by side."""
        if not tasks or self.loop.ended:
            return
        done = len(self.found)
        show(f"meshes of the front: {counted(len(self.chosen), 'point')}, {done} done, {len(tasks)} in work")
        # One point that resists is not to take what is meant for the others.
        share = max(FRONT.of_end if isinstance(task, LexicographicEnd) else FRONT.of_one for task in tasks.values()) / len(self.chosen)
        pieces = [(self._begun(i, task), task, float(self.front.stats["tolerance"])) for i, task in tasks.items()]
        found = self.loop.each(_refined, pieces, share * self.loop.most_work)
        for i, one in zip(tasks, found, strict=True):
            old = self.found.get(i)
            if one is not None and (old is None or (one.good, -one.gain) > (old.good, -old.gain)):
                self.found[i], self.methods[i], self.rows[i] = one, one.method, self._row(i, one)

    def _row(self, i: int, one: RefinedPoint) -> Points:
        """The refined point as a set of one point."""
        front = self.front
        if one.columns is None:
            return self.rows[i].replace(notes=[one.note or front[i].note])
        about: dict[str, Any] = {"goals": front.goals, "problem": front.compiled(), "solver": front.solver, "stats": front.stats}
        return Points(**one.columns, notes=[one.note], **about)

    def _begun(self, i: int, task: Scalarised) -> PointToRefine:
        """A point as it is by now, with the meshes of the nearest one that is done."""
        point, trajectory = self.rows[i][0], self._trajectory(i)
        near = sorted((j for j in self.chosen if j != i), key=lambda j: self._distance(i, j))[: FRONT.neighbours]
        others, hints, done = [self._trajectory(j) for j in near], self._hints(i, task), self._nearest(i)
        far = hints if self._first or done is None else done.meshes[-2:]
        return PointToRefine(
            self.methods[i], point.decision, point.F, trajectory, self._known(i), self._gaining(i) > 0.0, others, hints, far
        )

    def _nearest(self, i: int) -> RefinedPoint | None:
        """The nearest other point that is settled, on another mesh than those that were tried."""
        tried = self.found[i].meshes if i in self.found else ()
        done = [j for j, one in self.found.items() if one.settled and j != i and one.method not in tried]
        return self.found[min(done, key=lambda j: self._distance(i, j))] if done else None

    def _hints(self, i: int, task: Scalarised) -> list[Meshed]:
        """The mesh of the nearest point, whose program is there already; none for an end, which is far from others, and where another mesh
        has to confirm a point anyway."""
        if self._first:
            return [] if i in self.found else [self._first]
        nearest = self._nearest(i)
        return [] if nearest is None or self.wanted.confirmed or isinstance(task, LexicographicEnd) else [nearest.method]

    def _trajectory(self, i: int) -> Trajectory:
        trajectory = self.rows[i][0].trajectory
        assert trajectory is not None
        return trajectory
