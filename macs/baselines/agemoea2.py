"""AGE-MOEA-II: non-dominated sorting and distances along a model of the front."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from ..pareto.directions import check_several
from .pymoo_adapter import variation
from .ranked import Ranked


@dataclass(frozen=True)
class AGEMOEA2(Ranked):
    """AGE-MOEA-II (Panichella 2022), pymoo's implementation; see `Baseline`. For two or more objectives.

    In each generation the front is modelled as the points of one p-norm. Members are ranked by non-dominated sorting, and within a front by
    their distances along that model. The model is made anew from the members in each generation. If the points of a front are all equal,
    they have no distances; pymoo then divides by zero.

    pymoo compiles parts of it with numba, which is not among the requirements of this package: `pip install 'macs-trajectories[agemoea2]'`.
    The first generation in a process takes some ten seconds longer for that. As numba may reorder sums, the same seed gives the same bits
    only on processors and versions of numba of one kind.

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
        If a setting is outside its range, numba is not installed, or there is a single objective.

    Examples
    --------
    >>> import numpy as np
    >>> from macs import AGEMOEA2
    >>> schaffer = lambda X: np.hstack([X**2, (X - 2) ** 2])
    >>> front = AGEMOEA2(population=20).minimize(schaffer, [(-10, 10)], evaluations=200, seed=1)
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
        if find_spec("numba") is None:
            raise ValueError("AGEMOEA2 needs numba, which is not installed: pip install 'macs-trajectories[agemoea2]'")

    def check_objectives(self, m: int) -> None:
        """Raise ValueError for a single objective."""
        check_several("AGEMOEA2", self._presented_count(m))

    def _size(self, m: int | None) -> int | None:
        return self.population

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import age2

        algorithm = age2.AGEMOEA2(pop_size=self.population, **variation(self.crossover, self.crossover_eta, self.mutation_eta))
        algorithm.survival.pairwise_distances = _distances
        return algorithm


def _distances(front: np.ndarray, p: float) -> np.ndarray:
    """pymoo's distances (n, n) of the points of a front (n, m) along its model; 0 if all points are equal."""
    from pymoo.algorithms.moo.age2 import AGEMOEA2Survival

    try:
        return AGEMOEA2Survival.pairwise_distances(front, p)
    except ZeroDivisionError:
        return np.zeros((len(front), len(front)))
