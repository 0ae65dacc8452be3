"""Evaluation of proposals: which inner solver each goes to, and whether its agent moves there.

The value of an inner solver differs from problem to problem, and during a search: where the ends of trajectories are free, propagation
finds a front quickly; where they are fixed, no propagated candidate is feasible. So most proposals go to the inner solver with the largest
gain for its work, and a few to the others. Gradient solves compete, too: where they gain most, proposals are only propagated, as starts of
the solves. Work is counted, not timed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..evaluation.evaluator import Evaluation, Evaluator
from ..pareto.directions import tchebycheff
from ..pareto.dominance import constrained_dominates
from .rounds import PLANNED_EVALUATIONS
from .settings import Settings
from .state import KEPT_IMPROVEMENTS, NO_DIRECTION, Credit, SearchState

STEP_KEPT = 0.5
"""Least fraction of a proposed step that the inner level must leave, for the success to expand the radius."""
WORK, EVALUATIONS, FEASIBLE = range(3)
"""Columns of `SearchState.spent`."""


@dataclass(frozen=True)
class InnerShares:
    """Shares of the inner solvers that do not gain most (measured on the catalogue's problems)."""

    cheaper: float = 0.1  # least share of all evaluations of one that takes less work than that which brings most
    dearer: float = 0.15  # share of all work, with the gradient solves to come, of those that take more
    least: float = 0.03  # least share of each of these
    compiling: int = 300  # iterations that take as long as to build the functions of one: it is tried when its share is worth as much
    solve: int = 50  # iterations of a gradient solve, about: they are measured once one was made


INNER_SHARES = InnerShares()


def initial_credit(evaluator: Evaluator, variables: int, gradients: bool) -> tuple[Credit, np.ndarray]:
    """Credit and costs of the inner solvers and of gradient solves; each has the credit of a whole front until it is tried. Without
    gradients there is no choice: propagated candidates would never be made feasible."""
    rows = len(evaluator.ways) + 1 if gradients and evaluator.ways else 0
    credit = Credit(np.zeros(rows), np.zeros(rows))
    credit.gained[-1:], credit.cost[-1:] = 1.0, INNER_SHARES.solve * variables
    return credit, np.zeros((rows, 3))


def choose_inner_solvers(credit: Credit, spent: np.ndarray, count: int, every: int | None, compiling: float = 0.0) -> np.ndarray:
    """The inner solver (count,) of each of the next proposals: the one with the largest gain for its work; the first where gradient solves
    gain most, one of which is made for `every` evaluations in the end; or those below their shares."""
    rate, ways = credit.rates(), spent[:-1]
    main = int(np.argmax(rate)) % len(ways)
    evaluations = ways[:, EVALUATIONS].sum()
    for way in range(main):
        if ways[way, EVALUATIONS] <= INNER_SHARES.cheaper * evaluations:
            return np.full(count, way)
    solving, solves = spent[-1, [WORK, EVALUATIONS]]
    each_solve = solving / solves if solves else credit.cost[-1]
    ahead = 0.0 if every is None else max(0.0, evaluations / every - solves) * each_solve
    chosen, free = np.full(count, main), count
    dearer = np.arange(main + 1, len(ways))
    shares = np.full(len(dearer), INNER_SHARES.least)
    if len(dearer):
        shares[np.argmax(rate[dearer])] = INNER_SHARES.dearer - INNER_SHARES.least * (len(dearer) - 1)
    for way, share in zip(dearer.tolist(), shares.tolist(), strict=True):
        left = share * (spent[:, WORK].sum() + ahead) - ways[way, WORK]
        each = ways[way, WORK] / max(ways[way, EVALUATIONS], 1.0)
        some = min(free, max(int(left / each), 0) if each else int(left >= compiling))
        chosen[free - some : free] = way
        free -= some
    return chosen


def give_credit(state: SearchState, way: int, gained: float, work: int, count: int, feasible: int = 0) -> None:
    """Credit an inner solver, or gradient solves (-1), for the gain of `count` evaluations or solves."""
    if len(state.spent):
        one = np.zeros(len(state.spent))
        one[way] = 1.0
        state.inner.add(gained * one, work * one)
        state.spent[way] += work, count, feasible


class Gains:
    """Gains of points: the mean improvement of the best values of a front's directions, in units of the way from the ideal point to the
    nadir; zero as long as there is no front."""

    def __init__(self, state: SearchState, tolerance: float) -> None:
        self._directions, self._tolerance = state.directions, tolerance
        self._ideal, self._nadir = state.ideal, state.nadir
        self._front = state.archive.F
        self._best: np.ndarray | None = None  # best values, computed when they are needed

    def of(self, seen: Evaluation) -> float:
        """The gain of these points, which then count as known."""
        F = seen.F[seen.violation <= self._tolerance]
        if not len(self._front) or not len(F):
            return 0.0
        if self._best is None:
            self._best = self._values(self._front)
        values = np.minimum(self._values(F), self._best)
        brought = float(np.mean(np.minimum(self._best - values, 1.0)))
        self._best = values
        return brought

    def _values(self, F: np.ndarray) -> np.ndarray:
        return tchebycheff(F[:, None], self._directions, self._ideal, self._nadir).min(axis=0)


class Trials:
    """Evaluates proposals within the budget, during one phase of an iteration, and records all results."""

    def __init__(self, settings: Settings, state: SearchState, evaluator: Evaluator, budget: int) -> None:
        self.settings, self.state, self.evaluator, self.budget = settings, state, evaluator, budget
        self.box = evaluator.box
        self.planned = budget if state.rounds is None else PLANNED_EVALUATIONS
        self.seen: list[Evaluation] = []
        self._gains = Gains(state, evaluator.tolerance)
        n = len(state.agents)
        self.successful = np.zeros(n, dtype=bool)  # (n,): agents with a success that kept most of the step
        self.gained, self.tried = np.zeros(n), np.zeros(n, dtype=int)  # (n,): improvements of agents, and their evaluations

    def positions(self, rows: np.ndarray | None = None) -> np.ndarray:
        """Unit coordinates (k, d) of the agents `rows`, or of all agents."""
        Z = self.state.agents.Z if rows is None else self.state.agents.Z[rows]
        return self.box.to_unit(Z[:, self.evaluator.free])

    def evaluate(self, Z: np.ndarray, X: np.ndarray, trial: np.ndarray) -> tuple[np.ndarray, Evaluation | None]:
        """Evaluate those proposals (k, d) that differ from X (k, d), the unit coordinates of the full vectors Z (k, D) they come from,
        within the budget; no agent moves. Returns their rows (j,), and the results. Changes proposals: to whole numbers where they are
        meant, and where a design is known to one nearby that is not."""
        new = self._settle(trial) & (trial != X).any(axis=1)
        moved = np.flatnonzero(new)[: max(self.budget - self.state.evaluations, 0)]
        if not moved.size:
            return moved, None
        X, trial, free = X[moved], trial[moved], self.evaluator.free
        Z = Z[moved]
        Z[:, free] = np.where(trial != X, self.box.to_values(trial), Z[:, free])
        result = self._evaluated(Z)
        self.state.evaluations = self.evaluator.counts.evaluations
        self.seen.append(result)
        return moved, result

    def _settle(self, trial: np.ndarray) -> np.ndarray:
        """Which of the proposals (k, d), changed in place, are to be evaluated, as far as that depends on whole numbers."""
        box, rng, tried = self.box, self.state.rng, set[bytes]()
        trial[:] = box.settle(trial, rng)
        new = np.ones(len(trial), dtype=bool)

        def fresh(points: np.ndarray) -> np.ndarray:
            values = box.to_values(points)
            return ~self.evaluator.knows(values) & [row.tobytes() not in tried for row in values]

        for i in range(0 if np.isinf(box.designs) else len(trial)):
            first, reach = trial[i].copy(), 1
            while not fresh(trial[i : i + 1])[0] and reach < 2 * box.span.max():
                near = box.neighbours(np.tile(first, (3 * len(first), 1)), reach, rng)
                trial[i], reach = near[np.argmax(fresh(near))], 2 * reach
            new[i] = fresh(trial[i : i + 1])[0]
            if not new[i] and box.designs <= 10_000:  # all around are known: any other
                left = np.indices(tuple((box.span + 1.0).astype(int).tolist())).reshape(len(first), -1).T / box.span
                left = left[fresh(left)]
                new[i] = len(left) > 0
                trial[i] = rng.choice(left) if new[i] else first
            tried.add(box.to_values(trial[i]).tobytes())
        return new

    def _evaluated(self, Z: np.ndarray) -> Evaluation:
        """The evaluation of full vectors (k, D), each by the presently best inner solver. As long as nothing is feasible, and without
        gradients, all go to the evaluator's own."""
        state, counts = self.state, self.evaluator.counts
        if not len(state.spent) or not len(state.archive):
            return self.evaluator.evaluate(Z)
        every = self.settings.polish_every if self.settings.refines else None
        chosen = choose_inner_solvers(state.inner, state.spent, len(Z), every, INNER_SHARES.compiling * Z.shape[1])
        parts = []
        for way in np.unique(chosen).tolist():
            before = counts.work
            parts.append(self.evaluator.evaluate(Z[chosen == way], way))
            feasible = int(np.count_nonzero(parts[-1].violation <= self.evaluator.tolerance))
            give_credit(state, way, self._gains.of(parts[-1]), counts.work - before, len(parts[-1].F), feasible)
        if len(parts) == 1:
            return parts[0]
        whole = parts[0]
        for part in parts[1:]:
            whole = whole.joined(part)
        return whole.take(np.argsort(np.argsort(chosen, kind="stable"), kind="stable"))

    def evaluate_and_accept(self, rows: np.ndarray, X: np.ndarray, trial: np.ndarray, scan: bool = False) -> np.ndarray:
        """Evaluate the proposals (k, d) of the agents `rows` at X (k, d), move the agents with success, and return the mask (k,) of these.

        A success is dominance over the agent, or a better value for its direction. Velocities and experience use the displacements after
        the inner level, not the proposed ones. Without momentum, only a success of pattern search, a `scan`, leaves the agent with a
        velocity.
        """
        success = np.zeros(len(rows), dtype=bool)
        moved, result = self.evaluate(self.state.agents.Z[rows], X, trial)
        if result is None:
            return success
        rows, X, trial = rows[moved], X[moved], trial[moved]
        agents, free = self.state.agents, self.evaluator.free
        improved = constrained_dominates(result.F, result.violation, agents.F[rows], agents.violation[rows], self.evaluator.tolerance)
        better = improved | self._serves_direction(rows, result)
        self.tried[rows] += 1
        self.gained[rows[improved]] += self._improvement(rows[improved], result.take(np.flatnonzero(improved)))
        proposed = self.box.difference(trial, X)
        achieved = self.box.difference(self.box.to_unit(result.Z[:, free]), X)
        self.successful[rows] |= better & ((proposed * achieved).sum(axis=1) >= STEP_KEPT * (proposed**2).sum(axis=1))
        momentum, moving = self.settings.variant.momentum, rows[better]
        agents.velocity[moving] = achieved[better] + momentum * agents.velocity[moving] if momentum or scan else 0.0
        self.state.experience = np.vstack([self.state.experience, achieved[improved]])[-KEPT_IMPROVEMENTS:]
        agents.place(rows[better], result.Z[better], result.F[better], result.violation[better])
        success[moved] = better
        return success

    def _improvement(self, rows: np.ndarray, result: Evaluation) -> np.ndarray:
        """The improvement (k,) of each agent by the result that dominates it: the mean over the objectives, in ranges of the front, each at
        most 1. For an infeasible agent, it is the fraction by which the violation falls."""
        state, tolerance = self.state, self.evaluator.tolerance
        F, violation = state.agents.F[rows], state.agents.violation[rows]
        span = np.where(state.nadir > state.ideal, state.nadir - state.ideal, 1.0)
        nearer = np.clip((F - result.F) / span, 0.0, 1.0).mean(axis=1)
        infeasible, left = violation > tolerance, np.where(result.violation > tolerance, result.violation, 0.0)
        return np.where(infeasible, 1.0 - np.divide(left, violation, out=np.zeros(len(rows)), where=infeasible), nearer)

    def _serves_direction(self, rows: np.ndarray, result: Evaluation) -> np.ndarray:
        """Mask (k,) of the feasible results that are better than their feasible agents in the sub-problem of the agents' directions."""
        agents, state, tolerance = self.state.agents, self.state, self.evaluator.tolerance
        owns = agents.direction[rows] != NO_DIRECTION
        feasible = (result.violation <= tolerance) & (agents.violation[rows] <= tolerance)
        weights = state.directions[agents.direction[rows]]
        now = tchebycheff(result.F, weights, state.ideal, state.nadir)
        return owns & feasible & (now < tchebycheff(agents.F[rows], weights, state.ideal, state.nadir))
