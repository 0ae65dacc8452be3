"""Evaluation of the agents' proposals: a proposal is evaluated, and its agent moves there if it is better."""

from __future__ import annotations

import numpy as np

from ..evaluation.evaluator import Evaluation, Evaluator
from ..pareto.directions import tchebycheff
from ..pareto.dominance import constrained_dominates
from .effort import Gains, evaluated
from .rounds import PLANNED
from .settings import Settings
from .state import NO_DIRECTION, SearchState

CREDIT = 0.5
"""Least fraction of a proposed step that the inner level must leave, for the success to expand the radius."""


class Trials:
    """Evaluates proposals within the budget, during one phase of an iteration, and records all results. credited (n,), gained (n,), tried
    (n,)."""

    def __init__(self, settings: Settings, state: SearchState, evaluator: Evaluator, budget: int) -> None:
        self.settings, self.state, self.evaluator, self.budget = settings, state, evaluator, budget
        self.box = evaluator.box
        self.planned = budget if state.rounds is None else PLANNED
        self.seen: list[Evaluation] = []
        self._gains = Gains(state, evaluator.tolerance)
        self._every = settings.polish_every if settings.refines and evaluator.has_gradients else None
        self.credited = np.zeros(len(state.agents), dtype=bool)
        self.gained, self.tried = np.zeros(len(state.agents)), np.zeros(len(state.agents), dtype=int)

    def positions(self, rows: np.ndarray | None = None) -> np.ndarray:
        """Unit coordinates (k, d) of the agents `rows`, or of all agents."""
        Z = self.state.agents.Z if rows is None else self.state.agents.Z[rows]
        return self.box.to_unit(Z[:, self.evaluator.free])

    def evaluate(self, Z: np.ndarray, X: np.ndarray, trial: np.ndarray) -> tuple[np.ndarray, Evaluation | None]:
        """Evaluate the proposals `trial` (k, d), made from full vectors Z (k, D) with unit coordinates X (k, d); no agent moves. Returns
        (j,)."""
        moved = np.flatnonzero((trial != X).any(axis=1))[: max(self.budget - self.state.evaluations, 0)]
        if not moved.size:
            return moved, None
        X, trial, free = X[moved], trial[moved], self.evaluator.free
        Z = Z[moved]
        Z[:, free] = np.where(trial != X, self.box.to_values(trial), Z[:, free])
        result = evaluated(self.state, self.evaluator, Z, self._gains, self._every)
        self.state.evaluations = self.evaluator.counts.evaluations
        self.seen.append(result)
        return moved, result

    def evaluate_and_accept(self, rows: np.ndarray, X: np.ndarray, trial: np.ndarray, velocity: bool = True) -> np.ndarray:
        """Evaluate the proposals `trial` (k, d) of the agents `rows` at X (k, d), and move the agents with success.

        A success is dominance over the agent, or a better value for its direction. Velocities and experience use the displacements after
        the inner level, not the proposed ones. Without `velocity`, an agent with success is left at rest. Returns (k,).
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
        self.credited[rows] |= better & ((proposed * achieved).sum(axis=1) >= CREDIT * (proposed**2).sum(axis=1))
        last = self.settings.momentum * agents.velocity[rows[better]]
        agents.velocity[rows[better]] = achieved[better] + last if velocity else 0.0
        agents.place(rows[better], result.Z[better], result.F[better], result.violation[better])
        self.state.experience = np.vstack([self.state.experience, achieved[improved]])[-self.settings.memory :]
        success[moved] = better
        return success

    def _improvement(self, rows: np.ndarray, result: Evaluation) -> np.ndarray:
        """By how much each of these results (k,) improves its agent, which it dominates: the mean over the objectives, in ranges of the
        front, each at most 1. Of an infeasible agent it is the part of the violation that is gone."""
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
