"""The mesh around the front: each point on a mesh of its own, fine enough that what it promises can be flown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.checks import check_count, check_positive
from transcription import from_dict
from transcription.base import NLP, Meshed
from transcription.inner import Ipopt
from transcription.meshes.adaptation import COST, Verdict, judge, next_method
from transcription.nlp.optimality import optimality
from transcription.nlp.scalarized import Solved, scalarize
from transcription.stopping import stopped_by, stopping
from transcription.trajectories.trajectory import Trajectory

from ..evaluation.evaluator import CONVERGED
from ..fronts.builders import trajectory_columns
from ..fronts.verification import missed, objective_scales
from ..io.console import Told
from ..io.interrupts import Monitor
from ..pareto.dominance import extremes
from ..point import Point

if TYPE_CHECKING:
    from ..front import Front

OPTIMAL = 1e-6
"""A point whose optimality is at most this need not be solved anew on its own mesh."""


PATIENCE = 5
"""A point that gets no better on so many meshes is left alone."""


LEAST_TOLERANCE = 1e-10
"""Below, double precision and the integrator cannot tell."""


def refine_mesh(front: Front, tolerance: float, limit: int, time_limit: float | None, progress: bool) -> Front:
    """See `Front.refine_mesh`."""
    check_positive("tolerance", tolerance)
    if tolerance < LEAST_TOLERANCE:
        raise ValueError(f"tolerance must be at least {LEAST_TOLERANCE:g}, not {tolerance!r}")
    check_count("limit", limit, 1)
    if time_limit is not None:
        check_positive("time_limit", time_limit)
    front.compiled()
    return Refinement(front, float(tolerance), int(limit)).go(time_limit, progress) if len(front) else front


@dataclass
class _Refined:
    """A point on its way.

    Attributes
    ----------
    point : Point
        Of the front that is refined.
    end : int or None
        The objective of which it is the best point of the front.
    method, trajectory, verdict
        What it stands at: on which mesh, and what an independent look at it gave.
    solved : Resolved or None
        On that mesh; None at first.
    change : float
        Of the objectives, from the mesh before, in ranges of the front.
    history : list of float
        How far it was from good enough on each mesh: 1 is enough.
    active : bool
        There is something left to do, and to try.
    trouble : str
        Why there is nothing left to try.
    """

    point: Point
    end: int | None
    method: Meshed
    trajectory: Trajectory
    verdict: Verdict
    solved: Resolved | None = None
    change: float = np.inf
    history: list[float] = field(default_factory=list)
    active: bool = True
    trouble: str = ""

    @property
    def F(self) -> np.ndarray:
        """Objectives (m,), all minimised."""
        return self.point.F if self.solved is None else self.solved.F


class Refinement:
    """Refines the meshes of a front's points, all together, round after round.

    Parameters
    ----------
    front : Front
    tolerance : float
        Of defects and of what leaves its limits between nodes. Objectives are to settle within `COST` times that, in ranges of the front.
    rounds : int
        At most so many meshes are tried for each point.
    """

    def __init__(self, front: Front, tolerance: float, rounds: int) -> None:
        self.front, self.tolerance, self.rounds = front, tolerance, rounds
        self.problem = front.compiled()
        self.good = np.flatnonzero(front.status == CONVERGED)
        ranges = np.ptp(front.F[self.good], axis=0) if len(self.good) else np.zeros(len(front.goals))
        self.ranges = np.where(ranges > 0, ranges, objective_scales(front))
        self.resolver = Resolver(self.ranges, front.F[self.good], 0.1 * tolerance)
        self.points = {i: self._begin(i) for i in self.good.tolist()}

    def go(self, time_limit: float | None, progress: bool) -> Front:
        """The refined front; after Ctrl-C or the time limit, what there is of it."""
        from ..front import Front

        with Told(progress) as told, Monitor(time_limit, None, None) as monitor, stopped_by(lambda: bool(monitor.reason)):
            self._polish()
            for k in range(self.rounds):
                active = sum(point.active for point in self.points.values())
                told(f"meshes of the front: round {k + 1} of at most {self.rounds}, {active} of {len(self.front)} points")
                if not active or stopping():
                    break
                self._round()
            taken, stopped = monitor.elapsed, monitor.reason
        front, resolver = self.front, self.resolver
        rows = [self._columns(i) for i in range(len(front))]
        columns: dict[str, Any] = {key: [row[key] for row in rows] for key in rows[0]}
        reached = sum(not self._complaints(point) for point in self.points.values())
        stats = {
            **front.stats,
            "gradient_solves": front.stats["gradient_solves"] + resolver.gradient_solves,
            "inner_iterations": front.stats["inner_iterations"] + resolver.inner_iterations,
            "wall_time": front.stats["wall_time"] + taken,
            "reproducible": front.stats["reproducible"] and not (resolver.clocked or stopped),
            "mesh_tolerance": self.tolerance,
        }
        return Front(
            **columns,
            goals=front.goals,
            problem=self.problem,
            solver=front.solver,
            stats=stats | ({"stopped": stopped} if stopped else {}),
            message=f"{reached} of {len(front)} points meet the mesh tolerance of {self.tolerance:.0e}.",
        )

    def _begin(self, i: int) -> _Refined:
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
        """Points that nobody has found to be optimal are solved on the meshes that they have: rough controls would ask for finer ones."""
        rough: dict[Meshed, list[int]] = {}
        for i, point in self.points.items():
            if point.point.optimality is None or point.point.optimality > OPTIMAL:
                rough.setdefault(point.method, []).append(i)
        for method, members in rough.items():
            nlp = method.transcribe(self.problem)
            for i in _still_wanted(members):
                solved = self.resolver.solve(nlp, self.points[i].point.F, self.points[i].end, self._starts(i, nlp))
                if solved.status == CONVERGED and solved.by_gradients:
                    self._take(self.points[i], method, solved)

    def _round(self) -> None:
        """Every point that needs it: solved anew on a finer mesh, and looked at. Those that share a mesh follow each other."""
        finer: dict[Meshed, list[int]] = {}
        for i, point in self.points.items():
            if point.active:
                settled = self._missed(point) <= COST * self.tolerance
                method = next_method(point.method, point.verdict, point.trajectory, integrals=not settled)
                point.active = method != point.method
                point.trouble = "" if point.active else "no mesh is refined further"
                if point.active:
                    finer.setdefault(method, []).append(i)
        for method, members in finer.items():
            nlp = method.transcribe(self.problem)
            for i in _still_wanted(members):
                self._solve(i, method, nlp)

    def _solve(self, i: int, method: Meshed, nlp: NLP) -> None:
        point = self.points[i]
        solved = self.resolver.solve(nlp, point.point.F, point.end, self._starts(i, nlp))
        if solved.status != CONVERGED:
            if not stopping():
                point.active, point.trouble = False, f"on the next finer mesh it is '{solved.status}'"
            return
        change = float((np.abs(solved.F - point.F) / self.ranges).max())
        self._take(point, method, solved)
        point.change = change
        point.active = bool(self._complaints(point))
        point.history.append(max(point.verdict.error, change / (COST * self.tolerance)))
        earlier, latest = point.history[:-PATIENCE], point.history[-PATIENCE:]
        if point.active and earlier and min(latest) > 0.8 * min(earlier):
            point.active, point.trouble = False, "finer meshes do not help"

    def _take(self, point: _Refined, method: Meshed, solved: Resolved) -> None:
        point.method, point.solved, point.trajectory = method, solved, solved.nlp.unpack(solved.z)
        point.verdict = self._judge(point.trajectory)

    def _starts(self, i: int, nlp: NLP) -> Iterator[np.ndarray]:
        """Its own trajectory, then those of the points nearest to it, on its mesh."""
        here = self.points[i].point.F
        distance = {j: float(np.linalg.norm((other.point.F - here) / self.ranges)) for j, other in self.points.items()}
        for j in sorted(distance, key=lambda j: distance[j])[:3]:
            yield nlp.interpolate(self.points[j].trajectory)

    def _missed(self, point: _Refined) -> float:
        """How far flown objectives are from those of the mesh, in ranges of the front."""
        objectives = dict(zip(self.front.names, (point.F * self.problem.signs).tolist(), strict=True))
        return missed(point.verdict.simulation, objectives, self.ranges)

    def _complaints(self, point: _Refined) -> list[str]:
        """What keeps a point from meeting the tolerance."""
        found = point.verdict.complaints()
        off, settled = self._missed(point), COST * self.tolerance
        if not found and not off <= settled:
            found.append(f"flown, its objectives differ by {off:.1e} of the front's range")
        if np.isinf(point.change):
            found.append("it was not solved on a finer mesh")
        elif not point.change <= settled:
            found.append(f"its objectives still change by {point.change:.1e} of the front's range from mesh to mesh")
        return found

    def _columns(self, i: int) -> dict[str, Any]:
        """What a Front holds of point i."""
        point = self.points.get(i)
        if point is None:
            return _untouched(self.front[i], "")
        complaints = self._complaints(point)
        if complaints:
            complaints.append(point.verdict.worst_place(point.method, point.trajectory))
        note = "; ".join([*complaints, *([point.trouble] if point.trouble else [])])
        if point.solved is None:
            return _untouched(self.front[i], note)
        solved = point.solved
        row = {key: values[0] for key, values in trajectory_columns(solved.nlp, solved.z[None], self.front.stats["tolerance"]).items()}
        certified = optimality(solved.nlp, solved.z, self.ranges) if solved.by_gradients else None
        return row | {"optimality": certified, "notes": note}


def _still_wanted(members: Iterable[int]) -> Iterator[int]:
    """One after the other, until the work is to end."""
    for i in members:
        if stopping():
            return
        yield i


def _untouched(point: Point, note: str) -> dict[str, Any]:
    return {
        "F": point.F,
        "decision": point.decision,
        "violation": point.violation,
        "status": point.status,
        "variables": point.variables,
        "violations": point.violations,
        "trajectories": point.trajectory,
        "excursions": point.excursions,
        "transcription": point.transcription,
        "optimality": point.optimality,
        "notes": note or point.note,
    }


DRIFT = 1e-3
"""A point that gets worse by more than this, in ranges of the front, may have lost its way: other starts are tried too."""


CAP = 1e-9
"""How much of its range the objective that an end is best in may be given up for the other ones."""


@dataclass(frozen=True, eq=False)
class Resolved:
    """What came of it: a vector of `nlp`, its objectives (m,), its status, and whether it is an optimum or only feasible."""

    nlp: NLP
    z: np.ndarray
    F: np.ndarray
    status: str
    by_gradients: bool


class Resolver:
    """Solves points anew, and counts.

    Parameters
    ----------
    ranges : array (m,)
        Of the objectives on the front.
    F : array (n, m)
        The front's objectives, all minimised.
    tolerance : float
        Largest scaled residual of a feasible point.
    """

    def __init__(self, ranges: np.ndarray, F: np.ndarray, tolerance: float) -> None:
        self.ranges, self.F, self.tolerance = ranges, F, tolerance
        self.gradient_solves = self.inner_iterations = 0
        self.clocked = False

    def solve(self, nlp: NLP, position: np.ndarray, end: int | None, starts: Iterable[np.ndarray]) -> Resolved:
        """The point of this mesh's front that is met from `position` along the front's ranges (Pascoletti and Serafini).

        Where a mesh promised more than can be flown, the point gets worse; so there is no limit at its old objectives.

        Parameters
        ----------
        nlp : NLP
        position : array (m,)
            Objectives of the point on the first mesh.
        end : int, optional
            The objective of which this is the front's best point: then that is minimised, and after it the others.
        starts : vectors (n,)
            The first is the point itself; the others are tried where it fails, or loses its way.

        Returns
        -------
        Resolved
            Where objectives have no derivatives (a peak that is maximised) and where the gradient solves fail: the feasible point nearest
            to the first start.
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
            # A use of peaks that gradient tools refuse.
            pass
        good = [solved for solved in found if solved.status == CONVERGED]
        if good:
            best = min(good, key=lambda solved: self._worse(solved, position, end))
            return Resolved(nlp, best.z, best.F, best.status, True)
        assert first is not None
        near = Ipopt().solve(nlp, first[None, nlp.free], first[None], tolerance=self.tolerance)
        self.inner_iterations += int(near.iterations.sum())
        self.clocked |= near.clocked
        return Resolved(nlp, near.z[0], near.F[0], str(near.status[0]), False)

    def _worse(self, solved: Solved, position: np.ndarray, end: int | None) -> float:
        """By how much, in ranges, it is worse than where it began."""
        change = (solved.F - position) / self.ranges
        return float(change.max() if end is None else change[end])

    def _scalarized(self, nlp: NLP, position: np.ndarray, end: int | None, start: np.ndarray) -> Solved:
        if end is not None:
            solved = self._lexicographic(nlp, position, end, start)
            others = np.linalg.norm((self.F - position) / self.ranges, axis=1)
            nearest = others[others > 0].min(initial=np.inf)
            # What moves further than half the way to the next point was not an end of the front, only of the part of it that is here.
            if solved.status != CONVERGED or np.linalg.norm((solved.F - position) / self.ranges) <= 0.5 * nearest:
                return solved
        return self._count(scalarize(nlp, start, reference=position, weights=self.ranges, tolerance=self.tolerance))

    def _lexicographic(self, nlp: NLP, position: np.ndarray, end: int, start: np.ndarray) -> Solved:
        """The best value of one objective, and with that, the best of the others."""
        mine = np.arange(len(position)) == end
        alone = np.where(mine, position, np.inf)
        first = self._count(scalarize(nlp, start, reference=alone, weights=self.ranges, tolerance=self.tolerance))
        if first.status != CONVERGED or len(position) == 1:
            return first
        ceiling = np.where(mine, first.F + CAP * self.ranges, np.inf)
        others = np.where(mine, np.inf, first.F)
        second = self._count(scalarize(nlp, first.z, reference=others, weights=self.ranges, ceiling=ceiling, tolerance=self.tolerance))
        return second if second.status == CONVERGED else first

    def _count(self, solved: Solved) -> Solved:
        self.gradient_solves += solved.begun
        self.clocked |= solved.clocked
        return solved
