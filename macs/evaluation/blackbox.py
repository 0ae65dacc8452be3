"""Evaluator of a black box: a vector problem, whether stated by name or made of a plain function."""

from __future__ import annotations

import numpy as np

from problems.compiled import Objective
from problems.vector import CompiledVectorProblem

from .evaluator import CONVERGED, FAILED, INFEASIBLE, Counts, Evaluation, Evaluator
from .plain import default_goals, learned


class BlackBox(Evaluator):
    """Evaluator of a vector problem.

    Parameters
    ----------
    problem : CompiledVectorProblem
    tolerance : float, default 1e-6
        A point none of whose violations exceeds this is feasible.

    Notes
    -----
    The number of objectives `m` is known from the problem, or from the first batch. Reading `m` before that costs one evaluation, of the
    centre of the box, which is counted.

    Raises
    ------
    ValueError
        If the tolerance is no number, or the result of a function has the wrong type or shape; the message names it.
    """

    def __init__(self, problem: CompiledVectorProblem, tolerance: float = 1e-6) -> None:
        if not (isinstance(tolerance, int | float) and 0 <= tolerance < np.inf):
            raise ValueError(f"tolerance: must be a number >= 0, not {tolerance!r}")
        self.problem, self.tolerance = problem, float(tolerance)
        self.m_known: int | None = len(problem.goals) or None
        self.lower, self.upper = (np.array([getattr(v, side) for v in problem.variables]) for side in ("lower", "upper"))
        self.period = np.array([v.period or 0.0 for v in problem.variables])
        self.free = np.arange(len(problem.variables))
        self.counts = Counts()

    @property
    def m(self) -> int:
        """Number of objectives; see the notes of the class."""
        if self.m_known is None:
            self.evaluate((self.lower + self.upper)[None] / 2)
        assert self.m_known is not None
        return self.m_known

    @property
    def sizes(self) -> dict[str, int]:
        """See `Evaluator.sizes`; the number of objectives is compared by `resume`, whose error says where it is from."""
        return {"d": len(self.free), "D": len(self.free)}

    @property
    def goals(self) -> tuple[Objective, ...]:
        """See `Evaluator.goals`."""
        return self.problem.goals or default_goals(self.m)

    def resume(self, counts: Counts, m: int) -> None:
        """See `Evaluator.resume`. Raises ValueError if the function has another number of objectives."""
        super().resume(counts, m)
        self.m_known = learned(self.m_known, m, f"the checkpoint has {m}")

    def first_guess(self, candidates: np.ndarray) -> np.ndarray:
        """The candidates (k, d) themselves: all variables of a black box are free."""
        return np.array(candidates, dtype=float)

    def _values(self, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `CompiledVectorProblem.evaluate`."""
        return self.problem.evaluate(Z)

    def _evaluate(self, Z: np.ndarray, way: int | None = None) -> tuple[Evaluation, int]:
        F, residuals = self._values(Z)
        self.m_known = learned(self.m_known, F.shape[1], f"function returned {F.shape[1]}")
        violation = np.abs(residuals).max(axis=1, initial=0.0)
        failed = ~(np.isfinite(F).all(axis=1) & np.isfinite(violation))
        F[failed], violation[failed] = np.nan, np.inf
        status = np.where(failed, FAILED, np.where(violation <= self.tolerance, CONVERGED, INFEASIBLE))
        return Evaluation(Z=Z.copy(), F=F, violation=violation, status=status, residuals=residuals), 0
