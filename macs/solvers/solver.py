"""Solvers: search methods with calls for the Pareto front of a problem or of a plain function, and solvers by name."""

from __future__ import annotations

import importlib
import inspect
import logging
from collections.abc import Callable, Sequence
from contextlib import closing, nullcontext
from dataclasses import asdict, replace
from os import PathLike
from typing import Any

import numpy as np

from problems.checks import check_interval, unknown
from problems.compiled import CompiledProblem, kinds
from problems.problem import Problem
from problems.vector import CompiledVectorProblem, VectorProblem, without_dynamics
from transcription.base import Transcription, check_freedom, check_problem
from transcription.inner import InnerSolver, inner_solver
from transcription.smooth import Smooth
from transcription.stopping import Stopped

from ..evaluation.bilevel import Bilevel
from ..evaluation.blackbox import BlackBox, RowCache, plain_problem
from ..evaluation.evaluator import Counts
from ..front import Front
from ..fronts.builders import from_archive, from_vector_problem, no_points
from ..fronts.provenance import costs, more_costs
from ..fronts.verified import VERIFY, check_verify, with_nearest
from ..io.console import StatusLine
from ..io.interrupts import TIME_LIMIT, Interrupts, spending, work_on_trajectories
from ..io.workers import Workers, processes
from ..refinement.mesh_search import SearchMeshes, search_meshes
from .method import SearchMethod
from .progress import Progress
from .run import ENDED, SearchRun
from .start import Call, beginning, check_start, decisions, drawing

log = logging.getLogger(__name__)

Callback = Callable[[Progress], Any]


