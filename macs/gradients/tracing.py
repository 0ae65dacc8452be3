"""Tracing a front of two objectives: points are solved where its curve errs most, until it errs by less than is asked for.

A place on the line between the ends is solved by Pascoletti and Serafini's method from the points beside it. A result elsewhere says that
there is a gap; one that is worse than the curve is sought from both sides, and one that is better is passed on to its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from transcription.nlp.scalarized import Solved
from transcription.stopping import stopping

from ..evaluation.evaluator import CONVERGED
from ..fronts.curve import FrontCurve, alone
from ..io.workers import TOGETHER
from ..pareto.directions import LATTICE_SIZE
from .ends import solve_tasks, strong
from .multistart import MultistartSolver
from .scalarised import Scalarised


class CurveTrace:
    """The points of a front of two objectives from its ends on, the first ones `known`, the gaps between them as pairs of points, and the
    curve through them; with a function for the `weights` of a result, None where they are not known, and the error that is `wanted`."""

    def __init__(self, solver: MultistartSolver, known: Sequence[Solved], weights: Callable[[Solved], Any], wanted: float) -> None:
        self._solver, self._ends, self._weights, self.wanted = solver, known[:2], weights, wanted
        self.found, self._tried, self.gaps = list(known), list[tuple[float, float]](), list[tuple[Solved, Solved]]()
        F = np.array([end.F for end in self._ends])
        self._ranges = np.ptp(F, axis=0)
        self.curve = FrontCurve.through(solver.nlp.problem.goals, F, np.full((2, 2), np.nan), [])

    def go(self) -> list[Solved]:
        """All results, after points were solved until the curve errs by less than is wanted, or until there is nothing more to solve."""
        if len(self.found) == 2:
            places = (0.5 - 0.5 * np.cos(np.arange(1, 4) * np.pi / 4)).tolist()  # Chebyshev's
            self._keep(places, solve_tasks(self._solver, [self._task(place) for place in places]))
        while (places := self._next()) and len(self.found) < LATTICE_SIZE and not stopping():
            self._solve(places)
        return self.found

    def points(self) -> list[Solved]:
        """The results on the front whose weights are known, from end to end."""
        good = [one for one in self.found if one.status == CONVERGED and self._weights(one) is not None]
        kept = alone(np.reshape([one.F for one in good], (-1, 2)), self._ranges)
        return sorted((one for one, keep in zip(good, kept, strict=True) if keep), key=self._place)

    def _task(self, place: float) -> Scalarised:
        return Scalarised((1.0 - place) * self._ends[0].F + place * self._ends[1].F, self._ranges)

    def _place(self, solved: Solved) -> float:
        return float(self.curve.placed(solved.F)[0])

    def _empty(self, start: float, end: float) -> np.ndarray:
        """What was found empty between two places, (k, 2): from where a solve was to end to where it ended instead."""
        inside = [sorted(one) for one in self._tried if start < one[0] < end]
        return np.array(sorted([[start, start], *inside, [end, end]]))

    def _free(self, start: float, end: float) -> tuple[float, float]:
        """The middle and the length of the largest part between two places that is not known to be empty."""
        empty = self._empty(start, end)
        lows, highs = empty[1:, 0], np.maximum.accumulate(empty[:-1, 1])
        k = int(np.argmax(lows - highs))
        return float(0.5 * (lows[k] + highs[k])), float(lows[k] - highs[k])

    def _is_gap(self, start: float, end: float) -> bool:
        """Whether solves between two points ended at both of them, or at one of them from all places."""
        lows, highs = self._empty(start, end)[1:-1].T
        first, last = (bool(((lows < side) & (side < highs)).any()) for side in (start + self.wanted, end - self.wanted))
        return (first and last) or ((first or last) and self._free(start, end)[1] < self.wanted)

    def _next(self) -> list[float]:
        """The next places: where the curve errs most, then kinks and gaps that no solve has seen."""
        points = self.points()
        if len(points) < 2:
            return []
        self.gaps = [(a, b) for a, b in pairwise(points) if self._is_gap(self._place(a), self._place(b))]
        F, weights = np.array([one.F for one in points]), np.array([self._weights(one) for one in points])
        self.curve = curve = FrontCurve.through(self.curve.goals, F, weights, [0.5 * (a.F[0] + b.F[0]) for a, b in self.gaps])
        wanted = []
        for part in curve.parts:
            for (start, end), error in zip(pairwise(part.places.tolist()), part.errors.tolist(), strict=True):
                place, length = self._free(start, end)
                if error > self.wanted and length > self.wanted and len(self._empty(start, end)) < 2 * TOGETHER:
                    wanted.append((-error, place))
        if not wanted:
            edges = [(one.interval[1] - self.wanted, other.interval[0] + self.wanted) for one, other in pairwise(curve.parts)]
            wanted = [(0.0, 0.5 * (a + b)) for a, b in edges if not any(a < place < b for place, _ in self._tried)]
        return [place for _, place in sorted(wanted)[:TOGETHER]]

    def _solve(self, places: Sequence[float]) -> None:
        """Solve the points at these places, each from the better of those beside it for that."""
        points, tasks, (expected, _, errors) = self.points(), [self._task(place) for place in places], self.curve.at(places)
        after = np.searchsorted([self._place(one) for one in points], places)
        beside = [sorted(points[max(k - 1, 0) : k + 1], key=lambda one: task.loss(one.F)) for k, task in zip(after, tasks, strict=True)]
        errors = np.maximum(errors, self.wanted)
        found = self._solver.from_vectors([(near[0].z, task) for near, task in zip(beside, tasks, strict=True)])
        elsewhere = np.abs([self._place(one) for one in found] - np.array(places)) > self.wanted
        doubtful = np.flatnonzero(elsewhere | (self._heights(tasks, found) > expected + errors))
        for k, other in zip(doubtful, self._solver.from_vectors([(beside[k][-1].z, tasks[k]) for k in doubtful]), strict=True):
            found[k] = min(found[k], other, key=tasks[k].rank)
        self._keep(places, strong(self._solver, found, self._ranges))
        better = np.flatnonzero(self._heights(tasks, found) < expected - errors)
        self.found += self._solver.from_vectors([(found[k].z, self._task(self._place(one))) for k in better for one in beside[k]])

    @staticmethod
    def _heights(tasks: Sequence[Scalarised], found: Sequence[Solved]) -> np.ndarray:
        """Heights (k,) of results; infinite for one that did not converge."""
        return np.array([task.alpha(one.F) if one.status == CONVERGED else np.inf for task, one in zip(tasks, found, strict=True)])

    def _keep(self, places: Sequence[float], found: Sequence[Solved]) -> None:
        self.found += found
        self._tried += [(t, self._place(one) if one.status == CONVERGED else t) for t, one in zip(places, found, strict=True)]
