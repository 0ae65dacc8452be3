"""MOEA/D: one scalar problem for each reference direction, solved together with those beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..evaluation.evaluator import Evaluator
from ..pareto.directions import check_directions, pair_up, population_size, reference_directions, tchebycheff
from . import constraints as handlings
from .population import Members, State
from .pymoo_adapter import Baseline


@dataclass
class DecomposedState(State):
    """With what scalarisations refer to: member i is the best for direction i.

    Attributes
    ----------
    ideal : array (m,)
        The best value of each objective seen, as the algorithm is told them.
    """

    ideal: np.ndarray


@dataclass(frozen=True)
class MOEAD(Baseline):
    """MOEA/D (Zhang and Li 2007), that of pymoo; see `Baseline`. For two objectives or more.

    It knows nothing of constraints; they are handled here, before it is told of a point. It asks for one candidate at a time, so that the
    inner level cannot work on many at once: see `batch`. Given points of a `start` are sent to the directions that they serve best.

    Parameters
    ----------
    population : int, optional
        Number of individuals, of offspring in a generation and of reference directions: any, at least as many as objectives; those of a
        simplex lattice where one has so many, evenly spread otherwise.
    divisions : int, optional
        Of the simplex lattice (Das and Dennis 1998) that gives the reference directions. Default: of the finest lattice with no more than
        100 directions (2 objectives: 100, 3: 91).
    neighbors : int, default 20
        How many of the nearest directions share parents and offspring, at least 2.
    neighbor_mating : float, default 0.9
        Probability that parents are neighbours.
    decomposition : {"tchebycheff", "pbi"}, optional
        Scalarisation. Default: Tchebycheff's with two objectives, penalty boundary intersection with more.
    batch : bool, default False
        Evaluate the offspring of a whole generation in one batch, and let them replace others afterwards (pymoo's ParallelMOEAD).
    crossover_eta, mutation_eta : float, default 20
        Distribution indices of simulated binary crossover and of polynomial mutation, in [1, 100].
    handling, penalty, degree
        As for `NSGA2`. With "objective", directions are of one more objective.

    Raises
    ------
    ValueError
        Where a setting is out of its range, and, once the number of objectives is known, where population and divisions contradict.
    """

    population: int | None = None
    divisions: int | None = None
    neighbors: int = 20
    neighbor_mating: float = 0.9
    decomposition: str | None = None
    batch: bool = False
    crossover_eta: float = 20.0
    mutation_eta: float = 20.0
    handling: str = "feasible-first"
    penalty: float = 1000.0
    degree: str = "largest"
    _knows_constraints = False

    def __post_init__(self) -> None:
        counts = {"population": 2, "divisions": 1, "neighbors": 2}
        self._check(counts, {"neighbor_mating": (0, 1), "crossover_eta": (1, 100), "mutation_eta": (1, 100)})
        if self.decomposition not in (None, "tchebycheff", "pbi"):
            raise ValueError(f"MOEAD: decomposition must be 'tchebycheff', 'pbi' or None, not {self.decomposition!r}")
        if not isinstance(self.batch, bool | np.bool_):
            raise ValueError(f"MOEAD: batch must be True or False, not {self.batch!r}")

    def check_objectives(self, m: int) -> None:
        """Refuse one objective, and directions that are not as many as individuals."""
        m += self.handling == "objective"
        check_directions("MOEAD", m, self.population, self.divisions)
        made = population_size(m, None, self.divisions)
        if None not in (self.population, self.divisions) and made != self.population:
            raise ValueError(
                f"MOEAD: divisions={self.divisions} makes {made} reference directions with {m} objectives, and population="
                f"{self.population} asks for others; leave one of the two out"
            )

    def _size(self, m: int | None) -> int | None:
        return population_size(m and m + (self.handling == "objective"), self.population, self.divisions)

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import moead
        from pymoo.decomposition.pbi import PBI
        from pymoo.decomposition.tchebicheff import Tchebicheff
        from pymoo.operators.crossover.sbx import SBX
        from pymoo.operators.mutation.pm import PM

        algorithm = moead.ParallelMOEAD if self.batch else moead.MOEAD
        return algorithm(
            ref_dirs=reference_directions(m, self.population, self.divisions),
            n_neighbors=self.neighbors,
            decomposition={"tchebycheff": Tchebicheff(), "pbi": PBI(), None: None}[self.decomposition],
            prob_neighbor_mating=self.neighbor_mating,
            crossover=SBX(eta=self.crossover_eta, prob=1.0),
            mutation=PM(eta=self.mutation_eta, prob_var=None),
        )

    def _told(self, points: Members, tolerance: float) -> handlings.Told:
        F, cv = super()._told(points, tolerance)
        return handlings.by_objectives(F, cv), np.zeros(len(cv))

    def _place(self, members: Members, evaluator: Evaluator) -> Members:
        F = self._told(members, evaluator.tolerance)[0]
        directions = reference_directions(F.shape[1], self.population, self.divisions)[: len(F)]
        rows, places = pair_up(tchebycheff(F[:, None], directions, F.min(axis=0), F.max(axis=0)))
        return members.take(rows[np.argsort(places)])

    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> DecomposedState:
        return DecomposedState(**common, ideal=np.full(members.F.shape[1] + (self.handling == "objective"), np.inf))

    def _restore(self, algorithm: Any, state: DecomposedState, people: Any) -> None:
        algorithm.pop, algorithm.ideal = people, state.ideal

    def _keep(self, algorithm: Any, state: DecomposedState, table: Members) -> None:
        state.ideal = algorithm.ideal

    def _cut(self, algorithm: Any, count: int) -> None:
        if self.batch:
            algorithm.indices = algorithm.indices[:count]
