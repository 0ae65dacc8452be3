"""The algorithms of pymoo as solvers: of each its settings, its class, and what passes from one generation to the next."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np

from problems.checks import check_choice

from ..evaluation.evaluator import Evaluator
from ..pareto.directions import check_directions, pair_up, population_size, reference_directions, tchebycheff
from .population import Members, State
from .pymoo_adapter import Baseline


def variation(crossover: float, crossover_eta: float, mutation_eta: float, **more: Any) -> dict[str, Any]:
    """Operators of a genetic algorithm of pymoo, by the names of its arguments: simulated binary crossover with this probability, and
    polynomial mutation; `more` are arguments of the crossover."""
    from pymoo.operators.crossover.sbx import SBX
    from pymoo.operators.mutation.pm import PM

    return {"crossover": SBX(eta=crossover_eta, prob=crossover, **more), "mutation": PM(eta=mutation_eta)}


# Without reference directions


@dataclass(frozen=True)
class Genetic(Baseline):
    """Baseline with simulated binary crossover, polynomial mutation and a population of any size."""

    population: int = 100
    crossover: float = 0.9
    crossover_eta: float = 15.0
    mutation_eta: float = 20.0

    def _size(self, m: int | None) -> int | None:
        return self.population

    def _arguments(self, m: int) -> dict[str, Any]:
        return {"pop_size": self.population, **variation(self.crossover, self.crossover_eta, self.mutation_eta)}


@dataclass(repr=False)
class RankedState(State):
    """State with the quantities that tournaments compare."""

    SHAPES: ClassVar[dict[str, str]] = {"rank": "members int", "crowding": "members"}

    rank: np.ndarray  # (n,): Rank of each member's front, 0 for the best; -1 for an infeasible member
    # (n,): Distances from other members, as the algorithm measures them; a larger one wins. NaN for an infeasible member.
    crowding: np.ndarray


class Ranked(Genetic):
    """Baseline whose individuals have ranks and crowding distances, which tournaments compare."""

    STATE = RankedState

    def _first(self, members: Members, rng: np.random.Generator, evaluator: Evaluator) -> State:
        return RankedState.of(members, rng, rank=np.full(len(members), -1), crowding=np.full(len(members), np.nan))

    def _restore(self, algorithm: Any, state: RankedState, individuals: Any) -> None:
        super()._restore(algorithm, state, individuals)
        individuals.set("rank", state.rank, "crowding", state.crowding)

    def _keep(self, algorithm: Any, state: RankedState, table: Members) -> None:
        rank, state.crowding = (np.array(algorithm.pop.get(name), dtype=float) for name in ("rank", "crowding"))  # None as NaN
        state.rank = np.nan_to_num(rank, nan=-1).astype(int)


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
    degree : {"largest", "sum", "log", "capped", "printed"}, default "largest"
        Violation by which infeasible points are compared: the largest of all constraints, the sum over the constraints, the sum of
        log(1 + violation), the sum with each violation at most 1, or "printed", the sum as in eqs. (16)-(18) of Chai and others (2020): a
        violation of 1 or more counts as 1, a smaller one in parts of the largest of those that are evaluated with it. Eq. (17) treats
        equalities alike, without the former. It does not change which points are feasible.

    Raises
    ------
    ValueError
        If a setting is outside its range; the message names it.

    Examples
    --------
    >>> from macs import NSGA2
    >>> from problems import load
    >>> front = NSGA2(population=20).solve(load("four_bar_truss"), evaluations=200, seed=1)
    >>> len(front) > 5
    True
    """

    PYMOO = "nsga2:NSGA2"


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
    population, crossover, crossover_eta, mutation_eta, handling, penalty, degree
        As for `NSGA2`.

    Raises
    ------
    ValueError
        As for `NSGA2`; also if numba is not installed, or there is a single objective.

    Examples
    --------
    >>> from macs import AGEMOEA2
    >>> from problems import load
    >>> front = AGEMOEA2(population=20).solve(load("four_bar_truss"), evaluations=200, seed=1)
    >>> len(front) > 5
    True
    """

    PYMOO = "age2:AGEMOEA2"
    SEVERAL = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if find_spec("numba") is None:
            raise ValueError("AGEMOEA2 needs numba, which is not installed: pip install 'macs-trajectories[agemoea2]'")

    def _algorithm(self, m: int) -> Any:
        algorithm = super()._algorithm(m)
        algorithm.survival.pairwise_distances = _distances
        return algorithm


def _distances(front: np.ndarray, p: float) -> np.ndarray:
    """pymoo's distances (n, n) of the points of a front (n, m) along its model; 0 if all points are equal."""
    from pymoo.algorithms.moo.age2 import AGEMOEA2Survival

    try:
        return AGEMOEA2Survival.pairwise_distances(front, p)
    except ZeroDivisionError:
        return np.zeros((len(front), len(front)))


