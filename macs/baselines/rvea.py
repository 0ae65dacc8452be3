"""RVEA: one individual for each reference vector, by distance and by an angle that counts more and more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..evaluation.evaluator import Evaluator
from .directed import Directed
from .population import Members, State
from .pymoo_adapter import variation


@dataclass(repr=False)
class GuidedState(State):
    """State of RVEA. All in objectives as presented to the algorithm."""

    SHAPES: ClassVar[dict[str, str]] = {"vectors": "k presented", "ideal": "presented", "nadir": "presented"}

    vectors: np.ndarray  # (k, m): Reference vectors of length 1, as they were last adapted
    ideal: np.ndarray  # (m,): Best value of each objective so far among feasible points; infinite before the second generation
    nadir: np.ndarray  # (m,): Worst value of each objective among the feasible members; infinite before the second generation


@dataclass(frozen=True)
class RVEA(Directed):
    """RVEA (Cheng, Jin, Olhofer and Sendhoff 2016), pymoo's implementation; see `Baseline`. For two or more objectives.

    For each reference vector, at most one feasible individual survives, so that the population is often smaller than the number of
    offspring: the one with the least distance from the ideal point, times a factor that grows with the angle from the vector, and with the
    progress of the run. At times the vectors are adapted to the ranges of the objectives.

    Progress is measured in generations: those done, as a fraction of those that the budget has room for, the last one included if it is
    partial. With a budget of n populations the result is that of pymoo for ("n_gen", n). It is also that for ("n_eval", (n + 1)
    populations), since pymoo ends such a run one generation early. A run that goes on from a checkpoint has the same budget, and so the
    same progress; one with another budget is another search.

    Vectors are not adapted to members that all have the same value of an objective; in pymoo the vectors then have no numbers any more, and
    all members but one are lost.

    Parameters
    ----------
    population : int, optional
        Number of individuals of the first population, and of offspring in a generation. Without `divisions`, also the number of reference
        vectors, not less than that of objectives: a simplex lattice, if one has so many, and evenly spread otherwise. Default: the number
        of vectors.
    divisions : int, optional
        Divisions of the simplex lattice (Das and Dennis 1998) of reference vectors. With `population`, there may be fewer vectors than
        offspring, but at least half as many. Default: the finest lattice with at most 100 vectors (2 objectives: 100, 3: 91).
    alpha : float, default 2
        Exponent of the progress in the factor, at least 0: with a larger one the angle counts later.
    adapt_every : float, default 0.1
        Fraction of the generations after which the vectors are adapted again, in (0, 1]; 1 is never.
    crossover : float, default 1
        Probability of simulated binary crossover, in [0, 1].
    crossover_eta, mutation_eta : float, default 30 and 20
        Distribution indices of crossover and of polynomial mutation, in [1, 100]; a higher index puts children nearer to their parents.
    handling, penalty, degree
        As for `NSGA2`. With "objective", the vectors have one objective more.

    Raises
    ------
    ValueError
        If a setting is outside its range or, once the number of objectives is known, if population and vectors do not match.

    Examples
    --------
    >>> import numpy as np
    >>> from macs import RVEA
    >>> schaffer = lambda X: np.hstack([X**2, (X - 2) ** 2])
    >>> front = RVEA(population=20).minimize(schaffer, [(-10, 10)], evaluations=200, seed=1)
    >>> front.objectives.shape[1]
    2
    """

    population: int | None = None
    divisions: int | None = None
    alpha: float = 2.0
    adapt_every: float = 0.1
    crossover: float = 1.0
    crossover_eta: float = 30.0
    mutation_eta: float = 20.0
    handling: str = "feasible-first"
    penalty: float = 1000.0
    degree: str = "largest"

    def __post_init__(self) -> None:
        operators = {"crossover": "[0, 1]", "crossover_eta": "[1, 100]", "mutation_eta": "[1, 100]"}
        self._check({"population": 2, "divisions": 1}, {"alpha": "[0, inf)", "adapt_every": "(0, 1]", **operators})

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import rvea

        return rvea.RVEA(
            ref_dirs=self._directions(m),
            pop_size=self.population,
            alpha=self.alpha,
            adapt_freq=self.adapt_every,
            **variation(self.crossover, self.crossover_eta, self.mutation_eta),
        )

    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> GuidedState:
        from pymoo.algorithms.moo.rvea import calc_V

        m = self._presented_count(members.F.shape[1])
        return GuidedState(**common, vectors=calc_V(self._directions(m)), ideal=np.full(m, np.inf), nadir=np.full(m, np.inf))

    def _restore(self, algorithm: Any, state: GuidedState, individuals: Any) -> None:
        from pymoo.algorithms.moo.rvea import calc_gamma

        algorithm.pop, survival = individuals, algorithm.survival
        with np.errstate(invalid="ignore"):  # of vectors that are parallel but for rounding
            survival.V, survival.gamma, survival.ideal = state.vectors, calc_gamma(state.vectors), state.ideal
        survival.nadir = state.nadir if np.isfinite(state.nadir).all() else None

    def _keep(self, algorithm: Any, state: GuidedState, table: Members) -> None:
        survival = algorithm.survival
        state.ideal = survival.ideal
        if survival.nadir is not None:
            state.nadir = survival.nadir
        if np.isfinite(survival.V).all():
            state.vectors = survival.V
