"""MOEA/D: one scalar sub-problem for each reference direction, solved together with neighbouring ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from problems.checks import check_choice

from ..evaluation.evaluator import Evaluator
from ..pareto.directions import pair_up, tchebycheff
from .directed import Directed
from .population import Members, State
from .pymoo_adapter import variation


@dataclass
class DecomposedState(State):
    """State of MOEA/D. Member i is the best for direction i."""

    SHAPES: ClassVar[dict[str, str]] = {"ideal": "presented"}

    ideal: np.ndarray  # (m,): Best value of each objective so far, as presented to the algorithm


@dataclass(frozen=True)
class MOEAD(Directed):
    """MOEA/D (Zhang and Li 2007), pymoo's implementation; see `Baseline`. For two or more objectives.

    MOEA/D compares objectives only, so constraints become part of them, see `handling`. It asks for one candidate at a time, so that the
    inner level cannot evaluate several at once; see `batch`. Points of a `start` are assigned to the directions for which they are best.

    Parameters
    ----------
    population : int, optional
        Number of individuals, of offspring in a generation and of reference directions; any number not less than that of objectives. The
        directions are a simplex lattice, if one has so many, and evenly spread otherwise.
    divisions : int, optional
        Divisions of the simplex lattice (Das and Dennis 1998) of reference directions. Default: the finest lattice with at most 100
        directions (2 objectives: 100, 3: 91).
    neighbors : int, default 20
        Number of nearest directions that share parents and offspring, at least 2.
    neighbor_mating : float, default 0.9
        Probability that parents are neighbours.
    decomposition : {"tchebycheff", "pbi"}, optional
        Scalarisation. Default: Tchebycheff with two objectives, penalty boundary intersection with more.
    batch : bool, default False
        Evaluate all offspring of a generation in one batch, and do the replacement afterwards (pymoo's ParallelMOEAD).
    crossover_eta, mutation_eta : float, default 20
        Distribution indices of simulated binary crossover and of polynomial mutation, in [1, 100].
    handling, penalty, degree
        As for `NSGA2`. With "objective", the directions have one objective more.

    Raises
    ------
    ValueError
        If a setting is outside its range or, once the number of objectives is known, if population and divisions do not match.

    Examples
    --------
    >>> import numpy as np
    >>> from macs import MOEAD
    >>> schaffer = lambda X: np.hstack([X**2, (X - 2) ** 2])
    >>> front = MOEAD(population=20).minimize(schaffer, [(-10, 10)], evaluations=200, seed=1)
    >>> front.objectives.shape[1]
    2
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
    _compares_violations = False
    _one_each = True

    def __post_init__(self) -> None:
        counts = {"population": 2, "divisions": 1, "neighbors": 2}
        self._check(counts, {"neighbor_mating": "[0, 1]", "crossover_eta": "[1, 100]", "mutation_eta": "[1, 100]"}, ("batch",))
        if self.decomposition is not None:
            check_choice("MOEAD: decomposition", self.decomposition, ("tchebycheff", "pbi"))

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import moead
        from pymoo.decomposition.pbi import PBI
        from pymoo.decomposition.tchebicheff import Tchebicheff

        algorithm = moead.ParallelMOEAD if self.batch else moead.MOEAD
        return algorithm(
            ref_dirs=self._directions(m),
            n_neighbors=self.neighbors,
            decomposition={"tchebycheff": Tchebicheff(), "pbi": PBI(), None: None}[self.decomposition],
            prob_neighbor_mating=self.neighbor_mating,
            **variation(1.0, self.crossover_eta, self.mutation_eta),
        )

    def _place(self, members: Members, evaluator: Evaluator) -> Members:
        F = self._presented(members, evaluator.tolerance)[0]
        directions = self._directions(F.shape[1])[: len(F)]
        rows, places = pair_up(tchebycheff(F[:, None], directions, F.min(axis=0), F.max(axis=0)))
        return members.take(rows[np.argsort(places)])

    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> DecomposedState:
        return DecomposedState(**common, ideal=np.full(self._presented_count(members.F.shape[1]), np.inf))

    def _restore(self, algorithm: Any, state: DecomposedState, individuals: Any) -> None:
        algorithm.pop, algorithm.ideal = individuals, state.ideal

    def _keep(self, algorithm: Any, state: DecomposedState, table: Members) -> None:
        state.ideal = algorithm.ideal

    def _cut(self, algorithm: Any, count: int) -> None:
        if self.batch:
            algorithm.indices = algorithm.indices[:count]
