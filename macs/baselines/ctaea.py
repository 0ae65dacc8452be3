"""C-TAEA: two archives, one of which converges to feasible points while the other keeps up diversity, whatever is feasible."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..evaluation.evaluator import Evaluator
from .directed import Directed
from .population import Members, State
from .pymoo_adapter import rows_of, variation


@dataclass(repr=False)
class TwoArchiveState(State):
    """State of C-TAEA. The members are the archive that converges."""

    SHAPES: ClassVar[dict[str, str]] = {"ideal": "presented"}

    diversity: Members  # the other archive, in its order; none before the first population is presented to the algorithm
    ideal: np.ndarray  # (m,): Best value of each objective so far, as presented to the algorithm; infinite before the first population


@dataclass(frozen=True)
class CTAEA(Directed):
    """C-TAEA (Li, Chen, Fu and Yao 2019), pymoo's implementation; see `Baseline`. For two or more objectives.

    Made for problems with constraints: one archive prefers feasible points, the other ignores constraints and fills the directions in which
    the first has few points. Parents come from both. The front is that of the first archive. Objectives are not scaled, so that they should
    have similar ranges.

    Parameters
    ----------
    population : int, optional
        Number of individuals in each archive, of offspring in a generation and of reference directions; any number not less than that of
        objectives. The directions are a simplex lattice, if one has so many, and evenly spread otherwise.
    divisions : int, optional
        Divisions of the simplex lattice (Das and Dennis 1998) of reference directions. Default: the finest lattice with at most 100
        directions (2 objectives: 100, 3: 91).
    crossover : float, default 1
        Probability of simulated binary crossover, in [0, 1].
    crossover_eta, mutation_eta : float, default 30 and 20
        Distribution indices of crossover and of polynomial mutation, in [1, 100]; a higher index puts children nearer to their parents.
    handling, penalty, degree
        As for `NSGA2`. With "objective", the directions have one objective more.

    Raises
    ------
    ValueError
        If a setting is outside its range or, once the number of objectives is known, if population and divisions do not match.

    Examples
    --------
    >>> import numpy as np
    >>> from macs import CTAEA
    >>> schaffer = lambda X: np.hstack([X**2, (X - 2) ** 2])
    >>> front = CTAEA(population=20).minimize(schaffer, [(-10, 10)], evaluations=200, seed=1)
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
    _one_each = True

    def __post_init__(self) -> None:
        intervals = {"crossover": "[0, 1]", "crossover_eta": "[1, 100]", "mutation_eta": "[1, 100]"}
        self._check({"population": 2, "divisions": 1}, intervals)

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import ctaea

        operators = variation(self.crossover, self.crossover_eta, self.mutation_eta, n_offsprings=1)
        return ctaea.CTAEA(ref_dirs=self._directions(m), **operators)

    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> TwoArchiveState:
        ideal = np.full(self._presented_count(members.F.shape[1]), np.inf)
        return TwoArchiveState(**common, diversity=members.take(np.arange(0)), ideal=ideal)

    def _table(self, state: TwoArchiveState) -> Members:
        return state.members.joined(state.diversity)

    def _restore(self, algorithm: Any, state: TwoArchiveState, individuals: Any) -> None:
        n, survival = len(state.members), algorithm.survival
        algorithm.pop, algorithm.da = individuals[:n], individuals[n:]
        survival.ideal_point = state.ideal
        # Only a budget of less than one population leaves fewer members. pymoo would look for them in the first n directions without end.
        survival.ref_dirs = survival.ref_dirs[:n]

    def _keep(self, algorithm: Any, state: TwoArchiveState, table: Members) -> None:
        state.diversity, state.ideal = table.take(rows_of(algorithm.da)), algorithm.survival.ideal_point
