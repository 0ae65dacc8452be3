"""MACS as an algorithm of pymoo: `minimize(problem, MACS(), ("n_eval", 30_000), seed=1)`.

pymoo tells an algorithm the values of one batch of candidates in each iteration, but an iteration of MACS evaluates several, each of which
depends on the one before. So an iteration is a function of the state before it and of the values that are known: it is done on a copy of
this state, and ends where values are missing, or when it is complete. What is kept between two calls is data: the state, and the
batches told since. `tell` does the iteration again with one batch more; `next` evaluates by pymoo's evaluator whatever is needed.
"""

from __future__ import annotations

import copy
import inspect
import logging
import math
import sys
from collections.abc import Callable, Iterable
from dataclasses import fields, replace
from typing import Any, NoReturn, Self

import numpy as np
from pymoo.constraints.adaptive import AdaptiveConstraintHandling
from pymoo.core.algorithm import Algorithm
from pymoo.core.initialization import Initialization
from pymoo.core.population import Population
from pymoo.core.termination import TerminateIfAll
from pymoo.termination.default import DefaultTermination
from pymoo.termination.max_eval import MaximumFunctionCallTermination
from pymoo.util.display.multi import MultiObjectiveOutput
from pymoo.util.display.single import SingleObjectiveOutput

from problems.checks import unknown
from problems.vector import CompiledVectorProblem

from .evaluation.blackbox import BlackBox, plain_problem, pymoo_numbers, pymoo_rows
from .evaluation.evaluator import FAILED, Evaluation
from .search.macs import MACS as Search  # noqa: N811 - a class
from .search.rounds import PLANNED_EVALUATIONS, Rounds
from .search.settings import refuse_gone
from .search.state import SearchState
from .solvers.run import IDLE_ITERATIONS
from .solvers.start import decisions

log = logging.getLogger(__name__)

SETTINGS = tuple(one.name for one in fields(Search))
"""Names of the settings of MACS."""
Evaluating = Callable[[np.ndarray], Population] | None
OPTIONS = tuple(name for name, one in inspect.signature(Algorithm).parameters.items() if one.kind is not one.VAR_KEYWORD)
"""Names of what every algorithm of pymoo takes."""


