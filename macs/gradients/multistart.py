"""Gradient solves of scalarised problems, each counted: alone, and the best from several starts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from transcription.base import INFEASIBLE, NLP
from transcription.nlp.derivatives import linear_objectives, objective_gradients
from transcription.nlp.elastic import least_violation
from transcription.nlp.scalarized import Solved, scalarize
from transcription.nlp.scaling import nlp_scales
from transcription.stopping import stopping

from ..evaluation.evaluator import CONVERGED, Counts
from .starts import UNSEEN, Census, Starts

LIMIT, BETTER = 1e-8, 1e-7
"""Fraction of an objective's range by which its limit may be exceeded; difference in alpha by which a result is clearly better."""


MOST_ITERATIONS = 500
"""Iterations of IPOPT after which a strategy of a solve is given up by default."""


SHORT, LITTLE = 200, 6e5
"""Most iterations of each further start; work, see `Counts`, that they may always take together, a matter of a second or two."""


TRIED = (8, 16)
"""Fewest and most starts from which no feasible vector is found before the search for one ends; between them, what took `LITTLE`."""


class GradientSolves:
    """Gradient solves with one tolerance, which are counted."""

    def __init__(self, tolerance: float, max_iterations: int = MOST_ITERATIONS) -> None:
        self.tolerance, self.max_iterations = tolerance, max_iterations
        self.counts, self._persistent, self._near = Counts(), True, False
        self.before: Callable[[], None] = lambda: None

    def __call__(
        self, nlp: NLP, start: np.ndarray, reference: np.ndarray, weights: np.ndarray, ceiling: np.ndarray | None = None
    ) -> Solved:
        """The result of one solve from a vector (n,); see `scalarize` for reference, weights and ceiling (m,)."""
        self.before()
        limits: dict[str, Any] = {"tolerance": self.tolerance, "max_iterations": self.max_iterations, "persistent": self._persistent}
        return self._counted(nlp, scalarize(nlp, start, reference=reference, weights=weights, ceiling=ceiling, near=self._near, **limits))

    def least_violation(self, nlp: NLP, start: np.ndarray) -> Solved:
        """What is feasible, or violates least, near a vector (n,); see `least_violation`."""
        self.before()
        return self._counted(nlp, least_violation(nlp, start, tolerance=self.tolerance))

    def _counted(self, nlp: NLP, solved: Solved) -> Solved:
        self.counts.add_solves(int(solved.begun), [solved.status], solved.iterations, solved.clocked, len(nlp.variables))
        return solved

    @contextmanager
    def at_most(self, iterations: int) -> Iterator[None]:
        """Solves within take no more iterations than these, of which the first strategy may take all."""
        usual = self.max_iterations
        self.max_iterations, self._persistent = min(usual, iterations), False
        try:
            yield
        finally:
            self.max_iterations, self._persistent = usual, True

    @contextmanager
    def nearby(self) -> Iterator[None]:
        """Solves within look near their starts only; see `scalarize`."""
        self._near = True
        try:
            yield
        finally:
            self._near = False