@dataclass(frozen=True)
class SMSEMOA(Genetic):
    """SMS-EMOA (Beume, Naujoks and Emmerich 2007), pymoo's implementation; see `Baseline`. For two or more objectives.

    Of the last front that fits in only in part, the member that adds least to the hypervolume is removed, again and again. As in pymoo,
    and other than in the paper, a generation has as many offspring as individuals; and objectives are scaled to the ranges of the
    population before the offspring, failed members excepted, with the reference point at 11 in each. With five objectives, a generation
    takes several hundred times as long as with three.

    Parameters
    ----------
    population, crossover, crossover_eta, mutation_eta, handling, penalty, degree
        As for `NSGA2`. A single objective is refused.

    Examples
    --------
    >>> from macs import SMSEMOA
    >>> from problems import load
    >>> front = SMSEMOA(population=10).solve(load("four_bar_truss"), evaluations=200, seed=1)
    >>> len(front) > 5
    True
    """

    PYMOO = "sms:SMSEMOA"
    SEVERAL = True

    def _restore(self, algorithm: Any, state: State, individuals: Any) -> None:
        super()._restore(algorithm, state, individuals)
        failed = ~np.isfinite(individuals.get("CV")[:, 0])
        if failed.any() and not failed.all():  # pymoo takes the ranges of all members; no objective of a failed one is used otherwise
            individuals[failed].set("F", np.tile(individuals[~failed].get("F").max(axis=0), (failed.sum(), 1)))


# With reference directions


@dataclass(frozen=True)
class Directed(Baseline):
    """Baseline with reference directions, for two or more objectives."""

    population: int | None = None
    divisions: int | None = None

    ONE_EACH: ClassVar[bool] = False
    """Whether there must be as many individuals as directions."""

    def check_objectives(self, m: int) -> None:
        """Raise ValueError for a single objective, and for directions that do not match the population."""
        name, m = type(self).__name__, self._presented_count(m)
        check_directions(name, m, self.population, self.divisions)
        made = population_size(m, None, self.divisions)
        if self.ONE_EACH and None not in (self.population, self.divisions) and made != self.population:
            raise ValueError(
                f"{name}: divisions={self.divisions} makes {made} reference directions with {m} objectives, and population="
                f"{self.population} needs as many; leave one of the two out"
            )

    def _size(self, m: int | None) -> int | None:
        return population_size(m and self._presented_count(m), self.population, self.divisions)

    def _directions(self, m: int) -> np.ndarray:
        """Reference directions (k, m) for m objectives, as they are presented to the algorithm."""
        return reference_directions(m, self.population, self.divisions)


@dataclass(frozen=True)
class DirectedGenetic(Directed):
    """Baseline with reference directions, simulated binary crossover and polynomial mutation."""

    crossover: float = 1.0
    crossover_eta: float = 30.0
    mutation_eta: float = 20.0

    def _arguments(self, m: int) -> dict[str, Any]:
        operators = variation(self.crossover, self.crossover_eta, self.mutation_eta)
        return {"ref_dirs": self._directions(m), "pop_size": self.population, **operators}


@dataclass(repr=False)
class NormalisedState(State):
    """State of NSGA-III, with the points by which objectives, as presented to the algorithm, are normalised."""

    SHAPES: ClassVar[dict[str, str]] = {"ideal": "presented", "worst": "presented", "extreme_points": "e presented"}
    CARRIED: ClassVar[dict[str, str]] = {
        "ideal": "survival.norm.ideal_point",
        "worst": "survival.norm.worst_point",
        "extreme_points": "survival.norm.extreme_points",
    }

    ideal: np.ndarray | None = None  # ideal, worst: (m,): Best and worst value of each objective so far
    worst: np.ndarray | None = None
    extreme_points: np.ndarray | None = None  # (m, m): Points that span the hyperplane


