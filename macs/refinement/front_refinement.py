"""Mesh refinement of a front: its points on meshes of their own, fine enough for simulations to confirm them, or all on one finer mesh.

The ends of the front are solved first, each for the least value of its own objective, then the points between them, from the nearest on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
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
from ..fronts.builders import certified, from_vectors
from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.provenance import more_costs
from ..fronts.verified import fixed_scales
from ..gradients.ends import moved_along
from ..gradients.scalarised import MOST_ITERATIONS, GradientSolves, LexicographicEnd, Scalarised
from ..io.console import working
from ..pareto.dominance import extremes
from .mesh_loop import MeshLoop, OnMesh, Programs, Refinement, differentiable


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
        self._first = first
        self.found: dict[int, Refinement] = {}
        self._rows: dict[int, Points] = {}

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
        fixed, found = fixed_scales(self.front), self.loop.units(self.front.F[self.good], nlp, self.front[first].decision)
        self.units = np.where(np.isnan(fixed), found, fixed)
        ends = self._ends()
        between = [i for i in self.chosen if i not in ends]
        for i, task in self._tasks(ends, between):
            if self.loop.ended:
                return
            done = len(self.found) + 1
            show(f"meshes of the front: {f'end {done} of {len(ends)}' if i in ends else f'point {done} of {len(self.chosen)}'}")
            self._refine(i, task)

    def _tasks(self, ends: Mapping[int, LexicographicEnd], between: Sequence[int]) -> Iterator[tuple[int, Scalarised]]:
        """Rows with their tasks on another mesh: ends first, then the points between, which move along with these: those that gain
        most, then from the nearest on."""
        yield from ends.items()
        F, m = self.front.F, len(self.units)
        known = [i for i in ends if i in self.found] if len(ends) == m else []
        moved = np.array([self.found[i].best.F for i in known]).reshape(-1, m)
        references, weights = moved_along(F[between], F[known], moved, self.units)
        left = dict(zip(between, references, strict=True))
        while left:
            i = min(left, key=lambda j: (-self._gaining(j), min((self._distance(j, k) for k in self.found), default=0.0)))
            yield i, Scalarised(left.pop(i), weights, units=self.units)

    def points(self, elapsed: float, stopped: str) -> Points:
        """The front with the refined points, in the same order, and their costs."""
        front = self.front
        rows = [self._rows.get(i, front[[i]]) for i in range(len(front))]
        for i in set(self.chosen) - set(self.found):
            rows[i] = rows[i].replace(notes=[NOT_BEGUN])
        reached = sum(not found.complaints() for found in self.found.values())
        return Points.concatenate(rows).replace(
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
        nlp, point = self.loop.programs(self.methods[i]), self.front[i]
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
        certified = self.front[i].optimality
        return certified is not None and certified <= FRONT.optimal

    def _gaining(self, i: int) -> float:
        """What a point is known to gain where it begins, if that is more than it may."""
        gain = float(self.front.gain[i])
        return gain if gain > self.wanted.gained else 0.0

    def _distance(self, i: int, j: int) -> float:
        return float(np.linalg.norm((self.front.F[i] - self.front.F[j]) / self.units))

    def _refine(self, i: int, task: Scalarised) -> None:
        """Refine one point, and make its row of the new front."""
        point = self.front[i]
        known = self._known(i)
        trajectory = self._trajectory(i)
        nlp, z = self.loop.programs(self.methods[i]), point.decision
        # What gains already is to be seen where it begins.
        conditions = Conditions.of(nlp, z, self.units) if self._gaining(i) else None
        multipliers = None if conditions is None else conditions.multipliers()
        optimum = None if multipliers is None else OptimumMultipliers.at(nlp, z, multipliers)
        begun = self.loop.on_mesh(self.methods[i], z, point.F, trajectory, self.units, known, optimum)
        near = sorted((j for j in self.chosen if j != i), key=lambda j: self._distance(i, j))[: FRONT.neighbours]
        done = [j for j in sorted(self.found, key=lambda j: self._distance(i, j)) if not self.found[j].complaints()]
        near_meshes = [self._first] if self._first else self._meshes_near(done, begun.verdict.error, task)
        # Rough controls would need finer meshes than optimal ones.
        own = [] if known or near_meshes else [self.methods[i]]
        hints = list(dict.fromkeys([*near_meshes, *own]))
        # One point that resists is not to take what is meant for the others.
        share = (FRONT.of_end if isinstance(task, LexicographicEnd) else FRONT.of_one) / len(self.chosen)
        with self.loop.at_most(share * self.loop.most_work):
            self.found[i] = found = self.loop.refine(begun, task, [self._trajectory(j) for j in near], hints)
        self._rows[i] = self._row(i, found.best, found.note)

    def _meshes_near(self, done: Sequence[int], error: float, task: Scalarised) -> list[Meshed]:
        """Meshes to try first for a point with an error, in units of the tolerance: those of the nearest `done` point."""
        if not done:
            return []
        nearest = self.found[done[0]]
        if error > FRONT.hinted:
            return nearest.meshes[-2:]
        # Where no other mesh has to confirm it, its program is there already. An end is far from others.
        return [] if self.wanted.confirmed or isinstance(task, LexicographicEnd) else [nearest.best.method]

    def _trajectory(self, i: int) -> Trajectory:
        found = self.found.get(i)
        trajectory = self.front[i].trajectory if found is None else found.best.trajectory
        assert trajectory is not None
        return trajectory

    def _row(self, i: int, best: OnMesh, note: str) -> Points:
        """A point on its best mesh, as a set of one point."""
        front = self.front
        if np.array_equal(best.z, front[i].decision):
            return front[[i]].replace(notes=[note or front[i].note])
        nlp = self.loop.programs(best.method)
        found = certified(nlp, best.z[None], self.units) if best.by_gradients else {}
        about: dict[str, Any] = {**found, "notes": [note], "trajectories": [best.trajectory]}
        return from_vectors(nlp, best.z[None], front.solver, front.stats, **about)
