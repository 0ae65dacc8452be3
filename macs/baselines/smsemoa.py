"""SMS-EMOA: non-dominated sorting and contributions to the hypervolume."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..evaluation.evaluator import Evaluator
from ..pareto.directions import check_several
from .population import Members, State
from .pymoo_adapter import Baseline, variation


@dataclass(frozen=True)
class SMSEMOA(Baseline):
    """SMS-EMOA (Beume, Naujoks and Emmerich 2007), pymoo's implementation; see `Baseline`. For two or more objectives.

    Of the last front that fits in only in part, the member that adds least to the hypervolume is removed, again and again. As in pymoo,
    and other than in the paper, a generation has as many offspring as individuals; and objectives are scaled to the ranges of the
    population before the offspring, failed members excepted, with the reference point at 11 in each. With five objectives, a generation
    takes several hundred times as long as with three.

    Parameters
    ----------
    population : int, default 100
        Number of individuals, and of offspring in a generation, at least 2.
    crossover : float, default 0.9
        Probability of simulated binary crossover, in [0, 1].
    crossover_eta, mutation_eta : float, default 15 and 20
        Distribution indices of crossover and of polynomial mutation, in [1, 100]; a higher index puts children nearer to their parents.
    handling, penalty, degree
        As for `NSGA2`.

    Raises
    ------
    ValueError
        If a setting is outside its range, or there is a single objective.

    Examples
    --------
    >>> import numpy as np
    >>> from macs import SMSEMOA
    >>> schaffer = lambda X: np.hstack([X**2, (X - 2) ** 2])
    >>> front = SMSEMOA(population=10).minimize(schaffer, [(-10, 10)], evaluations=200, seed=1)
    >>> front.objectives.shape[1]
    2
    """

    population: int = 100
    crossover: float = 0.9
    crossover_eta: float = 15.0
    mutation_eta: float = 20.0
    handling: str = "feasible-first"
    penalty: float = 1000.0
    degree: str = "largest"

    def __post_init__(self) -> None:
        self._check({"population": 2}, {"crossover": "[0, 1]", "crossover_eta": "[1, 100]", "mutation_eta": "[1, 100]"})

    def check_objectives(self, m: int) -> None:
        """Raise ValueError for a single objective."""
        check_several("SMSEMOA", self._presented_count(m))

    def _size(self, m: int | None) -> int | None:
        return self.population

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import sms

        return sms.SMSEMOA(pop_size=self.population, **variation(self.crossover, self.crossover_eta, self.mutation_eta))

    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> State:
        return State(**common)

    def _restore(self, algorithm: Any, state: State, individuals: Any) -> None:
        algorithm.pop = individuals
        failed = ~np.isfinite(individuals.get("CV")[:, 0])
        if failed.any() and not failed.all():  # pymoo takes the ranges of all members; no objective of a failed one is used otherwise
            individuals[failed].set("F", np.tile(individuals[~failed].get("F").max(axis=0), (failed.sum(), 1)))

    def _keep(self, algorithm: Any, state: State, table: Members) -> None:
        """Nothing but the members passes to the next generation."""
