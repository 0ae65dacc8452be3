"""NSGA-III: non-dominated sorting and niches along reference directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..evaluation.evaluator import Evaluator
from .directed import Directed
from .population import Members, State
from .pymoo_adapter import variation


@dataclass(repr=False)
class NormalisedState(State):
    """State of NSGA-III, with the points by which objectives, as presented to the algorithm, are normalised."""

    SHAPES: ClassVar[dict[str, str]] = {"ideal": "presented", "worst": "presented", "extreme_points": "e presented"}

    ideal: np.ndarray  # ideal, worst: (m,): Best and worst value of each objective so far; infinite before the first population
    worst: np.ndarray
    extreme_points: np.ndarray  # (m, m): Points that span the hyperplane; none before the first population


@dataclass(frozen=True)
class NSGA3(Directed):
    """NSGA-III (Deb and Jain 2014; with constraints: Jain and Deb 2014), pymoo's implementation; see `Baseline`. For two or more
    objectives.

    The front has the non-dominated points nearest to the reference directions, or, with `whole`, all non-dominated points. If two
    infeasible candidates tie, the winner is drawn by the generator of the run; in pymoo this draw is independent of the seed.

    Parameters
    ----------
    population : int, optional
        Number of individuals, and of offspring in a generation. Without `divisions`, also the number of reference directions, not less than
        that of objectives: a simplex lattice, if one has so many, and evenly spread otherwise. Default: the number of directions.
    divisions : int, optional
        Divisions of the simplex lattice (Das and Dennis 1998) of reference directions. With `population`, there may be fewer directions
        than individuals, but at least half as many. Default: the finest lattice with at most 100 directions (2 objectives: 100, 3: 91).
    crossover : float, default 1
        Probability of simulated binary crossover, in [0, 1].
    crossover_eta, mutation_eta : float, default 30 and 20
        Distribution indices of crossover and of polynomial mutation, in [1, 100]; a higher index puts children nearer to their parents.
    handling, penalty, degree
        As for `NSGA2`. With "objective", the directions have one objective more.
    whole : bool, default False
        Whether the front has all non-dominated points of the population. It does not change the search.

    Raises
    ------
    ValueError
        If a setting is outside its range or, once the number of objectives is known, if population and directions do not match.

    Examples
    --------
    >>> import numpy as np
    >>> from macs import NSGA3
    >>> schaffer = lambda X: np.hstack([X**2, (X - 2) ** 2])
    >>> front = NSGA3(population=20).minimize(schaffer, [(-10, 10)], evaluations=200, seed=1)
    >>> front.objectives.shape[1]
    2
    """

    population: int | None = None
    divisions: int | None = None
    crossover: float = 1.0
    crossover_eta: float = 30.0
    mutation_eta: float = 20.0
    handling: str = "feasible-first"
    penalty: float = 1000.0
    degree: str = "largest"
    whole: bool = False

    def __post_init__(self) -> None:
        counts = {"population": 2, "divisions": 1}
        self._check(counts, {"crossover": "[0, 1]", "crossover_eta": "[1, 100]", "mutation_eta": "[1, 100]"}, ("whole",))

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import nsga3
        from pymoo.operators.selection.tournament import TournamentSelection

        return nsga3.NSGA3(
            ref_dirs=self._directions(m),
            pop_size=self.population,
            selection=TournamentSelection(func_comp=less_violated),
            **variation(self.crossover, self.crossover_eta, self.mutation_eta),
        )

    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> NormalisedState:
        m = self._presented_count(members.F.shape[1])
        return NormalisedState(**common, ideal=np.full(m, np.inf), worst=np.full(m, -np.inf), extreme_points=np.empty((0, m)))

    def _best(self, algorithm: Any) -> Any:
        return algorithm.pop if self.whole else algorithm.opt

    def _restore(self, algorithm: Any, state: NormalisedState, individuals: Any) -> None:
        algorithm.pop = individuals
        norm = algorithm.survival.norm
        norm.ideal_point, norm.worst_point = state.ideal, state.worst
        norm.extreme_points = state.extreme_points if len(state.extreme_points) else None

    def _keep(self, algorithm: Any, state: NormalisedState, table: Members) -> None:
        norm = algorithm.survival.norm
        state.ideal, state.worst = norm.ideal_point, norm.worst_point
        if norm.extreme_points is not None:
            state.extreme_points = norm.extreme_points


def less_violated(pop: Any, P: np.ndarray, random_state: np.random.Generator, **kwargs: Any) -> np.ndarray:
    """Winners (n, 1) of tournaments between the pairs P (n, 2): the less violated one; of two equal ones a random one."""
    winners = np.empty((len(P), 1), dtype=int)
    for i, (a, b) in enumerate(P):
        of_a, of_b = pop[a].CV[0], pop[b].CV[0]
        winners[i] = random_state.choice([a, b]) if of_a == of_b else a if of_a < of_b else b
    return winners
