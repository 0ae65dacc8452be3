"""A front solved again on one finer mesh, where that of its search is known to be too coarse."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from transcription.base import NLP
from transcription.meshed import Meshed
from transcription.nlp.scalarized import Solved
from transcription.stopping import Stopped, stopping

from ..evaluation.evaluator import CONVERGED
from ..fronts.builders import certified, from_vectors
from ..fronts.points import Points
from ..fronts.provenance import more_costs
from ..gradients.ends import moved_along
from ..gradients.scalarised import GradientSolves, LexicographicEnd, Scalarised, Start, best_of
from ..pareto.dominance import extremes
from .mesh_loop import DRIFT, MeshLoop, Programs, differentiable

PATIENCE = 250
"""Most iterations of one solve, of which the first strategy may take all: from a trajectory nearby most take some tens."""
NEIGHBOURS = 2
"""Number of neighbours from which a point is solved, too, where it is lost or gets worse from its own trajectory."""


def solved_on(
    points: Points, rows: Sequence[int], fine: Meshed, programs: Programs, show: Callable[[str], None] = lambda words: None
) -> Points:
    """The points in their order, of which those in `rows` have been solved on one mesh, as far as that succeeds; these not simulated.

    The ends of the front are solved first, each for the least value of its own objective, then the points between them, from the nearest
    on. Nothing is simulated in between: a simulation of all takes less time than those of one after the other.
    """
    if not (rows and differentiable(points.compiled())):
        return points
    # Asked to end, what was not solved stays as it was.
    with suppress(Stopped):
        job = _FineFront(points, rows, programs(fine), GradientSolves(float(points.stats["tolerance"])))
        job.go(show)
        return job.points()
    return points


class _FineFront:
    """The points of one front on one mesh, those that are done: row -> result."""

    def __init__(self, points: Points, rows: Sequence[int], nlp: NLP, solves: GradientSolves) -> None:
        self.front, self.rows, self.nlp, self.solves = points, list(rows), nlp, solves
        self.done: dict[int, Solved] = {}
        self.units = MeshLoop.units(points.F[self.rows], nlp, self._start(self.rows[0]))

    def go(self, show: Callable[[str], None]) -> None:
        """Solve all points, or those until the work is to end."""
        F, ends = self.front.F, {}
        for objective, k in enumerate(extremes(F[self.rows])):
            if self.rows[k] not in ends:
                ends[self.rows[k]] = LexicographicEnd.of(objective, self.units, F[self.rows[k]])
        for i, end in ends.items():
            self._solve(i, end, show)
        known = [i for i in ends if i in self.done]
        between = [i for i in self.rows if i not in ends]
        complete = len(known) == len(self.units)
        old, new = (F[known], np.array([self.done[i].F for i in known])) if complete else (F[:0], F[:0])
        references, weights = moved_along(F[between], old, new, self.units)
        left = dict(zip(between, references, strict=True))
        while left and not stopping():
            i = min(left, key=lambda j: min((self._distance(j, k) for k in self.done), default=0.0))
            self._solve(i, Scalarised(left.pop(i), weights, units=self.units), show)

    def points(self) -> Points:
        """The front with the points that are done, and what they cost."""
        front, done = self.front, list(self.done)
        Z = np.array([self.done[i].z for i in done]).reshape(-1, len(self.nlp.variables))
        found = from_vectors(self.nlp, Z, front.solver, front.stats, sort=False, **certified(self.nlp, Z, self.units))
        rows = [found[[done.index(i)]] if i in self.done else front[[i]] for i in range(len(front))]
        stats = more_costs(front.stats, self.solves.counts, 0.0, "")
        return Points.concatenate(rows).replace(solver=front.solver, stats=stats, message=front.message)

    def _solve(self, i: int, task: Scalarised, show: Callable[[str], None]) -> None:
        """Solve one point from its own trajectory and, if it is lost or gets worse, from its neighbours on this mesh."""
        show(f"points on a finer mesh: {len(self.done) + 1} of {len(self.rows)}")
        near = sorted(self.done, key=lambda j: self._distance(i, j))[:NEIGHBOURS]
        starts = (Start(z, drift=DRIFT) for z in (self._start(i), *(self.done[j].z for j in near)))
        with self.solves.at_most(PATIENCE):
            best = best_of(task, self.solves, self.nlp, starts, task.loss(self.front.F[i]))
        if best.status == CONVERGED:
            self.done[i] = best

    def _start(self, i: int) -> np.ndarray:
        trajectory = self.front.trajectories[i]
        assert trajectory is not None
        return self.nlp.interpolate(trajectory)

    def _distance(self, i: int, j: int) -> float:
        return float(np.linalg.norm((self.front.F[i] - self.front.F[j]) / self.units))