class MultistartSolver:
    """Solver of scalarised problems of one NLP, each from the best vector known for it and from other starts, see `starts`. given (k,
    n)."""

    def __init__(
        self,
        nlp: NLP,
        given: np.ndarray | None,
        starts: int | None,
        rng: np.random.Generator,
        solves: GradientSolves,
    ) -> None:
        self.nlp, self.starts, self.tolerance = nlp, starts, solves.tolerance
        self.solves, self._starts = solves, Starts(nlp, rng)
        self.rng, self.census, self.most, self.unseen = rng, dict[int, Census](), np.inf, UNSEEN
        self.closest: Solved | None = None
        self._known = np.empty((0, len(nlp.variables))) if given is None else given
        self._given = len(self._known)
        self._F: np.ndarray = np.empty((0, len(nlp.problem.goals)))
        self._violation: np.ndarray = np.empty(0)
        if given is not None:
            self._F, self._violation = nlp.evaluate(given)

    @property
    def counts(self) -> Counts:
        """Gradient solves, iterations, failures by status."""
        return self.solves.counts

    @property
    def drawn_enough(self) -> bool:
        """Whether as many starts were drawn as may be."""
        return self._starts.drawn >= self.most

    def solve(
        self, reference: np.ndarray, weights: np.ndarray, ceiling: np.ndarray | None = None, start: np.ndarray | None = None
    ) -> Solved:
        """The best result of `starts` solves; see `scalarize` for reference, weights and ceiling (m,).

        The first solve begins at `start` (n,), or at the best known vector for this problem.
        """
        first = start if start is not None else self.nearest(reference, weights)
        found = [] if first is None else [self.from_vector(first, reference, weights, ceiling)]
        for _ in range((self.starts or 1) - len(found)):
            found.append(self.from_drawn(reference, weights, ceiling))
        return self.better(found, reference, weights)

    def seek(self, reference: np.ndarray, weights: np.ndarray, census: Census) -> Solved:
        """The best result of as many solves as pay, see `Census`: further starts end when they have taken a little, or as much as the first
        one took."""
        before = self.counts.work
        best = self.reached(self.solve(reference, weights), reference, weights)
        limit = self.counts.work + max(LITTLE, self.counts.work - before)
        census.add(self.loss(best, reference, weights))
        while not (
            census.enough or self.closest or self.drawn_enough or self.counts.work >= limit or stopping() or self.is_least(best, reference)
        ):
            # Where none has converged yet, they may all take long.
            with self.solves.at_most(SHORT if census.converged else self.solves.max_iterations):
                found = self.from_drawn(reference, weights, best=best if census.converged else None)
            # One that is hardly better is the same optimum: that of the first start is as good.
            if census.add(self.loss(found, reference, weights)) or (not census.converged and found.violation < best.violation):
                best = found
        return best

    def reached(self, solved: Solved, reference: np.ndarray, weights: np.ndarray) -> Solved:
        """The result of a solve, or, where that is not feasible, of one from a vector that is.

        That vector is sought near the best that is known and near starts that are drawn. If there is none near any of them, the result is
        what violates least, now and later: `closest`.
        """
        if self.closest is not None:
            return self.closest
        if solved.violation <= self.tolerance or len(self._F) > self._given:
            return solved
        tried, limit, known = list[Solved](), self.counts.work + LITTLE, self.nearest(reference, weights)
        while not stopping() and len(tried) < TRIED[1] and (len(tried) < TRIED[0] or self.counts.work < limit):
            start = self._starts.draw()[0] if known is None else known
            near, known = self.solves.least_violation(self.nlp, start), None
            if near.status == CONVERGED:
                return self.better([solved, self.from_vector(near.z, reference, weights)], reference, weights)
            tried.append(near)
        if sum(near.status == INFEASIBLE for near in tried) >= TRIED[0]:
            self.closest = min(tried, key=lambda near: near.violation)
        return self.closest or solved

    def loss(self, solved: Solved, reference: np.ndarray, weights: np.ndarray) -> float | None:
        """What a scalarised problem minimises, at a result that converged."""
        if solved.status != CONVERGED:
            return None
        moving = (reference < np.inf) & (weights > 0)
        return float(np.max((solved.F - reference)[moving] / weights[moving]))

    def from_vector(self, start: np.ndarray, reference: np.ndarray, weights: np.ndarray, ceiling: np.ndarray | None = None) -> Solved:
        """The result of one solve from a vector (n,); if it converged, later solves may begin at it."""
        solved = self.solves(self.nlp, start, reference, weights, ceiling)
        if solved.status == CONVERGED:
            self._known = np.vstack([self._known, solved.z])
            self._F, self._violation = np.vstack([self._F, solved.F]), np.append(self._violation, solved.violation)
        return solved

    def single(self, i: int) -> Solved:
        """The optimum of objective i alone. Where a solve from the best that is known does not end, as that is an optimum of another
        objective within tight limits, also from what was given."""
        task = single_task(i, len(self.nlp.problem.goals))
        if self.closest is not None:
            return self.closest
        if self.starts is None and i not in self.census:
            self.census[i] = Census(self.unseen)
            solved = self.seek(*task, self.census[i])
        else:
            solved = self.solve(*task)
        if (rival := self.rival(solved, *task)) is not None:
            solved = self.from_rival(rival, solved, *task)
        for start in self._known[: self._given] if solved.status != CONVERGED and not self.closest else ():
            solved = self.better([solved, self.from_vector(start, *task)], *task)
        return solved

    def near(self, start: np.ndarray, reference: np.ndarray, weights: np.ndarray, ceiling: np.ndarray | None = None) -> Solved:
        """The result of one solve that stays near a vector (n,)."""
        with self.solves.nearby():
            return self.from_vector(start, reference, weights, ceiling)

    def merits(self, reference: np.ndarray, weights: np.ndarray, F: np.ndarray, violation: np.ndarray, strict: bool = False) -> np.ndarray:
        """Merits (k,) of points F (k, m) for a scalarised problem, less is better: their alpha plus their excess over limits and
        constraints.

        The excess over limits is in ranges of the objectives among the known points. With `strict`, as for results, a point with any excess
        has an infinite merit; without, as for starts, it may still be good.
        """
        used, moving = reference < np.inf, (reference < np.inf) & (weights > 0)
        alpha = np.max((F[:, moving] - reference[moving]) / weights[moving], axis=1, initial=-np.inf)
        hard = used & ~moving
        ranges = np.ptp(self._F[:, hard], axis=0) if len(self._F) else np.ones(hard.sum())
        over = (np.maximum(F[:, hard] - reference[hard], 0.0) / np.where(ranges > 0, ranges, 1.0)).sum(axis=1)
        missed = over + np.where(violation <= self.tolerance, 0.0, violation)
        merit = alpha + np.where(missed > LIMIT, np.inf, 0.0) if strict else alpha + missed
        return np.where(np.isfinite(merit), merit, np.inf)

    def better(self, found: list[Solved], reference: np.ndarray, weights: np.ndarray) -> Solved:
        """The best of several results of one problem: converged ones first, by their alpha; then the others by their violation."""
        F, violation = np.array([solved.F for solved in found]), np.array([solved.violation for solved in found])
        failed = np.array([solved.status != CONVERGED for solved in found])
        merit = np.where(failed, violation, self.merits(reference, weights, F, violation))
        return found[np.lexsort((merit, failed))[0]]

    def rival(self, solved: Solved, reference: np.ndarray, weights: np.ndarray) -> np.ndarray | None:
        """A known vector (n,) that is clearly better for a problem than its own result; None if there is none."""
        if not len(self._known):
            return None
        merits = self.merits(reference, weights, self._F, self._violation, strict=True)
        own = self.merits(reference, weights, solved.F[None], np.array([solved.violation]))[0] if solved.status == CONVERGED else np.inf
        return self._known[np.argmin(merits)] if merits.min() < own - BETTER else None

    def from_rival(self, rival: np.ndarray, solved: Solved, reference: np.ndarray, weights: np.ndarray) -> Solved:
        """The better of a result and a solve from a known vector (n,) that is better; where that goes elsewhere, one that stays near it."""
        found = self.better([solved, self.from_vector(rival, reference, weights)], reference, weights)
        if self.rival(found, reference, weights) is not None:
            found = self.better([found, self.near(rival, reference, weights)], reference, weights)
        return found

    def clearly_better(self, one: Solved, other: Solved, reference: np.ndarray, weights: np.ndarray) -> bool:
        """Whether a result of a problem whose weights are ranges is better than another one by more than the accuracy of solves."""
        alpha, known = self.loss(one, reference, weights), self.loss(other, reference, weights)
        return alpha is not None and (known is None or alpha < known - BETTER)

    def is_least(self, solved: Solved, reference: np.ndarray) -> bool:
        """Whether a result converged and is the least that bounds allow, see `is_least` beside this class; reference (m,)."""
        return solved.status == CONVERGED and is_least(self.nlp, solved.z, reference)

    def nearest(self, reference: np.ndarray, weights: np.ndarray) -> np.ndarray | None:
        """The known vector (n,) with the best merit; None if none is known."""
        return self._known[np.argmin(self.merits(reference, weights, self._F, self._violation))] if len(self._known) else None

    def from_drawn(
        self, reference: np.ndarray, weights: np.ndarray, ceiling: np.ndarray | None = None, best: Solved | None = None
    ) -> Solved:
        """The result of a solve from a start that is drawn; `best` is the best result so far. Where there is none, and propagated states
        lead to no optimum, also from the states of the guess."""
        found: list[Solved] = []
        for start in self._starts.draw(None if best is None else best.z):
            found.append(self.from_vector(start, reference, weights, ceiling))
            if found[-1].status == CONVERGED or best is not None:
                break
        return self.better(found, reference, weights)


