"""What becomes of a proposal: it is evaluated, and the agent that made it moves there if it is better."""

from __future__ import annotations

import numpy as np

from ..evaluation.box import Box
from ..evaluation.evaluator import Evaluation, Evaluator
from ..pareto.directions import tchebycheff
from ..pareto.dominance import constrained_dominates
from .settings import Settings
from .state import NO_DIRECTION, SearchState

CREDIT = 0.5
"""Least part of a proposed step that must have been achieved for the radius to take it as its own success."""


class Trials:
    """The one door between proposals and the evaluator, for the length of one phase of an iteration.

    Attributes
    ----------
    seen : list of Evaluation
        All that was evaluated.
    credited : array (n,) of bool
        Which agents had a success that their own step brought about, not the inner level that moved the candidate elsewhere.
    """

    def __init__(self, settings: Settings, state: SearchState, evaluator: Evaluator, box: Box, budget: int) -> None:
        self.settings, self.state, self.evaluator, self.box, self.budget = settings, state, evaluator, box, budget
        self.seen: list[Evaluation] = []
        self.credited = np.zeros(len(state.agents), dtype=bool)

    def positions(self, rows: np.ndarray | None = None) -> np.ndarray:
        """Unit coordinates (k, d) of the agents `rows`, or of all."""
        Z = self.state.agents.Z if rows is None else self.state.agents.Z[rows]
        return self.box.to_unit(Z[:, self.evaluator.free])

    def evaluate(self, Z: np.ndarray, X: np.ndarray, trial: np.ndarray) -> tuple[np.ndarray, Evaluation | None]:
        """Evaluate the proposals `trial` (k, d) made from the full vectors Z (k, D), at X (k, d), and move nobody.

        Returns
        -------
        array (j,) of int
            Which of the k were evaluated: those that moved, as far as the budget goes.
        Evaluation or None
            What came of these; None if there were none.
        """
        moved = np.flatnonzero((trial != X).any(axis=1))[: max(self.budget - self.state.evaluations, 0)]
        if not moved.size:
            return moved, None
        X, trial, free = X[moved], trial[moved], self.evaluator.free
        Z = Z[moved]
        Z[:, free] = np.where(trial != X, self.box.to_values(trial), Z[:, free])
        result = self.evaluator.evaluate(Z)
        self.state.evaluations = self.evaluator.counts.evaluations
        self.seen.append(result)
        return moved, result

    def evaluate_and_accept(self, rows: np.ndarray, X: np.ndarray, trial: np.ndarray, velocity: bool = True) -> np.ndarray:
        """Evaluate the proposals `trial` (k, d) of the agents `rows`, at X (k, d); put those that had success there.

        The velocity of these, and the experience of all, are made of the displacements that came back, not of those that were proposed.
        Without `velocity` a success leaves its agent at rest.

        Returns
        -------
        array (k,) of bool
            Who had success. A proposal that did not move, or for which no budget is left, is not evaluated and has none.
        """
        success = np.zeros(len(rows), dtype=bool)
        moved, result = self.evaluate(self.state.agents.Z[rows], X, trial)
        if result is None:
            return success
        rows, X, trial = rows[moved], X[moved], trial[moved]
        agents, free = self.state.agents, self.evaluator.free
        improved = constrained_dominates(result.F, result.violation, agents.F[rows], agents.violation[rows], self.evaluator.tolerance)
        better = improved | self._serves_direction(rows, result)
        proposed = self.box.difference(trial, X)
        achieved = self.box.difference(self.box.to_unit(result.Z[:, free]), X)
        self.credited[rows] |= better & ((proposed * achieved).sum(axis=1) >= CREDIT * (proposed**2).sum(axis=1))
        last = self.settings.momentum * agents.velocity[rows[better]]
        agents.velocity[rows[better]] = achieved[better] + last if velocity else 0.0
        agents.place(rows[better], result.Z[better], result.F[better], result.violation[better])
        self.state.experience = np.vstack([self.state.experience, achieved[improved]])[-self.settings.memory :]
        success[moved] = better
        return success

    def _serves_direction(self, rows: np.ndarray, result: Evaluation) -> np.ndarray:
        """Which results (k,), of feasible agents and feasible themselves, are better for the direction that the agent owns."""
        agents, state, tolerance = self.state.agents, self.state, self.evaluator.tolerance
        owns = agents.direction[rows] != NO_DIRECTION
        feasible = (result.violation <= tolerance) & (agents.violation[rows] <= tolerance)
        weights = state.directions[agents.direction[rows]]
        now = tchebycheff(result.F, weights, state.ideal, state.nadir)
        return owns & feasible & (now < tchebycheff(agents.F[rows], weights, state.ideal, state.nadir))