@dataclass(frozen=True)
class NSGA3(DirectedGenetic):
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
    crossover, crossover_eta, mutation_eta : float, default 1, 30 and 20
        As for `NSGA2`.
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
    >>> from macs import NSGA3
    >>> from problems import load
    >>> front = NSGA3(population=20).solve(load("four_bar_truss"), evaluations=200, seed=1)
    >>> len(front) > 5
    True
    """

    whole: bool = False

    PYMOO = "nsga3:NSGA3"
    STATE = NormalisedState

    def _arguments(self, m: int) -> dict[str, Any]:
        from pymoo.operators.selection.tournament import TournamentSelection

        return {**super()._arguments(m), "selection": TournamentSelection(func_comp=less_violated)}

    def _best(self, algorithm: Any) -> Any:
        return algorithm.pop if self.whole else algorithm.opt


def less_violated(pop: Any, P: np.ndarray, random_state: np.random.Generator, **kwargs: Any) -> np.ndarray:
    """Winners (n, 1) of tournaments between the pairs P (n, 2): the less violated one; of two equal ones a random one."""
    winners = np.empty((len(P), 1), dtype=int)
    for i, (a, b) in enumerate(P):
        of_a, of_b = pop[a].CV[0], pop[b].CV[0]
        winners[i] = random_state.choice([a, b]) if of_a == of_b else a if of_a < of_b else b
    return winners


@dataclass(repr=False)
class GuidedState(State):
    """State of RVEA. All in objectives as presented to the algorithm."""

    SHAPES: ClassVar[dict[str, str]] = {"vectors": "k presented", "ideal": "presented", "nadir": "presented"}
    CARRIED: ClassVar[dict[str, str]] = {"vectors": "survival.V", "ideal": "survival.ideal", "nadir": "survival.nadir"}

    vectors: np.ndarray | None = None  # (k, m): Reference vectors of length 1, as they were last adapted
    ideal: np.ndarray | None = None  # (m,): Best value of each objective so far among feasible points
    nadir: np.ndarray | None = None  # (m,): Worst value of each objective among the feasible members


@dataclass(frozen=True)
class RVEA(DirectedGenetic):
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
    population, divisions
        As for `NSGA3`; the directions are the reference vectors, and the population is that of the first generation.
    alpha : float, default 2
        Exponent of the progress in the factor, at least 0: with a larger one the angle counts later.
    adapt_every : float, default 0.1
        Fraction of the generations after which the vectors are adapted again, in (0, 1]; 1 is never.
    crossover, crossover_eta, mutation_eta, handling, penalty, degree
        As for `NSGA3`, errors included.

    Examples
    --------
    >>> from macs import RVEA
    >>> from problems import load
    >>> front = RVEA(population=20).solve(load("four_bar_truss"), evaluations=200, seed=1)
    >>> len(front) > 5
    True
    """

    alpha: float = 2.0
    adapt_every: float = 0.1

    PYMOO = "rvea:RVEA"
    STATE = GuidedState

    def _arguments(self, m: int) -> dict[str, Any]:
        return {**super()._arguments(m), "alpha": self.alpha, "adapt_freq": self.adapt_every}

    def _restore(self, algorithm: Any, state: GuidedState, individuals: Any) -> None:
        from pymoo.algorithms.moo.rvea import calc_gamma

        super()._restore(algorithm, state, individuals)
        with np.errstate(invalid="ignore"):  # of vectors that are parallel but for rounding
            algorithm.survival.gamma = calc_gamma(algorithm.survival.V)

    def _keep(self, algorithm: Any, state: GuidedState, table: Members) -> None:
        if not np.isfinite(algorithm.survival.V).all():
            algorithm.survival.V = state.vectors
        super()._keep(algorithm, state, table)


@dataclass(repr=False)
class TwoArchiveState(State):
    """State of C-TAEA. The members are the archive that converges."""

    SHAPES: ClassVar[dict[str, str]] = {"ideal": "presented"}
    CARRIED: ClassVar[dict[str, str]] = {"diversity": "da", "ideal": "survival.ideal_point"}

    diversity: Members | None = None  # the other archive, in its order
    ideal: np.ndarray | None = None  # (m,): Best value of each objective so far, as presented to the algorithm


