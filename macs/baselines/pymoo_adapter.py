"""What the baselines share: a pymoo algorithm is made anew for each iteration from the state, asked, told, and read back into the state.

So the state is plain data, and the algorithm goes on as if it had never been away: it draws from the state's generator, and every random
draw, comparison and sum is pymoo's own. pymoo never evaluates anything, and knows of no termination.
"""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from ..evaluation.evaluator import Evaluator
from ..pareto.archive import Archive
from .population import Members, PopulationSolver, State, distinct, evaluate, full_vectors, thinned


class Baseline(PopulationSolver):
    """A solver that drives an algorithm of pymoo's.

    On an unconstrained problem, the same seed and as many evaluations as are a whole number of generations, its points are those of
    `pymoo.optimize.minimize` to the last bit. Beyond that:

    - The front is what the algorithm returns, without the infeasible points and without repetitions: the non-dominated ones of its
      population, its niches or its archive. Where constraints are a penalty or an objective, that may hold nothing feasible any more: then
      it is what it last was.
    - Of a last generation for which the budget is too small, the first offspring are evaluated, and compete as usual.
    - A failed evaluation counts as infeasible, behind all others.
    - Where the evaluator moves candidates, the population takes the points that come back. Their next neighbours start from there.
    - `start` takes the first places of the population: of too many, evenly spaced ones.
    - Periodic variables are plain intervals to it.

    An implementation is a frozen dataclass of settings, with those of a `PopulationSolver` among them, and the hooks below.
    """

    _knows_constraints = True

    # The hooks

    @abstractmethod
    def _size(self, m: int | None) -> int | None:
        """How many individuals there are; None as long as the number of objectives is not known but has to be."""

    @abstractmethod
    def _algorithm(self, m: int) -> Any:
        """A new pymoo algorithm, for m objectives as it is told them."""

    @abstractmethod
    def _first(self, members: Members, common: dict[str, Any], evaluator: Evaluator) -> State:
        """The state of the first population, before the algorithm has seen it; `common` are the fields that all states have."""

    @abstractmethod
    def _restore(self, algorithm: Any, state: Any, people: Any) -> None:
        """Give the algorithm what it knew; `people` are pymoo's individuals of `_table(state)`."""

    @abstractmethod
    def _keep(self, algorithm: Any, state: Any, table: Members) -> None:
        """Take over into the state what is its own, for points whose rows in `table` their individuals know."""

    def _table(self, state: Any) -> Members:
        """All points of the state that have to become individuals, the population first."""
        return state.members

    def _place(self, members: Members, evaluator: Evaluator) -> Members:
        """The first population, of which some were given, each in a place that suits it."""
        return members

    def _best(self, algorithm: Any) -> Any:
        """Which of its individuals are the front, as far as they are feasible and not dominated."""
        return algorithm.opt

    def _cut(self, algorithm: Any, count: int) -> None:
        """Prepare the algorithm for being told of only the first `count` of those that it has asked for."""

    # The contract

    @property
    def makes_state(self) -> Callable[..., Any]:
        """See `Solver.makes_state`."""
        return self._first

    def begin(self, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> Any:
        """Evaluate a first population; see `Solver.begin`."""
        if budget <= evaluator.counts.evaluations:
            raise ValueError(f"evaluations: the budget of {budget} leaves none")
        given = distinct(start)
        m, members = evaluator.m_known, None
        if m is not None:
            self.check_objectives(m)
        size = self._size(m)
        if size is None:  # one point tells how many objectives there are
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
        none = Archive.of(members, np.arange(0))
        common = {"members": members, "archive": none, "closest": none, "iteration": 0, "first_feasible": 0, "all_feasible": 0, "rng": rng}
        state = self._first(members, common, evaluator)
        algorithm, table = self._set_up(evaluator, members.F.shape[1], rng), self._table(state)
        people = self._people(table, evaluator)
        self._restore(algorithm, state, people)
        with warnings.catch_warnings():  # pymoo changes the filters
            algorithm.tell(infills=people[: len(members)])
        self._remember(algorithm, state, table, members, evaluator)
        state.note(evaluator.tolerance)
        return state

    def advance(self, state: Any, evaluator: Evaluator, budget: int) -> None:
        """One generation, within the budget of evaluations; changes `state`."""
        left = budget - evaluator.counts.evaluations
        if left <= 0:
            return
        table = self._table(state)
        algorithm = self._set_up(evaluator, table.F.shape[1], state.rng)
        self._restore(algorithm, state, self._people(table, evaluator))
        algorithm.is_initialized, algorithm.n_iter, algorithm.opt = True, state.iteration + 1, ()
        while algorithm.n_iter == state.iteration + 1 and left > 0:  # some ask for one candidate at a time
            asked = algorithm.ask()
            if asked is None:  # nothing could be bred that is not there already
                break
            alone = not hasattr(asked, "__len__")
            offspring = [asked] if alone else asked[:left]
            if len(offspring) == left:
                self._cut(algorithm, left)
            X = np.array([one.X for one in offspring])
            bred = evaluate(evaluator, full_vectors(evaluator, state.members, X), self.degree)
            left = budget - evaluator.counts.evaluations
            self._tell(offspring, bred, len(table), evaluator)
            table = table.joined(bred)
            with warnings.catch_warnings():
                algorithm.tell(infills=asked if alone else offspring)
            self._remember(algorithm, state, table, bred, evaluator)
        state.iteration += 1
        state.note(evaluator.tolerance)

    # Between the two

    def _set_up(self, evaluator: Evaluator, m: int, rng: np.random.Generator) -> Any:
        """The algorithm, ready for use on the evaluator's variables and for m objectives; it draws from `rng` from now on."""
        from pymoo.config import Config
        from pymoo.core.evaluator import VoidEvaluator
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination

        Config.warnings["not_compiled"] = False  # it would print
        m += self.handling == "objective"
        algorithm, d, constraints = self._algorithm(m), len(evaluator.free), int(self._knows_constraints)
        problem = Problem(n_var=d, n_obj=m, n_ieq_constr=constraints, xl=evaluator.lower, xu=evaluator.upper)
        algorithm.setup(problem, termination=NoTermination(), evaluator=VoidEvaluator(value=None), seed=0)
        algorithm.random_state = rng
        return algorithm

    def _people(self, points: Members, evaluator: Evaluator) -> Any:
        """A pymoo Population of points."""
        from pymoo.core.population import Population

        people = Population.empty(len(points))
        self._tell(people, points, 0, evaluator)
        return people

    def _tell(self, people: Any, points: Members, row: int, evaluator: Evaluator) -> None:
        """Write points into pymoo's individuals, who learn their rows, from `row` on, in the table of all points."""
        X = evaluator.box.confine(points.Z[:, evaluator.free])
        F, cv = self._told(points, evaluator.tolerance)
        for i, one in enumerate(people):
            one.X, one.F, one.CV = X[i].copy(), F[i].copy(), cv[i : i + 1].copy()
            one.set("row", row + i)

    def _remember(self, algorithm: Any, state: Any, table: Members, seen: Members, evaluator: Evaluator) -> None:
        """Read the algorithm back into the state."""
        state.members = table.take(rows_of(algorithm.pop))
        self._keep(algorithm, state, table)
        state.show(evaluator.tolerance, seen, table.take(rows_of(self._best(algorithm))), state.members)


def rows_of(people: Any) -> np.ndarray:
    """The rows (n,), in the table of all points, of pymoo's individuals."""
    return np.array([one.data["row"] for one in people], dtype=int)
