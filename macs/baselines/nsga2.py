"""NSGA-II: non-dominated sorting and crowding distances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .pymoo_adapter import variation
from .ranked import Ranked


@dataclass(frozen=True)
class NSGA2(Ranked):
    """NSGA-II (Deb, Pratap, Agarwal and Meyarivan 2002), pymoo's implementation; see `Baseline`.

    For any number of objectives; crowding distances work well with two or three.

    Parameters
    ----------
    population : int, default 100
        Number of individuals, and of offspring in a generation, at least 2.
    crossover : float, default 0.9
        Probability of simulated binary crossover, in [0, 1].
    crossover_eta, mutation_eta : float, default 15 and 20
        Distribution indices of crossover and of polynomial mutation, in [1, 100]; a higher index puts children nearer to their parents.
    handling : {"feasible-first", "penalty", "objective"}, default "feasible-first"
        Constraint handling. "feasible-first": feasible points are better than infeasible ones, and these are compared by their violation.
        "penalty": `penalty` times the violation is added to each objective. "objective": the violation is an additional objective.
    penalty : float, default 1000
        Factor for handling="penalty", in units of the objectives, at least 0.
    degree : {"largest", "sum", "log", "printed"}, default "largest"
        Violation by which infeasible points are compared: the largest of all constraints, the sum over the constraints, the sum of
        log(1 + violation), or the sum with each violation at most 1 (Chai and others 2020, as printed). It does not change which points are
        feasible.

    Raises
    ------
    ValueError
        If a setting is outside its range; the message names it.

    Examples
    --------
    >>> import numpy as np
    >>> from macs import NSGA2
    >>> schaffer = lambda X: np.hstack([X**2, (X - 2) ** 2])
    >>> front = NSGA2(population=20).minimize(schaffer, [(-10, 10)], evaluations=200, seed=1)
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

    def _size(self, m: int | None) -> int | None:
        return self.population

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import nsga2

        return nsga2.NSGA2(pop_size=self.population, **variation(self.crossover, self.crossover_eta, self.mutation_eta))