@dataclass(frozen=True)
class CTAEA(DirectedGenetic):
    """C-TAEA (Li, Chen, Fu and Yao 2019), pymoo's implementation; see `Baseline`. For two or more objectives.

    Made for problems with constraints: one archive prefers feasible points, the other ignores constraints and fills the directions in which
    the first has few points. Parents come from both. The front is that of the first archive. Objectives are not scaled, so that they should
    have similar ranges.

    Parameters
    ----------
    population : int, optional
        Number of individuals in each archive, of offspring in a generation and of reference directions; any number not less than that of
        objectives.
    divisions : int, optional
        As for `NSGA3`.
    crossover, crossover_eta, mutation_eta, handling, penalty, degree
        As for `NSGA3`, errors included.

    Examples
    --------
    >>> from macs import CTAEA
    >>> from problems import load
    >>> front = CTAEA(population=20).solve(load("four_bar_truss"), evaluations=200, seed=1)
    >>> len(front) > 5
    True
    """

    PYMOO = "ctaea:CTAEA"
    STATE = TwoArchiveState
    ONE_EACH = True

    def _arguments(self, m: int) -> dict[str, Any]:
        return {"ref_dirs": self._directions(m), **variation(self.crossover, self.crossover_eta, self.mutation_eta, n_offsprings=1)}

    def _restore(self, algorithm: Any, state: TwoArchiveState, individuals: Any) -> None:
        super()._restore(algorithm, state, individuals)
        # Only a budget of less than one population leaves fewer members. pymoo would look for them in the first n directions without end.
        algorithm.survival.ref_dirs = algorithm.survival.ref_dirs[: len(state.members)]


@dataclass
class DecomposedState(State):
    """State of MOEA/D. Member i is the best for direction i."""

    SHAPES: ClassVar[dict[str, str]] = {"ideal": "presented"}
    CARRIED: ClassVar[dict[str, str]] = {"ideal": "ideal"}

    ideal: np.ndarray | None = None  # (m,): Best value of each objective so far, as presented to the algorithm


@dataclass(frozen=True)
class MOEAD(Directed):
    """MOEA/D (Zhang and Li 2007), pymoo's implementation; see `Baseline`. For two or more objectives.

    MOEA/D compares objectives only, so constraints become part of them, see `handling`. It asks for one candidate at a time, so that the
    inner level cannot evaluate several at once; see `batch`. Points of a `start` are assigned to the directions for which they are best.

    Parameters
    ----------
    population, divisions
        As for `CTAEA`.
    neighbors : int, default 20
        Number of nearest directions that share parents and offspring, at least 2.
    neighbor_mating : float, default 0.9
        Probability that parents are neighbours.
    decomposition : {"tchebycheff", "pbi"}, optional
        Scalarisation. Default: Tchebycheff with two objectives, penalty boundary intersection with more.
    batch : bool, default False
        Evaluate all offspring of a generation in one batch, and do the replacement afterwards (pymoo's ParallelMOEAD).
    crossover_eta, mutation_eta : float, default 20
        As for `NSGA2`.
    handling, penalty, degree
        As for `NSGA3`, errors included.

    Examples
    --------
    >>> from macs import MOEAD
    >>> from problems import load
    >>> front = MOEAD(population=20).solve(load("four_bar_truss"), evaluations=200, seed=1)
    >>> len(front) > 1
    True
    """

    neighbors: int = 20
    neighbor_mating: float = 0.9
    decomposition: str | None = None
    batch: bool = False
    crossover_eta: float = 20.0
    mutation_eta: float = 20.0

    STATE = DecomposedState
    COMPARES_VIOLATIONS = False
    ONE_EACH = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.decomposition is not None:
            check_choice("MOEAD: decomposition", self.decomposition, ("tchebycheff", "pbi"))

    def _arguments(self, m: int) -> dict[str, Any]:
        from pymoo.decomposition.pbi import PBI
        from pymoo.decomposition.tchebicheff import Tchebicheff

        return {
            "ref_dirs": self._directions(m),
            "n_neighbors": self.neighbors,
            "decomposition": {"tchebycheff": Tchebicheff(), "pbi": PBI(), None: None}[self.decomposition],
            "prob_neighbor_mating": self.neighbor_mating,
            **variation(1.0, self.crossover_eta, self.mutation_eta),
        }

    def _algorithm(self, m: int) -> Any:
        from pymoo.algorithms.moo import moead

        return (moead.ParallelMOEAD if self.batch else moead.MOEAD)(**self._arguments(m))

    def _place(self, members: Members, evaluator: Evaluator) -> Members:
        F = self._presented(members, evaluator.tolerance)[0]
        directions = self._directions(F.shape[1])[: len(F)]
        rows, places = pair_up(tchebycheff(F[:, None], directions, F.min(axis=0), F.max(axis=0)))
        return members.take(rows[np.argsort(places)])

    def _cut(self, algorithm: Any, count: int) -> None:
        if self.batch:
            algorithm.indices = algorithm.indices[:count]