def is_least(nlp: NLP, z: np.ndarray, reference: np.ndarray) -> bool:
    """Whether a vector (n,) has the least value that the bounds of variables allow an objective to have: where it is linear, and the only
    one of the problem with this reference (m,). No other start can then lead to less, by more than the accuracy of solves."""
    (used,) = np.nonzero(reference < np.inf)
    if len(used) != 1:
        return False
    slopes = np.array(objective_gradients(nlp)(z)).reshape(-1, len(z))[used[0]]
    room = np.where(nlp.period > 0, np.inf, np.where(slopes > 0, z - nlp.lower, nlp.upper - z))
    to_fall = float(np.abs(slopes[slopes != 0.0]) @ room[slopes != 0.0])
    return to_fall <= BETTER * nlp_scales(nlp)[used[0]] and bool(linear_objectives(nlp)[used[0]])


def single_task(i: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Reference and weights (m,) of objective i alone; see `scalarize`."""
    return np.where(np.arange(m) == i, 0.0, np.inf), np.eye(m)[i]


def guessed_start(nlp: NLP) -> np.ndarray | None:
    """The problem's guess as a full vector (1, n), in the middle of the bounds where there is none; None without any guess."""
    if not np.isfinite(nlp.guess).any():
        return None
    middle = 0.5 * (nlp.lower[nlp.free] + nlp.upper[nlp.free])
    return nlp.first_guess(np.where(np.isfinite(nlp.guess), nlp.guess, middle)[None])