class MACS(Algorithm):
    """Multi-Agent Collaborative Search as an algorithm of pymoo, for any pymoo Problem: of real variables, whole numbers,
    choices, and all of these.

    It is the search of `macs.MACS`: on a problem without constraints, the same settings, seed and number of evaluations give the points of
    `macs.MACS(...).minimize(problem, evaluations=..., seed=...)`, to the last bit; with G, too.

    Parameters
    ----------
    agents : int, default 10
        Number of agents, at least 3.
    archive : int, default 100
        Largest number of points in the result, at least the number of objectives; `macs.MACS` has 10 by default. (An archive of pymoo's
        own, which collects what was evaluated, is an argument of `minimize`: `minimize(problem, MACS(), archive=MultiObjectiveArchive())`.)
    refine, polish_on, mesh, mesh_tolerance, prefer, polish_every, ceiling, variant
        All other settings of `macs.MACS`, with its defaults and errors: see `help(macs.MACS)`. Those for derivatives and meshes do nothing
        here, as on any plain function, but `mesh="adaptive"` and `polish_on` are refused as soon as the problem is known. `ceiling` does
        nothing, either: the termination decides when to end.
    sampling : array (k, d), Population or Sampling, optional
        First points, inside the bounds. If they are fewer than the first population, the rest is drawn; the best of
        all become agents. Points of a Population that are already evaluated are not evaluated again. Default: a Latin hypercube.
    output : Output, optional
        What `verbose=True` prints. Default: pymoo's columns for one objective, or for several.
    **settings
        The settings above, and what every algorithm of pymoo takes: `termination`, `callback`, `display`, `save_history`,
        `return_least_infeasible`, `verbose`, `seed`, `evaluator`.

    Attributes
    ----------
    search : macs.MACS
        The settings.
    opt : Population
        The archive: feasible, mutually non-dominated points. As long as nothing is feasible, the point of least CV.
    pop : Population
        The points of `opt`, and then the agents that are elsewhere.
    off : Population
        All points that the last iteration evaluated.

    Raises
    ------
    ValueError
        If a setting is outside its range. By `setup`, and so by `minimize`: if the problem has variables of unknown classes, no finite
        bounds, or more objectives than the archive may have points.
    TypeError
        If there is no such setting.

    Notes
    -----
    The page "For users of pymoo" of the manual says how generations and evaluations are counted, what is feasible, and what `ask`, `tell`,
    copies and pickles do. All evaluations are made by `algorithm.evaluator`; the number of an `n_eval` termination is never exceeded.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from pymoo.problems import get_problem
    >>> from macs.pymoo import MACS
    >>> res = minimize(get_problem("bnh"), MACS(archive=20), ("n_eval", 2000), seed=1)
    >>> res.F.shape, res.algorithm.evaluator.n_eval, bool((res.G <= 0).all())
    ((20, 2), 2000, True)
    """

    archive: Any
    opt: Any
    output: Any

    def __init__(self, *, sampling: Any = None, output: Any = None, **settings: Any) -> None:
        options = {name: settings.pop(name) for name in OPTIONS if name in settings and name not in SETTINGS}
        refuse_gone(settings)
        for name in settings:
            if name not in SETTINGS:
                raise TypeError(unknown("setting of MACS", name, dict.fromkeys(("sampling", *SETTINGS, *OPTIONS))))
        search = Search(**({"archive": 100} | settings))  # as many as the populations of pymoo's algorithms have
        super().__init__(output=output, **options)
        self.search = search
        self.sampling = np.array(sampling) if isinstance(sampling, list | tuple) else sampling
        self._start_anew()

    @classmethod
    def paper(cls, **settings: Any) -> Self:
        """The settings of the paper, see `macs.MACS.paper`; `settings` are others, and options of pymoo."""
        own = {name: value for name, value in settings.items() if name in SETTINGS}
        paper = Search.paper(**own)
        return cls(**(settings | {name: getattr(paper, name) for name in SETTINGS}))

    def setup(self, problem: Any, verbose: bool = False, progress: bool = False, **options: Any) -> Self:
        """Make the algorithm ready for a problem, see pymoo's `Algorithm.setup`."""
        for name in options:
            if name in SETTINGS and (name != "archive" or isinstance(options[name], int | np.integer)):
                raise ValueError(f"{name} is a setting of the algorithm: MACS({name}={options[name]!r})")
        compiled = plain_problem(problem)
        if isinstance(self, AdaptiveConstraintHandling):
            raise ValueError("MACS: what is feasible may not change during a run, as it does by AdaptiveEpsilonConstraintHandling")
        if self.output is None:
            self.output = SingleObjectiveOutput() if problem.n_obj == 1 else MultiObjectiveOutput()
        super().setup(problem, verbose=verbose, progress=progress, **options)
        self._compiled = replace(compiled, name=problem.name(), rows=_only_pymoo, equalities=())  # pymoo says what is feasible
        self.search.check_objectives(problem.n_obj)
        self.search.check_goals(self._compiled.goals)
        self.search.check_vector(self._compiled)
        self._start_anew()
        return self

    def _start_anew(self) -> None:
        self._state: SearchState | None = None  # before the current iteration
        self._told: list[Population] = []  # in the current iteration
        self._asked: np.ndarray | None = None  # candidates of the batch that is to be told next
        self._budget: int | None = None  # at the end of the current iteration; None before it has begun
        self._planned = False  # whether settings follow from the budget
        self._given = Population.empty()  # first points
        self._known: dict[bytes, Any] = {}  # individuals of the archive and the agents
        self._designs: dict[bytes, np.ndarray] = {}  # what is known of those that are not evaluated again
        self._idle = 0

    def next(self) -> None:
        """Do one iteration, or what is left of it, by pymoo's evaluator."""
        if self.problem is None:
            raise ValueError("MACS has no problem yet: call setup(problem) before next()")
        if not self.is_initialized:
            self._initialize()
        self.advance()

    def _infill(self) -> Population:
        if self._asked is None:
            try:
                self._iteration(None)
                self._asked = np.empty((0, self.problem.n_var))  # nothing to evaluate: `tell` completes the iteration
            except Asked as asked:
                self._asked = asked.X
        return self._individuals(self._asked)

    def _initialize_infill(self) -> Population:
        return self._infill()

    def _initialize_advance(self, infills: Population | None = None, **more: Any) -> None:
        self._advance(infills)  # which completes it: the first population is one batch

    def _advance(self, infills: Population | None = None, **more: Any) -> bool:
        """Whether the iteration is complete: with these individuals, or, without any, by pymoo's evaluator."""
        if infills is not None:
            self._tell(infills)
        try:
            state, evaluator = self._iteration(self._evaluated if infills is None else None)
        except Asked as asked:
            self._asked = asked.X
            return False
        self._complete(state, evaluator)
        return True

    def _tell(self, infills: Population) -> None:
        asked = len(self._infill() if self._asked is None else self._asked)
        if len(infills) != asked:
            raise ValueError(f"tell: {len(infills)} individuals, but {asked} were asked for; ask() returns those of the next batch")
        if any(np.size(one.F) != self.problem.n_obj for one in infills):
            raise ValueError("tell: individuals without values; algorithm.evaluator.eval(problem, infills) evaluates them")
        if asked:
            self._told.append(infills)
        self._asked = None

    def _evaluated(self, X: np.ndarray) -> Population:
        """The candidates X (k, d), evaluated by pymoo, as individuals that count as told."""
        batch = self._individuals(X)
        batch.set("n_gen", self.n_iter, "n_iter", self.n_iter)
        self.evaluator.eval(self.problem, batch, algorithm=self)
        if self.archive is not None:
            self.archive = self.archive.add(batch)
        self._told.append(batch)
        self._asked = None
        return batch

    def _individuals(self, X: np.ndarray) -> Population:
        """Individuals at X (k, d); in the first population those that were given."""
        own = pymoo_rows(self.problem, self._compiled.variables, X)
        batch = Population.new(X=own) if len(X) else Population.empty()
        for i, one in enumerate(self._given[: len(X)]):
            if np.array_equal(one.X, own[i]):
                batch[i] = one
        return batch

    def _iteration(self, more: Evaluating) -> tuple[SearchState, Told]:
        """The state after the current iteration, and the evaluator that has its individuals. Raises `Asked` if values are missing."""
        if self._budget is None:
            self._plan()
        assert self._budget is not None
        state, evaluator = copy.deepcopy(self._state), Told(self._compiled, self._told, more, self._known)
        evaluator.known_designs = dict(self._designs)
        if state is None:
            start = decisions(self._numbers(self._given), self._compiled.variables) if len(self._given) else None
            return self.search.begin(evaluator, self._budget, copy.deepcopy(self.random_state), start), evaluator
        evaluator.counts.evaluations = state.evaluations
        state.rounds = None if self._planned else state.rounds or Rounds.first(self.problem.n_obj, False, PLANNED_EVALUATIONS)
        self.search.advance(state, evaluator, self._budget)
        return state, evaluator

    def _plan(self) -> None:
        """Fix the budget of an iteration that begins. All of it is to follow from the same number, also if it is done again."""
        left = max(most_evaluations(self.termination) - self.evaluator.n_eval, 0)
        self._planned = most_evaluations(self.termination, default=False) < math.inf
        if self._state is not None:
            self._budget = int(min(self._state.evaluations + left, sys.maxsize))
            return
        if self.sampling is not None:
            count = self.search.points_to_sample(int(left if self._planned else min(left, PLANNED_EVALUATIONS)))
            self._given = self._first(count)
        skipped = sum(all(what in one.evaluated for what in self.evaluator.evaluate_values_of) for one in self._given)
        left += skipped if self.evaluator.skip_already_evaluated else 0
        self._budget = int(left if self._planned else min(left, max(PLANNED_EVALUATIONS, len(self._given))))

    def _first(self, count: int) -> Population:
        """The points that are given, or those that pymoo's Sampling draws, inside the bounds."""
        given = Initialization(self.sampling).do(self.problem, count, random_state=self.random_state, algorithm=self)
        try:
            X = decisions(self._numbers(given), self._compiled.variables)
        except ValueError as error:
            raise ValueError(f"sampling: {str(error).removeprefix('start: ')}") from None
        inside = (self._numbers(given) == X).all(axis=1)  # others are outside by rounding
        moved = Population.new(X=pymoo_rows(self.problem, self._compiled.variables, X))
        return Population.create(*(one if same else other for one, other, same in zip(given, moved, inside, strict=True)))

    def _numbers(self, batch: Population) -> np.ndarray:
        """Variables (k, d) of individuals as numbers."""
        return pymoo_numbers(self.problem, self._compiled.variables, batch.get("X"))

    def _complete(self, state: SearchState, evaluator: Told) -> None:
        """Go on to the next iteration, with the population of this one."""
        self._idle = 0 if self._told else self._idle + 1
        if self._idle >= IDLE_ITERATIONS:
            self.termination.terminate()
        self.off = Population.create(*(one for batch in self._told for one in batch))
        self._state, self._told, self._asked, self._budget = state, [], None, None
        self._designs = evaluator.known_designs
        if evaluator.over:
            self.termination.terminate()
        self._given = Population.empty()
        kept = [place(*row) for group in (state.archive, state.agents) for row in zip(group.Z, group.F, strict=True)]
        self._known = {key: evaluator.known[key] for key in kept}
        individuals = list(self._known.values())
        if not len(state.archive):  # pymoo's users look at the CV, which is not how the search orders points
            seen = [*(self.opt if self.opt is not None else ()), *self.off]
            least = min(seen, key=lambda one: one.CV[0])
            individuals = [least, *(one for one in individuals if one is not least)]
        self.pop = Population.create(*individuals)
        self.opt = self.pop[: max(len(state.archive), 1)]

    def _set_optimum(self) -> None:
        pass  # `_complete` has set it

    def _finalize(self) -> None:
        if self._state is not None:
            said = self.search.extra_stats(self._state, Told(self._compiled, (), None, {}))
            if "prefer" in said:
                log.warning("the preference was %s", said["prefer"])


