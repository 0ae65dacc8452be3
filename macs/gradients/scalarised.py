"""Scalarised problems of several objectives, and their counted gradient solves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from transcription.base import NLP
from transcription.inner.base import solves_charge
from transcription.nlp.derivatives import linear_objectives, objective_gradients
from transcription.nlp.elastic import least_violation
from transcription.nlp.optimality import Multipliers
from transcription.nlp.program import nlp_scales
from transcription.nlp.scalarized import Solved, not_begun, scalarize
from transcription.stopping import stopping

from ..evaluation.evaluator import CONVERGED, FAILED, Counts
from ..io.workers import each


@dataclass(frozen=True, eq=False)
class Scalarised:
    """From a reference along weights to the front (Pascoletti and Serafini 1984); see `scalarize`.

    minimise alpha   subject to   F_i - reference_i <= alpha weights_i,   F_i <= ceiling_i

    If they are `summed`, alpha is the sum of weights_i (F_i - reference_i) instead.
    """

    reference: np.ndarray  # (m,): infinite for an objective that is left out
    weights: np.ndarray  # (m,): 0 where the reference is a hard limit
    ceiling: np.ndarray | None = None  # (m,)
    units: np.ndarray = field(default_factory=lambda: np.ones(1))  # (m,): what counts as one in each objective; default: 1
    summed: bool = False
    held: Mapping[int, float] = field(default_factory=dict)  # variables and the values that these keep

    @classmethod
    def single(cls, i: int, m: int, ceiling: np.ndarray | None = None) -> Scalarised:
        """Objective i of m alone."""
        return cls(np.where(np.arange(m) == i, 0.0, np.inf), np.eye(m)[i], ceiling)

    @property
    def stated(self) -> dict[str, Any]:
        """It as arguments of `scalarize`."""
        limits = {"ceiling": self.ceiling, "summed": self.summed, "held": [*self.held]}
        return {"reference": self.reference, "weights": self.weights, **limits}

    def begun(self, start: np.ndarray) -> np.ndarray:
        """A start (n,) with the variables that are held."""
        return np.array([self.held.get(k, value) for k, value in enumerate(start.tolist())])

    @property
    def used(self) -> np.ndarray:
        """Mask (m,) of the objectives that matter."""
        return self.reference < np.inf

    @property
    def sharp(self) -> np.ndarray:
        """Mask (m,) of the objectives that a solve determines to its tolerance."""
        return self.used

    @property
    def moving(self) -> np.ndarray:
        """Mask (m,) of the objectives that are minimised."""
        return (self.reference < np.inf) & (self.weights > 0)

    @property
    def hard(self) -> np.ndarray:
        """Mask (m,) of the objectives with a hard limit."""
        return (self.reference < np.inf) & (self.weights <= 0) & ~np.bool_(self.summed)

    def alpha(self, F: np.ndarray) -> Any:
        """The minimised alpha, at objectives (..., m)."""
        moving = self.moving
        above = F[..., moving] - self.reference[moving]
        return above @ self.weights[moving] if self.summed else np.max(above / self.weights[moving], axis=-1, initial=-np.inf)

    def loss(self, F: np.ndarray) -> float:
        """Alpha and the excess over hard limits at objectives (m,), in units."""
        units = np.broadcast_to(self.units, self.weights.shape)
        moving, hard = self.moving, self.hard
        alpha = self.alpha(F) * (1.0 if self.summed else np.max((self.weights / units)[moving]))
        return float(alpha + np.maximum((F - self.reference)[hard] / units[hard], 0.0).sum())

    def rank(self, solved: Solved) -> tuple[bool, float]:
        """Order of results: converged ones first, by their loss; then the others by their violation."""
        failed = solved.status != CONVERGED
        return failed, solved.violation if failed else self.loss(solved.F)

    def optimum(self, solved: Solved) -> float | None:
        """Alpha at a result; None if that did not converge."""
        return float(self.alpha(solved.F)) if solved.status == CONVERGED else None

    def solve(self, solves: GradientSolves, nlp: NLP, start: np.ndarray, near: bool = False, warm: Multipliers | None = None) -> Solved:
        """The result of gradient solves from a vector (n,), or near it only, there with multipliers to begin with."""
        return solves(nlp, start, self, near, warm=warm)


@dataclass(frozen=True)
class EndLimits:
    """Limits of the solves for an end of a front on another mesh."""

    room: float = 0.05  # how much worse other objectives may become, in units, before the end is also sought near where it was
    clearly: float = 1e-7  # difference in alpha by which a result is clearly better: the accuracy of solves
    tied: float = 1e-6  # what counts as no loss of its own objective then, in units
    close: float = 1e-3  # violation up to which a start on another mesh is nearly the end itself, and a solve may go on
    ties: int = 150  # most iterations of a solve that is to improve the others
    slack: float = 1e-5  # part of an objective's range that may be lost where the others cannot be improved without any loss
    weightless: float = 1e-4  # share of an objective in the sum that a point minimises up to which it has no weight
    unsure: float = 0.2  # part of what a slack is worth, as its multipliers say, that is not known


END = EndLimits()


def at_bounds(nlp: NLP, z: np.ndarray, i: int) -> dict[int, float] | None:
    """The variables of objective i with their values at its least, {index: value}, if it is linear and a vector (n,) attains the least that
    bounds allow; else None. Nothing improves it by more than the accuracy of solves."""
    slopes = np.array(objective_gradients(nlp)(z)).reshape(-1, len(z))[i]
    (own,) = np.nonzero(slopes)
    least = np.where(nlp.period > 0, np.inf, np.where(slopes > 0, nlp.lower, nlp.upper))[own]
    attained = float(np.abs(slopes[own]) @ np.abs(z[own] - least)) <= END.clearly * nlp_scales(nlp)[i] and linear_objectives(nlp)[i]
    return dict(zip(own.tolist(), least.tolist(), strict=True)) if attained else None


def held_at_bounds(nlp: NLP, z: np.ndarray, task: Scalarised) -> Scalarised:
    """A task without the ceilings that are the least that bounds allow, which a vector (n,) attains: nothing is strictly inside of them, so
    the variables of their objectives are held instead."""
    assert task.ceiling is not None
    found = {i: held for i in np.flatnonzero(task.ceiling < np.inf).tolist() if (held := at_bounds(nlp, z, i)) is not None}
    ceiling = np.where(np.isin(np.arange(len(task.ceiling)), [*found]), np.inf, task.ceiling)
    return replace(task, ceiling=ceiling, held={k: value for held in found.values() for k, value in held.items()})


WEAK = "it may be improved in other objectives without a loss in its own: no solve for these converged"
"""Message of an end."""


Solve = Callable[[np.ndarray, Scalarised, bool], Solved]
"""The result of a solve from a vector (n,), or near it only."""


def without_loss(
    solve: Solve, nlp: NLP, tolerance: float, end: Solved, task: Scalarised, slack: np.ndarray, others: Sequence[np.ndarray] = ()
) -> Solved:
    """The least value of a task under a ceiling (m,) that an end attains; also from other vectors (n,), which may lie in better valleys.

    Often the end alone attains it: nothing is strictly inside then, and a solve takes long without improving anything. So there is `slack`
    (m,) first. If multipliers explain the gain, the end stays. Otherwise a solve without slack follows; however that ends, it counts if it
    is feasible and lacks little but what the slack is worth. If it does not, what the slack loses counts as nothing. Where the ceiling is
    the least that bounds allow, there is none of this: see `held_at_bounds`.
    """
    task = held_at_bounds(nlp, end.z, task)
    assert task.ceiling is not None
    limited, freer = task.ceiling < np.inf, replace(task, ceiling=task.ceiling + slack)
    best = solve(end.z, freer, bool(limited.any()))
    if best.status != CONVERGED:  # where nothing is limited, it may be on its way to another valley
        best = solve(end.z if limited.any() else best.z, freer, False)
    if best.status != CONVERGED:
        return replace(end, message=WEAK)
    explained = float(np.max(slack[task.moving] / task.weights[task.moving]))
    if best.multipliers is not None:
        # They are slopes; the root of a slack is twice that.
        worth = best.multipliers.of_objectives
        rate = float(worth[limited] @ slack[limited]) / float(worth[task.moving] @ task.weights[task.moving])
        explained = max(explained, 2 * (1 + END.unsure) * rate)
    gain = task.alpha(end.F) - task.alpha(best.F)
    if gain <= explained:
        return end
    best = min([best, *(solve(other, freer, False) for other in others)], key=task.rank)
    if not limited.any():
        return best
    exact = solve(best.z, task, True)
    if exact.status != CONVERGED and exact.violation <= END.close and task.alpha(exact.F) < task.alpha(end.F) - 0.1 * gain:
        exact = solve(exact.z, task, True)  # much was gained before the iterations ran out
    if exact.status != CONVERGED:
        kept = exact.violation <= tolerance and bool((task.ceiling + 1e-3 * slack >= exact.F).all())
        if not (kept and task.alpha(exact.F) <= task.alpha(best.F) + max(explained, 0.1 * gain)):
            return best
        exact = replace(exact, status=CONVERGED)
    return exact if task.alpha(exact.F) < task.alpha(end.F) else end


def strongly_optimal(solve: Solve, nlp: NLP, tolerance: float, point: Solved, weights: np.ndarray, ranges: np.ndarray) -> Solved:
    """A point, or a better one: a point that is optimal with a positive weight (m,) on every objective is Pareto optimal; of another, the
    objectives without weight are minimised once, the others kept. ranges (m,)."""
    sizes = weights * ranges
    left = (sizes <= END.weightless * sizes.sum()) & (ranges > 0)
    if not left.any() or left.all():
        return point
    task = Scalarised(np.where(left, point.F, np.inf), ranges, np.where(left, np.inf, point.F))
    found = without_loss(solve, nlp, tolerance, point, task, END.slack * ranges)
    return found if found.message != WEAK else point


@dataclass(frozen=True, eq=False)
class LexicographicEnd(Scalarised):
    """A lexicographic optimum on another mesh: the least value of one objective, and subject to it the least values of the others."""

    # (m,): Objectives of the end on the mesh before. Many points may have the least value of the one objective, such as its bound: one with
    # the others near these is preferred.
    known: np.ndarray | None = None

    @classmethod
    def of(cls, i: int, units: np.ndarray, known: np.ndarray) -> LexicographicEnd:
        """That of objective i. units, known (m,)."""
        return cls(np.where(np.arange(len(units)) == i, 0.0, np.inf), units, None, units, known=known)

    @property
    def used(self) -> np.ndarray:
        """See `Scalarised.used`."""
        return np.ones(len(self.weights), dtype=bool)

    @property
    def sharp(self) -> np.ndarray:
        """See `Scalarised.sharp`: where the front is steep, the others are determined by the root of an error of the first."""
        return self.moving

    def solve(self, solves: GradientSolves, nlp: NLP, start: np.ndarray, near: bool = False, warm: Multipliers | None = None) -> Solved:
        """See `Scalarised.solve`."""
        mine, units = self.moving, self.weights
        alone = Scalarised(self.reference, units)
        assert self.known is not None
        if len(units) > 1 and at_bounds(nlp, start, int(np.argmax(mine))) is not None:
            found = self._others(solves, nlp, start, self.known, start, near)
            if found.status == CONVERGED:
                return replace(found, multipliers=None)  # at its bound, the one objective is at its least
        first = solves(nlp, start, alone, near)
        if len(units) == 1:
            return first
        ceiling = np.where(mine, np.inf, self.known + END.room * units)
        if not stopping() and (first.status != CONVERGED or (ceiling < first.F).any()):
            held = solves(nlp, start, replace(alone, ceiling=ceiling), near)
            if held.status == CONVERGED and (first.status != CONVERGED or self.loss(held.F) <= self.loss(first.F) + END.tied):
                first = held
        if first.status != CONVERGED:
            return first
        # No slack: where the front is steep, a small loss in one objective changes another by its square root.
        # The first solve does not look at the other objectives, and often leaves a start that was nearly the end.
        (F,), (violation,) = nlp.evaluate(start[None])
        closer = violation <= END.close and bool((first.F >= F).all())
        second = self._others(solves, nlp, first.z, first.F, start if closer else first.z, near)
        # What tells whether the one objective is at its least are the multipliers for that alone.
        return replace(second, multipliers=first.multipliers) if second.status == CONVERGED else first

    def _others(self, solves: GradientSolves, nlp: NLP, z: np.ndarray, F: np.ndarray, start: np.ndarray, near: bool) -> Solved:
        """The least values of the others, measured from F (m,), where a vector (n,) has the least of the one."""
        mine = self.moving
        task = held_at_bounds(nlp, z, Scalarised(np.where(mine, np.inf, F), self.weights, np.where(mine, F, np.inf)))
        with solves.at_most(END.ties):
            return solves(nlp, start, task, near)


MOST_ITERATIONS = 500
"""Iterations of IPOPT after which a strategy of a solve is given up by default."""


@dataclass(frozen=True)
class WorkLimits:
    """Limits on work, as `Counts.work`: iterations times variables, so that no clock decides."""

    building: float = 30.0  # iterations that take as long as it takes to make a program with its derivatives: measured 18 to 53
    little: float = 6e5  # what other starts may always take together: a second or two
    most: float = 1.5e6  # after which no mesh of an optimum is begun, once one is found: some half a minute, more for large programs

    @property
    def search(self) -> float:
        """After which no round of a search begins, and no polish goes on but for one solve for each point."""
        return 2 * self.most


WORK = WorkLimits()


def scalarized(nlp: NLP, start: np.ndarray, settings: Mapping[str, Any]) -> Solved:
    """One piece of `GradientSolves.each`; see `scalarize`."""
    return scalarize(nlp, start, **settings)


class GradientSolves:
    """Gradient solves with one tolerance, which are counted."""

    def __init__(self, tolerance: float, max_iterations: int = MOST_ITERATIONS) -> None:
        self.tolerance, self.max_iterations = tolerance, max_iterations
        self.counts, self._persistent, self._most_work = Counts(), True, np.inf
        self.before: Callable[[], None] = lambda: None

    def __call__(self, nlp: NLP, start: np.ndarray, task: Scalarised, near: bool = False, warm: Multipliers | None = None) -> Solved:
        """The result of one solve from a vector (n,), or near it only, with multipliers to begin with; see `scalarize`."""
        return self.each(nlp, [(start, task)], near, warm=warm)[0]

    def each(
        self,
        nlp: NLP,
        begun: Sequence[tuple[np.ndarray, Scalarised]],
        near: bool = False,
        warm: Multipliers | None = None,
    ) -> list[Solved]:
        """The results of independent solves, each from a vector (n,), side by side where there are processes (`io.workers`)."""
        self.before()
        if self._most_work <= self.counts.work:
            return [replace(not_begun(nlp, start), status=FAILED, clocked=False) for start, _ in begun]
        iterations = max(1, int(min(self.max_iterations, (self._most_work - self.counts.work) / len(nlp.variables))))
        persistent = self._persistent and iterations == self.max_iterations
        limits: dict[str, Any] = {"tolerance": self.tolerance, "max_iterations": iterations, "persistent": persistent}
        settings = {"near": near, "warm": warm, **limits}
        pieces = [(task.begun(one), task.stated | settings) for one, task in begun]
        return [self._counted(nlp, solved) for solved in each(scalarized, nlp, pieces)]

    def least_violation(self, nlp: NLP, start: np.ndarray) -> Solved:
        """A feasible or least violating vector near a vector (n,); see `least_violation`."""
        self.before()
        return self._counted(nlp, least_violation(nlp, start, tolerance=self.tolerance))

    def _counted(self, nlp: NLP, solved: Solved) -> Solved:
        charge = solves_charge(nlp, int(solved.begun), solved.iterations)
        self.counts.add_solves(int(solved.begun), [solved.status], solved.iterations, solved.clocked, len(nlp.variables), charge)
        return solved

    @contextmanager
    def within(self, work: float) -> Iterator[None]:
        """Context in which solves end when together they have taken so much work."""
        usual, self._most_work = self._most_work, min(self._most_work, self.counts.work + work)
        try:
            yield
        finally:
            self._most_work = usual

    @contextmanager
    def at_most(self, iterations: int) -> Iterator[None]:
        """Context in which solves take at most these iterations, of which the first strategy may take all."""
        usual = self.max_iterations
        self.max_iterations, self._persistent = min(usual, iterations), False
        try:
            yield
        finally:
            self.max_iterations, self._persistent = usual, True


@dataclass(frozen=True, eq=False)
class Start:
    """A vector z (n,) at which a solve begins, whether the solve stays near it, the loss that its result may have, and its multipliers."""

    z: np.ndarray
    near: bool = False
    drift: float = 0.0
    warm: Multipliers | None = None


def best_of(task: Scalarised, solves: GradientSolves, nlp: NLP, starts: Iterable[Start], bound: float = -np.inf) -> Solved:
    """The best result of solves from starts in turn, until one loses no more than its start may, compared with a bound."""
    best: Solved | None = None
    for start in starts:
        solved = task.solve(solves, nlp, start.z, start.near, start.warm)
        if best is None or task.rank(solved) < task.rank(best):
            best = solved
        if stopping() or (best.status == CONVERGED and task.loss(best.F) <= bound + start.drift):
            break
    assert best is not None
    return best
