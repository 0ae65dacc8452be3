"""Adapter of pymoo's algorithms: in each iteration an algorithm is built from the state, used by ask and tell, and read back into the
state.

So the state is plain data, and all random draws, comparisons and sums are pymoo's own, by the generator of the state. pymoo evaluates
nothing and does not decide when to stop.
"""

from __future__ import annotations

import warnings
from abc import abstractmethod
from dataclasses import dataclass
from importlib import import_module
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np

from ..evaluation.evaluator import Evaluator, UnitBox
from ..pareto.directions import check_several
from .population import Members, PopulationSolver, State, distinct, evaluate, full_vectors, thinned


@dataclass(frozen=True)
class Baseline(PopulationSolver):
    """Solver that runs an algorithm of pymoo.

    On an unconstrained problem, with the same seed and evaluations for a whole number of generations, its points are those of
    `pymoo.optimize.minimize` to the last bit. Beyond that:

    - The front is the result of the algorithm (the non-dominated points of its population, its niches or its archive) without infeasible
      and repeated points. With constraints as a penalty or an objective, this may no longer contain feasible points; then the last front
      with any is kept.
    - If the budget is too small for the last generation, its first offspring are evaluated, and compete as usual.
    - A failed evaluation counts as infeasible, behind all others.
    - If the evaluator moves candidates, the population takes the new positions, and inner solves of near candidates start there.
    - Points of a `start` are the first members of the population; if they are too many, evenly spaced ones are used.
    - Periodic variables are treated as plain intervals.

    An implementation is a frozen dataclass of settings, those of a `PopulationSolver` included, with the class of pymoo, its arguments, and
    a state that says what passes from one generation to the next beside the population, see `State.CARRIED`.
    """

    # The hooks

    PYMOO: ClassVar[str]
    """Module below `pymoo.algorithms.moo` and class of the algorithm."""
    STATE: ClassVar[type[State]] = State
    SEVERAL: ClassVar[bool] = False
    """Whether it needs two or more objectives."""

    def check_objectives(self, m: int) -> None:
        """Raise ValueError for a single objective, if the algorithm needs several."""
        if self.SEVERAL:
            check_several(type(self).__name__, self._presented_count(m))

    @abstractmethod
    def _size(self, m: int | None) -> int | None:
        """Number of individuals; None if it depends on the number m of objectives, which is not known."""

    @abstractmethod
    def _arguments(self, m: int) -> dict[str, Any]:
        """Arguments of the algorithm for m objectives, as they are presented to it."""

    def _algorithm(self, m: int) -> Any:
        """A new algorithm of pymoo for m objectives, as they are presented to it."""
        module, _, kind = self.PYMOO.partition(":")
        return getattr(import_module(f"pymoo.algorithms.moo.{module}"), kind)(**self._arguments(m))

    def _first(self, members: Members, rng: np.random.Generator, evaluator: Evaluator) -> State:
        """The state of the first population, before it is presented to the algorithm."""
        return self.STATE.of(members, rng)

    def _restore(self, algorithm: Any, state: Any, individuals: Any) -> None:
        """Restore the algorithm from the state; `individuals` are pymoo's individuals of `_table`."""
        done = len(state.members)
        algorithm.pop = individuals[:done]
        for name, place in state.CARRIED.items():
            value = getattr(state, name)
            if isinstance(value, Members):
                value, done = individuals[done : done + len(value)], done + len(value)
            elif value is not None:
                value = value.copy()
            if value is not None:
                owner, _, attribute = place.rpartition(".")
                setattr(attrgetter(owner)(algorithm) if owner else algorithm, attribute, value)

    def _keep(self, algorithm: Any, state: Any, table: Members) -> None:
        """Update the fields of the state that are carried; individuals know their rows in `table`."""
        from pymoo.core.population import Population

        for name, place in state.CARRIED.items():
            value = attrgetter(place)(algorithm)
            setattr(state, name, table.take(rows_of(value)) if isinstance(value, Population) else value)

    def _place(self, members: Members, evaluator: Evaluator) -> Members:
        """The first population, in a suitable order if points of a `start` are in it."""
        return members

    def _best(self, algorithm: Any) -> Any:
        """Individuals that form the front, if they are feasible and not dominated."""
        return algorithm.opt

    def _cut(self, algorithm: Any, count: int) -> None:
        """Prepare the algorithm for the results of only the first `count` of the candidates that it asked for."""

    # The contract

    @property
    def state_class(self) -> type:
        """See `SearchMethod.state_class`."""
        return self.STATE

    def begin(self, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> Any:
        """The state after a first population has been evaluated; see `SearchMethod.begin`."""
        evaluator.check_budget(budget)
        given = distinct(start)
        m, members = evaluator.m_known, None
        if m is not None:
            self.check_objectives(m)
        size = self._size(m)
        if size is None:  # the number of objectives is known after one evaluation
            members = evaluate(evaluator, self._candidates(evaluator, given[:1], 1, rng), self.degree)
            self.check_objectives(members.F.shape[1])
            size = self._size(members.F.shape[1])
        assert size is not None
        done = 0 if members is None else 1
        given = thinned(given, size)
        Z = self._candidates(evaluator, given[done:], size - done, rng)[: budget - evaluator.counts.evaluations]
        if len(Z):
            first = evaluate(evaluator, Z, self.degree)
            members = first if members is None else members.joined(first)
        assert members is not None
        self.check_objectives(members.F.shape[1])
        if len(given):
            members = self._place(members, evaluator)
        state = self._first(members, rng, evaluator)
        algorithm, table = self._set_up(evaluator, members.F.shape[1], rng, budget), _table(state)
        individuals = self._individuals(table, evaluator)
        self._restore(algorithm, state, individuals)
        with warnings.catch_warnings(), np.errstate(divide="ignore", invalid="ignore"):  # pymoo changes the filters
            algorithm.tell(infills=individuals[: len(members)])
        self._remember(algorithm, state, table, members, evaluator)
        state.note(evaluator.tolerance)
        return state

    def advance(self, state: Any, evaluator: Evaluator, budget: int) -> None:
        """Do one generation within the budget of evaluations; changes `state`."""
        left = budget - evaluator.counts.evaluations
        if left <= 0:
            return
        table = _table(state)
        algorithm = self._set_up(evaluator, table.F.shape[1], state.rng, budget)
        self._restore(algorithm, state, self._individuals(table, evaluator))
        generation = state.iteration + 2  # pymoo's number: the first population is 1
        algorithm.is_initialized, algorithm.n_iter, algorithm.opt = True, generation, ()
        while algorithm.n_iter == generation and left > 0:  # some ask for one candidate at a time
            asked = algorithm.ask()
            if asked is None:  # no new offspring could be made
                break
            alone = not hasattr(asked, "__len__")
            offspring = [asked] if alone else asked
            X = settled(evaluator.box, np.array([one.X for one in offspring]), state.rng)
            Z = full_vectors(evaluator, state.members, X)
            room = evaluator.room(Z, left)
            if room < len(offspring):
                self._cut(algorithm, room)
            bred, offspring = evaluate(evaluator, Z[:room], self.degree), offspring[:room]
            left = budget - evaluator.counts.evaluations
            self._present(offspring, bred, len(table), evaluator)
            table = table.joined(bred)
            with warnings.catch_warnings(), np.errstate(divide="ignore", invalid="ignore"):
                algorithm.tell(infills=asked if alone else offspring)
            self._remember(algorithm, state, table, bred, evaluator)
        state.iteration += 1
        state.note(evaluator.tolerance)

    # Between the two

    def _set_up(self, evaluator: Evaluator, m: int, rng: np.random.Generator, budget: int) -> Any:
        """The algorithm, set up for the variables of the evaluator, m objectives and as many generations as the budget has room for; its
        random numbers are drawn from `rng`."""
        from pymoo.config import Config
        from pymoo.core.evaluator import VoidEvaluator
        from pymoo.core.problem import Problem
        from pymoo.termination.max_gen import MaximumGenerationTermination

        Config.warnings["not_compiled"] = False  # it would print
        size = self._size(m)
        assert size is not None
        end = MaximumGenerationTermination(-(-budget // size))
        end.update = lambda algorithm: 0.0  # it ends nothing, but says to an algorithm how many generations there are
        m = self._presented_count(m)
        algorithm = self._algorithm(m)
        d, constraints = len(evaluator.free), int(self.COMPARES_VIOLATIONS)
        problem = Problem(n_var=d, n_obj=m, n_ieq_constr=constraints, xl=evaluator.lower, xu=evaluator.upper)
        algorithm.setup(problem, termination=end, evaluator=VoidEvaluator(value=None), seed=0)
        algorithm.random_state = rng
        if evaluator.box.whole is not None and hasattr(algorithm, "mating"):

            def repair(problem: Any, offspring: Any, **more: Any) -> Any:
                return offspring.set("X", settled(evaluator.box, offspring.get("X"), rng)) if len(offspring) else offspring

            algorithm.mating.repair = repair  # before duplicates are left out
        return algorithm

    def _individuals(self, points: Members, evaluator: Evaluator) -> Any:
        """A pymoo Population of the points."""
        from pymoo.core.population import Population

        individuals = Population.empty(len(points))
        self._present(individuals, points, 0, evaluator)
        return individuals

    def _present(self, individuals: Any, points: Members, row: int, evaluator: Evaluator) -> None:
        """Write points into pymoo's individuals, with their rows, from `row` on, in the table of all points."""
        X = evaluator.box.confine(points.Z[:, evaluator.free])
        F, cv = self._presented(points, evaluator.tolerance)
        for i, one in enumerate(individuals):
            one.X, one.F, one.CV = X[i].copy(), F[i].copy(), cv[i : i + 1].copy()
            one.set("row", row + i)

    def _remember(self, algorithm: Any, state: Any, table: Members, seen: Members, evaluator: Evaluator) -> None:
        """Update the state from the algorithm, after the points `seen` were presented to it."""
        state.members = table.take(rows_of(algorithm.pop))
        self._keep(algorithm, state, table)
        state.show(evaluator.tolerance, seen, table.take(rows_of(self._best(algorithm))), state.members)


def settled(box: UnitBox, X: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Candidates X (k, d) with whole numbers where they are meant, see `UnitBox.settle`; others are unchanged to the last bit."""
    return X if box.whole is None else np.where(box.whole, box.to_values(box.settle(box.to_unit(X), rng)), X)


def _table(state: State) -> Members:
    """All points of the state that become individuals, the population first."""
    table = state.members
    for name in state.CARRIED:
        value = getattr(state, name)
        table = table.joined(value) if isinstance(value, Members) else table
    return table


def rows_of(individuals: Any) -> np.ndarray:
    """Rows (n,) of pymoo's individuals in the table of all points."""
    return np.array([one.data["row"] for one in individuals], dtype=int)