class Asked(Exception):  # noqa: N818 - a question, not an error
    """Candidates X (k, d) that an iteration needs the values of."""

    def __init__(self, X: np.ndarray) -> None:
        super().__init__(X)
        self.X = X


class Told(BlackBox):
    """Evaluator of a pymoo problem by its individuals: of the batches that were `told`, in their order; then of those that `more` returns,
    evaluated, at X (k, n); without it, `Asked` is raised. `known` individuals are kept by their `place`."""

    def __init__(self, problem: CompiledVectorProblem, told: Iterable[Population], more: Evaluating, known: dict[bytes, Any]) -> None:
        super().__init__(problem, tolerance=0.0)
        self.known = dict(known)
        self._told, self._more = iter(tuple(told)), more

    def _values(self, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        batch = next(self._told, None)
        if batch is None:
            if self._more is None:
                raise Asked(Z)
            batch = self._more(Z)
        self._batch = batch
        return _columns(batch.get("F"), len(Z)), _residuals(batch)

    def _evaluate(self, Z: np.ndarray, way: int | None = None) -> tuple[Evaluation, int]:
        evaluation, iterations = super()._evaluate(Z, way)
        if self.kinds[0] is None:
            evaluation = replace(evaluation, Z=np.array(self._batch.get("X"), dtype=float))
        for one, z, f, status in zip(self._batch, evaluation.Z, evaluation.F, evaluation.status, strict=True):
            if status == FAILED:
                one.CV = np.array([np.inf])  # what is not a number is feasible for pymoo if there are no constraints
            self.known[place(z, f)] = one
        return evaluation, iterations


def place(z: np.ndarray, f: np.ndarray) -> bytes:
    """What tells an evaluated point, with variables z (d,) and objectives f (m,), from others."""
    return z.tobytes() + f.tobytes()


def most_evaluations(termination: Any, default: bool = True) -> float:
    """Number of evaluations at which a termination of pymoo ends a run at the latest; infinite if there is none.

    Without `default`, that of pymoo's default terminations does not count, since the user has not chosen it.
    """
    if isinstance(termination, MaximumFunctionCallTermination):
        most = termination.n_max_evals
        return math.inf if most is None or most == math.inf else math.ceil(most)
    if isinstance(termination, DefaultTermination) and not default:
        return math.inf
    parts = (*getattr(termination, "criteria", ()), *getattr(termination, "terminations", ()))
    last = max if isinstance(termination, TerminateIfAll) else min
    return last((most_evaluations(part, default) for part in parts), default=math.inf)


def _residuals(batch: Population) -> np.ndarray:
    """Residuals (k, c) of inequalities, then of equalities, beyond what pymoo allows: 0 where a point is feasible by pymoo. The last column
    is the CV of points that are infeasible for another reason."""
    feasible = (_columns(batch.get("FEAS"), len(batch)) != 0.0).all(axis=1, keepdims=True)
    G, H, CV = (_columns(batch.get(name), len(batch)) for name in ("G", "H", "CV"))
    ease = batch[0].config
    over, off = np.maximum(G - ease["cv_ieq"]["eps"], 0.0), np.copysign(np.maximum(np.abs(H) - ease["cv_eq"]["eps"], 0.0), H)
    found = np.hstack([over, off])
    other = np.where((found != 0.0).any(axis=1), 0.0, CV.max(axis=1, initial=0.0))
    return np.where(feasible, 0.0, np.column_stack([found, other]))


def _columns(values: Any, count: int) -> np.ndarray:
    """Numbers of individuals as an array (count, k)."""
    array = np.array(values, dtype=float)
    return array.reshape(count, array.size // count)


def _only_pymoo(X: np.ndarray) -> NoReturn:
    """In place of the function of a problem, which only pymoo evaluates."""
    raise NotImplementedError
