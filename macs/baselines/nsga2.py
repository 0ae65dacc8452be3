"""NSGA-II: non-dominated sorting and crowding distances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..evaluation.evaluator import Evaluator
from .population import Members, State
from .pymoo_adapter import Baseline

UNRANKED = -1


@dataclass
class RankedState(State):
    """With what tournaments look at.

    Attributes
    ----------
    rank : array (n,) of int
        Of each member's front, 0 the best; -1 for infeasible ones, which have none.
    crowding : array (n,)
    """

    rank: np.ndarray
    crowding: np.ndarray


@dataclass(frozen=True)
class NSGA2(Baseline):
    """NSGA-II (Deb, Pratap, Agarwal and Meyarivan 2002), that of pymoo; see `Baseline`.

    For any number of objectives; its crowding distances serve two or three.

    Parameters
    ----------
    population : int, default 100
        Number of individuals, and of offspring in a generation, at least 2.
    crossover : float, default 0.9
        Probability of simulated binary crossover.
    crossover_eta, mutation_eta : float, default 15 and 20
        Distribution indices of crossover and of polynomial mutation, in [1, 100]: the higher, the nearer are children to their parents.
    handling : {"feasible-first", "penalty", "objective"}, default "feasible-first"
        Feasible points are superior to others, of which the less violated are superior; or `penalty` times the violation is added to each
        objective; or the violation is one more objective.
    penalty : float, default 1000
        For handling="penalty": in units of the objectives.
    degree : {"largest", "sum", "log", "printed"}, default "largest"
        What counts as the violation of an infeasible point: its largest one, the sum of those of all constraints or of their logarithms, or
        the sum of all, none of which counts as more than 1; see `degrees`. Feasible is what violates nothing, whatever the degree.

    Raises
    ------
    ValueError
        Where a setting is out of its range; the message names it.
    """

    population: int = 100
    crossover: float = 0.9
    crossover_eta: float = 15.0
    mutation_eta: float = 20.0
    handling: str = "feasible-first"
    penalty: float = 1000.0
    degree: str = "largest"

    def __post_init__(self) -> None:
        self._check({"population": 2}, {"crossover": (0, 1), "crossover_eta": (1, 100), "mutation_eta": (1, 100)})

    def _size(self, m: int | None) -> int | None:
        return self.population

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import nsga2
        from pymoo.operators.crossover.sbx import SBX
        from pymoo.operators.mutation.pm import PM

        crossover, mutation = SBX(eta=self.crossover_eta, prob=self.crossover), PM(eta=self.mutation_eta)
        return nsga2.NSGA2(pop_size=self.population, crossover=crossover, mutation=mutation)

    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> RankedState:
        return RankedState(**common, rank=np.full(len(members), UNRANKED), crowding=np.full(len(members), np.nan))

    def _restore(self, algorithm: Any, state: RankedState, people: Any) -> None:
        people.set("rank", state.rank, "crowding", state.crowding)
        algorithm.pop = people

    def _keep(self, algorithm: Any, state: RankedState, table: Members) -> None:
        state.rank = _numbers(algorithm.pop, "rank", UNRANKED).astype(int)
        state.crowding = _numbers(algorithm.pop, "crowding", np.nan)


def _numbers(people: Any, key: str, missing: float) -> np.ndarray:
    """What individuals know of themselves, (n,), and `missing` where they know nothing."""
    values = [one.get(key) for one in people]
    return np.array([missing if value is None else value for value in values], dtype=float)