class Solver(SearchMethod):
    """Search method with two calls for its user: `solve` for problems, with or without trajectories, `minimize` for plain functions.

    Parameters
    ----------
    **settings
        Those of each class.

    Examples
    --------
    >>> from macs import NSGA2, Solver
    >>> isinstance(NSGA2(), Solver)
    True
    """

    def solve(
        self,
        problem: Problem | CompiledProblem | VectorProblem | CompiledVectorProblem,
        transcription: Transcription | None = None,
        *,
        evaluations: int | None = None,
        seed: int | None = None,
        inner: str | InnerSolver | None = None,
        tolerance: float = 1e-6,
        start: Any = None,
        verify: float | None = VERIFY,
        error: float | None = None,
        time_limit: float | None = None,
        workers: Workers | None = None,
        progress: bool | None = None,
        callback: Callback | None = None,
        checkpoint: str | PathLike[str] | None = None,
        cache: str | PathLike[str] | None = None,
    ) -> Front:
        """The Pareto front of an optimal control problem or a vector problem.

        Parameters
        ----------
        problem : Problem or VectorProblem
            A vector problem takes neither transcription nor inner level; in the end, its points are evaluated again instead of simulated.
        transcription : Transcription, optional
            Default: the problem's own; if it has none, DFET on a mesh that is found, see `refinement.mesh_search`.
        evaluations : int, optional
            Number of candidates that are sent to the inner level, or of rows that a vector problem evaluates. Default: MACS searches until
            more work no longer changes the front, see Notes; other searches take the problem's own number. MACS ends before where no
            candidate is feasible and projections find nothing feasible near them.
        seed : int, optional
            The same seed gives the same front, to the last bit. None draws one, which is recorded in `stats`.
        inner : str or InnerSolver, optional
            How candidates are made feasible: "auto" (MACS with gradients chooses between propagation, a quick projection and IPOPT, by
            what each has brought for its work; all others as by "projection"), "projection" (fast, and IPOPT if that fails), "propagate"
            (not: they are scored as they propagate), "none" (not: states are searched, too, with the dynamics as constraints), "ipopt"
            (the nearest feasible point), "ipopt-feasibility" (any feasible point), or an `InnerSolver` of your own. Default: the problem's
            own, usually "auto".
        tolerance : float
            Largest scaled residual of a feasible point.
        start : Front, Points, array (k, n), "uniform", "smooth" or Smooth, optional
            First candidates. A front, points or an array: decisions, all variables or the free ones only, which are used after the
            problem's guess. "uniform": each variable drawn independently, without the guess. "smooth": random smooth profiles about the
            guess, see `transcription.Smooth`. Default: the problem's own; else the guess, if there is one, and independent draws; where
            MACS finds the mesh, also the optima of single objectives that this takes.
        verify : float, optional
            Largest error, scaled as in `Front.verify`, that an independent simulation may show in a `verified` point. None: points are not
            simulated.
        error : float, optional
            With two objectives: after the search, gradient solves add points between those found until the curve of the front errs by
            less, in ranges; see `Front.curve` and `Front.dense`.
        time_limit : float, optional
            Seconds after which the call ends with its results so far, as it does after Ctrl-C: within a second or two, whatever it is
            doing. The last quarter is left for simulations, and for solving again what these do not confirm. A run that this ends is
            recorded as not reproducible. If nothing was evaluated yet, the front is empty.
        workers : int, "all" or Executor, optional
            Processes that work side by side, "all" for one for each core, or a `concurrent.futures.Executor`. The result is the
            same, to the last bit. Other processes than this one begin after a second of work. Default: 1.
        progress : bool, optional
            Show the progress of the search on stderr. Default: on a terminal and in a notebook, from the third second on.
        callback : callable, optional
            Function that is called with a `Progress` after every iteration, and between the gradient solves of a polish after which the
            search may go on; the search ends if it returns True.
        checkpoint : path, optional
            File that keeps the state of the run. The same call continues a run that was killed, interrupted, out of time or stopped by the
            callback, and gives the same front as without the interruption, to the last bit. See Notes.
        cache : path, optional
            File that keeps the rows of a vector problem, evaluated one at a time, for any later search on it. Those that it has count as
            evaluations, and in `stats["from_cache"]`; those that raised an error are tried again.

        Returns
        -------
        Front
            Feasible, mutually non-dominated points, simulated. If none was found it is empty: `message` says why, and `closest` is the
            least infeasible point.

        Raises
        ------
        ValueError
            If the problem is not stated correctly, an argument is not valid, a search that needs a number of evaluations has none, or the
            checkpoint is damaged or of another run; before any work.
        OSError
            If the checkpoint cannot be written; before any work.

        Notes
        -----
        After more than ten seconds, `stats["seconds"]` has what they were spent on: certificates, simulation, explanation, what gradient
        solves were for ("starts", "ends", ...), and "search" for all else. `stats["solves_for"]` has the numbers of these solves,
        "iterations_for" their iterations, and "kept_for" how many gave a new point or a better one.

        Without a number of evaluations, MACS searches in rounds, each with a polish if there are gradients and something new was found. It
        ends after 150 evaluations (2000 without gradients) that did not improve the front. If a later round improved the front,
        or an end with several optima had too few starts, it takes twice as many, and at least a quarter of the evaluations before the
        last improvement; in the second case also some seconds of counted work. Later rounds begin with gradient solves from
        other starts. At its `ceiling` a search ends, too, and after half a minute or so of counted work on large programs;
        `stats["stopped"]` is "done" or "ceiling".
        Improved means: points that lie beyond the front by more than 0.001 of its ranges add 0.1 % to its hypervolume, or to the best
        values of all directions on average, or one objective gets better by 0.5 % of its range. That is no proof that nothing better
        exists: what no round has come near is not found.

        If what follows the search fails, the front is returned as the search left it, not simulated: `message` says why.

        A checkpoint is written between iterations, and between batches of gradient solves of a polish, at most once a second, and at the
        end of the run. Work after the last write is done again. If the run has ended, the same call returns its front without a search;
        only an adaptive mesh, or a polish on another transcription, is made again.

        A checkpoint belongs to one problem, transcription, solver with its settings, inner level, tolerance, start, budget and seed; a seed
        of None takes the seed of the file. `time_limit` counts from each call; `stats["wall_time"]` is the sum of all calls. If the file
        cannot be written during the run, the search continues, logs a warning, and `stats["checkpoint"]` has the reason.
        """
        if not isinstance(problem, VectorProblem | CompiledVectorProblem):
            check_problem(problem, transcription)
            if cache is not None:
                raise ValueError(f"cache is for rows of vector problems, and '{problem.name}' has trajectories: use checkpoint")
        elif transcription is not None or inner is not None:
            raise ValueError(f"{without_dynamics(problem.name)}: it takes no {'inner level' if transcription is None else 'transcription'}")
        call = Call(self._budget(problem, evaluations), seed, tolerance, time_limit, workers, progress, callback, checkpoint, cache)
        check_verify(verify)
        check_interval("error", 1.0 if error is None else error, "(0, 1]")
        if error is not None and (isinstance(problem, VectorProblem | CompiledVectorProblem) or len(problem.compile().goals) != 2):
            raise ValueError(f"error is for two objectives and trajectories, which '{problem.name}' has not")
        if isinstance(problem, VectorProblem | CompiledVectorProblem):
            return self._solve_vector(problem.compile(), start, verify, call)
        if isinstance(problem, Problem):
            inner, start = problem.default_inner if inner is None else inner, problem.default_start if start is None else start
        with spending("search") as seconds:
            front = self._solve(problem, transcription, "auto" if inner is None else inner, start, verify, call)
            if error is not None and front.stats["stopped"] in ENDED:
                try:
                    front = front.dense(error=error, workers=workers, progress=progress)
                except ValueError as reason:  # after a long search
                    front = front.replace(message="; ".join(filter(None, [front.message, str(reason)])))
        if sum(seconds.values()) <= 10.0:  # of a short run they say little
            return front
        return front.replace(stats=front.stats | {"seconds": {what: round(one, 2) for what, one in seconds.items()}})

    def _solve(
        self,
        problem: Problem | CompiledProblem,
        transcription: Transcription | None,
        inner: str | InnerSolver,
        start: Any,
        verify: float | None,
        call: Call,
    ) -> Front:
        """`solve` of an optimal control problem."""
        solver, compiled = inner_solver(inner), problem.compile()
        self.check_goals(compiled.goals)
        check_start(start, compiled)
        about, level = self.about(), {"inner": inner if isinstance(inner, str) else repr(inner)}
        earlier, chosen = Counts(), None
        with Interrupts(call.time_limit) as interrupts, work_on_trajectories(), processes(call.workers):
            try:
                if transcription is None:
                    with StatusLine(call.progress) as show:
                        chosen = search_meshes(problem, verify or VERIFY, call.tolerance, show)
                    earlier = chosen.counts
                    transcription = chosen.search if self.remeshes else chosen.fine or chosen.search
                    start = chosen.ends if start is None and self.remeshes else start
                # The rest of a limit is for simulations and re-solves: without them, nothing that was found can be trusted.
                within = None if call.time_limit is None else max(0.75 * call.time_limit - interrupts.elapsed, 1e-3)
                run = self._search_run(compiled, transcription, solver, level, start, replace(call, time_limit=within))
                if chosen is not None and start is chosen.ends and chosen.rules:
                    run.more = {"rules": chosen.rules}
            except Stopped as reason:
                spent = {"wall_time": interrupts.elapsed, "seed": call.seed, "tolerance": call.tolerance}
                stats = costs(earlier, **spent, stopped=str(reason), reproducible=False)
                return _or_ends(Front.of(no_points(compiled.goals, compiled, about, stats | level)), chosen).verify(verify)
            before = interrupts.elapsed
            front = _or_ends(run.go(), chosen)
            front = front.replace(stats=more_costs(front.stats, earlier, before, ""))
            ended = front.stats["stopped"] in (*ENDED, TIME_LIMIT) and not interrupts.reason
            try:
                return self.finish(front, verify, call.progress, chosen) if ended else front.verify(verify)
            except Stopped as reason:
                return front.replace(stats=more_costs(front.stats, Counts(), 0.0, str(reason)))
            except Exception as error:
                return _not_simulated(front, error)

    def _search_run(
        self, problem: CompiledProblem, transcription: Transcription, inner: InnerSolver, level: dict[str, str], start: Any, call: Call
    ) -> SearchRun:
        """The run of a search on an optimal control problem, ready to go."""
        nlp = inner.program(transcription.nlp(problem))
        self.check_transcription(transcription, problem)
        check_freedom(nlp)
        self.check_objectives(len(problem.goals))
        about, drawn = self.about(), drawing(start)
        smooth = drawn if isinstance(drawn, Smooth) else None
        evaluator = Bilevel(nlp, inner, call.tolerance, smooth)
        certified = self.certifies and evaluator.has_gradients

        def make_front(state: Any, stats: dict[str, Any]) -> Front:
            if state is None:
                return Front.of(no_points(problem.goals, problem, about, stats | level))
            return Front.of(from_archive(nlp, state.archive, state.closest, about, stats | level, certify=certified))

        first = beginning(start if drawn is None else None, nlp, guess=drawn is None if smooth is None else smooth.guess)
        what = {
            "solver": about,
            "problem": {"name": problem.name, "fingerprint": problem.fingerprint},
            "transcription": transcription.to_dict(),
            "first candidates": drawn if smooth is None else asdict(smooth),
            **level,
        }
        return SearchRun(self, evaluator, make_front, call, first, what)

    def minimize(
        self,
        function: Any,
        bounds: Any = None,
        *,
        evaluations: int | None = None,
        seed: int | None = None,
        constraints: Callable[[np.ndarray], np.ndarray] | None = None,
        names: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        senses: Sequence[str] | None = None,
        integer: bool | Sequence[str] = False,
        tolerance: float = 1e-6,
        start: Any = None,
        time_limit: float | None = None,
        workers: Workers | None = None,
        progress: bool | None = None,
        callback: Callback | None = None,
        checkpoint: str | PathLike[str] | None = None,
        cache: str | PathLike[str] | None = None,
    ) -> Front:
        """The Pareto front of a plain vector function or a pymoo Problem.

        Parameters
        ----------
        function : callable or pymoo Problem
            `function(X: (n, d)) -> F: (n, m)`, or `(F, G)`; a row with all G <= 0 is feasible, one with NaN a failed evaluation.
        bounds : pairs, pair of arrays, or mapping
            d pairs (lower, upper); two arrays (lower, upper) of length d > 2; or {name: pair}. Not needed for a pymoo Problem.
        evaluations : int, optional
            Number of rows of X that are evaluated. Default: until more work no longer changes the front, as for `solve`, by MACS; other
            searches need a number.
        constraints : callable, optional
            `constraints(X) -> G`; a row with all G <= 0 is feasible, whatever their units.
        tolerance : float
            What an equality of a pymoo Problem may miss, as a part of its typical size in the box; 8 evaluations find that out.
        names, units, senses : sequences of str, optional
            Names, units and senses ("minimize" or "maximize") of the objectives. Default: "f1", "f2", ..., no units, all minimised.
        integer : bool or sequence of str
            Whether all variables, or those of these names, are whole numbers; of a pymoo Problem, beside its own. For choices: `solve`.
        seed, start, time_limit, workers, progress, callback, checkpoint, cache
            As for `solve`. With `workers`, also 1, or a `cache`, the function gets one row at a time. A checkpoint knows only
            bounds and names of a function, so the caller must pass the same function again.

        Returns
        -------
        Front

        Raises
        ------
        ValueError
            If an argument is not valid, the function returns arrays of a wrong shape, or the checkpoint is damaged or of another run.
        OSError
            If the checkpoint cannot be written; before any work.
        """
        call = Call(self._budget(None, evaluations), seed, tolerance, time_limit, workers, progress, callback, checkpoint, cache)
        problem = plain_problem(function, bounds, constraints=constraints, names=names, units=units, senses=senses, integer=integer)
        what = {
            "bounds": {v.name: (v.lower, v.upper) for v in problem.variables},
            "objectives": {"number": len(problem.goals) or None, "names": names, "units": units, "senses": senses},
            "constraints": constraints is not None,
            **({"kinds": kinds(problem.variables)} if kinds(problem.variables) else {}),
        }
        return self._search_vector(problem, start, call, what)

    def _budget(self, problem: Any, evaluations: int | None) -> int | None:
        """The number of evaluations that is given, or the problem's own; None if the search needs none. Raises ValueError if it does."""
        if evaluations is not None or self.searches_until_done:
            return evaluations
        own = problem.default_evaluations if isinstance(problem, Problem | VectorProblem) else None
        if own is None:
            named = f"problem '{problem.name}' has no number of its own" if getattr(problem, "name", "") else "there is no number"
            raise ValueError(
                f"evaluations: {named}, and {type(self).__name__} needs one: pass evaluations=N, or set problem.default_evaluations; "
                "only MACS searches until it is done"
            )
        return own

    def _solve_vector(self, problem: CompiledVectorProblem, start: Any, verify: float | None, call: Call) -> Front:
        """`solve` of a vector problem, each point of whose front is evaluated again in the end."""
        drawn = drawing(start)
        if isinstance(drawn, Smooth):
            raise ValueError(f"start: {without_dynamics(problem.name)}, so there are no smooth profiles")
        self.check_vector(problem)
        what = {"problem": {"name": problem.name, "fingerprint": problem.fingerprint}}
        front = self._search_vector(problem, None if drawn else start, call, what)
        try:
            with processes(call.workers):
                return Front.of(with_nearest(front)).verify(verify)
        except Exception as error:
            return _not_simulated(front, error)

    def _search_vector(self, problem: CompiledVectorProblem, start: Any, call: Call, what: dict[str, Any]) -> Front:
        """The front of a vector problem as a search leaves it; `what` says for its checkpoint which problem that is."""
        cache = None if call.cache is None else RowCache(call.cache, problem.fingerprint)
        box, about = BlackBox(problem, call.tolerance, apart=call.workers is not None, cache=cache), self.about()
        if problem.goals:
            self.check_objectives(len(problem.goals))
            self.check_goals(problem.goals)

        def make_front(state: Any, stats: dict[str, Any]) -> Front:
            named = problem if problem.name else None
            if state is None:  # the function itself asked whether to end
                return Front.of(no_points(() if box.m_known is None else box.goals, named, about, stats))
            return Front.of(from_vector_problem(problem, state.archive, state.closest, box.goals, about, stats))

        first = None if start is None else decisions(start, problem.variables)
        with processes(call.workers), closing(cache) if cache else nullcontext():
            return SearchRun(self, box, make_front, call, first, {"solver": about, **what}).go()


def _or_ends(front: Front, chosen: SearchMeshes | None) -> Front:
    """A front, or, where the search was to end before it found a point, the ends that were known by then."""
    if len(front) or front.stats["stopped"] in ENDED or chosen is None or chosen.ends is None:
        return front
    message = "The search ended before it began: these are ends of the front."
    return Front.of(chosen.ends.replace(solver=front.solver, stats=front.stats, message=message))


def _not_simulated(front: Front, error: Exception) -> Front:
    """The front as the search left it, with a message: an error after a long search must not lose its front."""
    log.warning("what follows the search failed; the front is as the search left it", exc_info=True)
    failed = f"not simulated, since this failed ({type(error).__name__}: {' '.join(str(error).split())})"
    return front.replace(message="; ".join(filter(None, [front.message, failed])))


SOLVERS: dict[str, str] = {
    "macs": "macs.search.macs:MACS",
    "nsga2": "macs.baselines.algorithms:NSGA2",
    "nsga3": "macs.baselines.algorithms:NSGA3",
    "moead": "macs.baselines.algorithms:MOEAD",
    "mopso": "macs.baselines.swarms:MOPSO",
    "mopsocd": "macs.baselines.swarms:MOPSOCD",
    "smsemoa": "macs.baselines.algorithms:SMSEMOA",
    "agemoea2": "macs.baselines.algorithms:AGEMOEA2",
    "rvea": "macs.baselines.algorithms:RVEA",
    "ctaea": "macs.baselines.algorithms:CTAEA",
    "decide": "macs.decision_solver:Decide",
    "optimum": "macs.gradient_solvers:Optimum",
    "payoff": "macs.gradient_solvers:Payoff",
    "sweep": "macs.gradient_solvers:Sweep",
}
"""Module and class of each solver, imported only when needed."""
PAPER = "paper"
"""In a study file, `{solver = "macs", paper = true}`: the settings of the paper. Also the name of the method of a class that has them."""


def solver_class(name: str) -> type[Solver]:
    """The class of a solver by its name. Raises ValueError, with the known names, for an unknown name."""
    place = SOLVERS.get(name.lower())
    if place is None:
        raise ValueError(unknown("solver", name, SOLVERS))
    module, _, item = place.partition(":")
    return getattr(importlib.import_module(module), item)


def solver(name: str, **settings: Any) -> Solver:
    """A solver by name, with its settings; `paper=True` takes those of its paper (`MACS.paper`), if there are any, except given ones."""
    kind = solver_class(name)
    known = inspect.signature(kind).parameters
    paper = settings.pop(PAPER, False)
    if paper not in (True, False):
        raise ValueError(f"solver '{name}': {PAPER} must be true or false, not {paper!r}")
    as_published = getattr(kind, PAPER, None)
    if paper and as_published is None:
        raise ValueError(f"solver '{name}' has no settings of a paper")
    gone = getattr(kind, "gone", {})
    for key in settings:
        if key in gone:
            raise ValueError(f"solver '{name}': {key} is no setting any more: {gone[key]}")
        if key not in known:
            raise ValueError(unknown(f"setting of solver '{name}'", key, known))
    return as_published(**settings) if paper and as_published else kind(**settings)
