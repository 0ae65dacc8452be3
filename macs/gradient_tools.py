"""Gradient tools: single optima, the ends of a front, and sweeps along it, by exact derivatives on one mesh.

Results are local optima, the best of those that were found from several starts.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from problems.checks import check_count, check_interval
from problems.compiled import CompiledProblem
from problems.problem import Problem
from problems.sampling import refuse_peaks
from transcription.base import Transcription, check_freedom, check_problem
from transcription.meshes.verdict import Wanted
from transcription.nlp.derivatives import refuse_dense
from transcription.nlp.program import nlp_scales
from transcription.nlp.scalarized import Solved
from transcription.stopping import Stopped

from .evaluation.evaluator import CONVERGED, INFEASIBLE
from .front import Front
from .fronts.builders import certified, conflict, from_vectors, no_points
from .fronts.curve import GAPS
from .fronts.point import Point
from .fronts.points import Points
from .fronts.provenance import costs
from .fronts.verified import VERIFY, check_verify
from .gradients.ends import ENDS, METHODS, check_points, lexicographic_ends, solve_tasks, tasks_between
from .gradients.multistart import MultistartSolver, MultistartStopping, Rules
from .gradients.scalarised import END, MOST_ITERATIONS, WEAK, WORK, GradientSolves, Scalarised
from .gradients.tracing import CurveTrace
from .io.console import working
from .io.workers import Workers
from .pareto.dominance import distinct, separate
from .refinement.mending import mended, resolve_unverified
from .refinement.mesh_loop import MeshLoop, Programs
from .refinement.mesh_search import SEARCH, MeshSearch, coarse_meshes, search_meshes
from .solvers.start import Call, beginning

AUTO = "auto"
"""As many starts as pay."""


NO_RANGE, NOTHING = 1e-8, 1e-10
"""An objective whose values at the ends differ by less than these fractions of its size, or of its scale, is in no conflict."""


def optimize(
    problem: Problem | CompiledProblem,
    transcription: Transcription | None = None,
    *,
    objective: str | None = None,
    start: Any = None,
    starts: int | str = "auto",
    seed: int | None = 0,
    tolerance: float = 1e-6,
    verify: float | None = VERIFY,
    max_iterations: int = MOST_ITERATIONS,
    time_limit: float | None = None,
    workers: Workers | None = None,
    progress: bool | None = None,
) -> Point:
    """The optimum of one objective; the others are ignored.

    Parameters
    ----------
    problem : Problem
    transcription : Transcription, optional
        Default: the problem's own, or DFET on a coarse mesh; points that are not verified there are then solved again on meshes of their
        own. On a transcription that is given, points are only marked.
    objective : str, optional
        Name of the objective. Default: the first one.
    start : Front, Points or array (k, n), optional
        Decisions to begin with, all variables or the free ones only; the best of them is used.
    starts : int or "auto"
        Number of starts: the first is `start` or the problem's guess, the others are drawn: from everywhere in the bounds, and near the
        best that is known. The best result is returned. "auto": as many as pay; some twenty where each finds the same, fewer where a solve
        takes long, one where a linear objective is at its bound. `stats` of the point has the number of `starts`, how many different
        `optima` they found, and how often that which is returned was `found`; if only once, its `message` says so: there may be better
        ones.
    seed : int, optional
        Seed of the starts that are drawn. None draws one, which is recorded in `stats`.
    tolerance : float
        Largest scaled residual of a feasible point.
    verify : float, optional
        Largest error, scaled as in `Front.verify`, that an independent simulation may show in a `verified` point. None: not simulated.
    max_iterations : int
        Most iterations of IPOPT in one solve, all its strategies together.
    time_limit : float, optional
        Seconds after which the results so far are returned, as after Ctrl-C. With none, `optimize` on its own mesh raises TimeoutError.
    workers : int, "all" or Executor, optional
        Processes that work side by side, "all" for one for each core, or a `concurrent.futures.Executor`. The result is the
        same, to the last bit. Other processes than this one begin after a second of work. Default: 1.
    progress : bool, optional
        Show the progress on stderr. Default: on a terminal and in a notebook, from the third second on.

    Returns
    -------
    Point
        With its `optimality`, simulated. If no solve converged, the least infeasible point, with its status.

    Raises
    ------
    ValueError
        If the problem is not stated correctly, an argument is not valid, or a peak is neither minimised nor bounded above; before any work.

    Examples
    --------
    >>> from macs import optimize
    >>> from problems import load
    >>> from transcription import DFET
    >>> best = optimize(load("goddard"), DFET(4, 6), objective="horizontal speed", starts=1)
    >>> round(best.objectives["horizontal speed"], 4)
    0.9039
    """
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, workers, progress)
    job = _Job("optimize", problem, transcription, terms, objective=objective)
    names = [goal.name for goal in job.problem.goals]
    if objective is not None and objective not in names:
        raise ValueError(f"there is no objective {objective!r}; there are {', '.join(names)}")
    i = 0 if objective is None else names.index(objective)
    return job.optimum(i)[0]


def payoff(
    problem: Problem | CompiledProblem,
    transcription: Transcription | None = None,
    *,
    start: Any = None,
    starts: int | str = "auto",
    seed: int | None = 0,
    tolerance: float = 1e-6,
    verify: float | None = VERIFY,
    max_iterations: int = MOST_ITERATIONS,
    time_limit: float | None = None,
    workers: Workers | None = None,
    progress: bool | None = None,
) -> Front:
    """The ends of the front: for each objective its best value, and for that the best values of the others, in their order.

    Parameters
    ----------
    problem, transcription, start, starts, seed, tolerance, verify, max_iterations, time_limit, workers, progress
        As for `optimize`; with "auto", the `starts`, `optima` and `found` of `stats` are by the names of objectives.

    Returns
    -------
    Front
        Exactly one point for each objective, in the order of their declaration. The `status` of a point says whether it converged. Where
        nothing feasible is found, all are the least infeasible point, and `message` names what it violates.

    Raises
    ------
    ValueError
        As for `optimize`.

    Examples
    --------
    >>> import macs, problems
    >>> len(macs.payoff(problems.load("goddard"), starts=1))
    2
    """
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, workers, progress)
    job = _Job("payoff", problem, transcription, terms)

    def work() -> Front:
        ends = lexicographic_ends(job.solver)
        front = job.front(ends, job.ranges(ends), sort=False)
        return front if job.solver.closest is None else front.replace(message=f"nothing feasible was found; {conflict(job.nlp, front[0])}")

    return job.run(work, resolve_unverified, ends=True)


def sweep(
    problem: Problem | CompiledProblem,
    transcription: Transcription | None = None,
    *,
    points: int | None = None,
    error: float | None = None,
    method: str = "pascoletti-serafini",
    start: Any = None,
    starts: int | str = "auto",
    seed: int | None = 0,
    tolerance: float = 1e-6,
    verify: float | None = VERIFY,
    max_iterations: int = MOST_ITERATIONS,
    time_limit: float | None = None,
    workers: Workers | None = None,
    progress: bool | None = None,
) -> Front:
    """A front by gradient solves along it, each from the best point found before.

    Parameters
    ----------
    problem, transcription, start, starts, seed, tolerance, verify, max_iterations, time_limit, workers, progress
        As for `optimize`; each point is solved from so many `starts`. "auto": the optimum of each objective from as many as pay, see
        `payoff`; the points between, each from the one before, then from others as long as these find better ones.
    points : int, optional
        Number of points, ends included; a maximum with three or more objectives. Default: what `error` takes; needed where it has no use.
    error : float, optional
        With two objectives, instead of a number of points: points are solved where the curve of the front errs most (`Front.curve`), until
        its estimated error, in ranges of the objectives, is less; at most 100. Kinks and gaps are found on the way. Default: 1e-3.
    method : "pascoletti-serafini" or "epsilon"
        "pascoletti-serafini": from evenly spread points on the line, or simplex, between the ends, all objectives are decreased in
        proportion to their ranges, which spreads the points evenly (Pascoletti and Serafini 1984; Das and Dennis 1998). "epsilon": the
        first objective is optimised at evenly spread limits of the others (Haimes, Lasdon and Wismer 1971).

    Returns
    -------
    Front
        Points that converged, mutually non-dominated. `message` says how many were left out and, if none converged, why; and if the error
        is larger than was asked for. `stats["gaps"]` has pairs of values of the first objective between which there are no points.

    Raises
    ------
    ValueError
        As for `optimize`; also for an unknown method, fewer points than objectives, a problem with one objective, and `error` beside
        `points`, by another method, or with three or more objectives.

    Examples
    --------
    >>> import macs, problems
    >>> len(macs.sweep(problems.load("goddard"), points=3, starts=1))
    3
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}; there are {', '.join(METHODS)}")
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, workers, progress)
    if points is not None and error is not None:
        raise ValueError("give either points or error: with error, as many points are solved as it takes")
    check_count("points", 2 if points is None else points, 2)
    error = VERIFY if points is None and error is None else error
    check_interval("error", 1.0 if error is None else error, "(0, 1]")
    settings = {"error": error} if points is None else {"points": int(points)}
    job = _Job("sweep", problem, transcription, terms, **settings, method=method)
    m = len(job.problem.goals)
    if points is None and (m > 2 or method != METHODS[0]):
        raise ValueError(f"error is for fronts of two objectives by {METHODS[0]!r}; give points instead")
    check_points(points or m, m)
    return job.run(
        partial(job.swept, points or 0, method, error), lambda front, verify: mended(front, verify, ends=job.ends, size=points or 0)
    )


def check_starts(name: str, starts: int | str) -> None:
    """Raise ValueError unless it is a number of starts or "auto"."""
    if isinstance(starts, str) and starts != AUTO:
        raise ValueError(f"{name} must be a whole number or {AUTO!r}, not {starts!r}")
    if starts != AUTO:
        check_count(name, starts, 1)


@dataclass(frozen=True)
class Terms:
    """The arguments that all gradient tools have; see `optimize`."""

    start: Any
    starts: int | str
    seed: int | None
    tolerance: float
    verify: float | None
    max_iterations: int
    time_limit: float | None
    workers: Workers | None
    progress: bool | None

    def __post_init__(self) -> None:
        Call(None, self.seed, self.tolerance, self.time_limit, self.workers)
        check_starts("starts", self.starts)
        check_count("max_iterations", self.max_iterations, 1)
        check_verify(self.verify)

    @property
    def count(self) -> int | None:
        """Number of starts; None for as many as pay."""
        return None if self.starts == AUTO else int(self.starts)

    @property
    def settings(self) -> dict[str, Any]:
        """Those that a front records."""
        return {"starts": self.starts if self.starts == AUTO else int(self.starts)}


class _Job:
    """One call of a gradient tool: its NLP, its solver, and the front made of its results."""

    def __init__(
        self, name: str, problem: Problem | CompiledProblem, transcription: Transcription | None, terms: Terms, **settings: Any
    ) -> None:
        check_problem(problem, transcription)
        self._statement, self.problem = problem, problem.compile()
        refuse_peaks(self.problem)
        self._terms, self.fixed = terms, transcription is not None
        self._seed = secrets.randbits(63) if terms.seed is None else int(terms.seed)
        self._rng = np.random.default_rng(self._seed)
        self._about = {"name": name, "settings": {**settings, **terms.settings}}
        self._stopped = ""
        self._sole: np.ndarray | None = None
        self._certificates = dict[Any, dict[str, Any]]()
        self.ends: Points | None = None  # those by which the mesh was found, on their own meshes
        self._stopping: dict[int, MultistartStopping] = {}
        self.solves = GradientSolves(float(terms.tolerance), int(terms.max_iterations))
        self._began = time.perf_counter()
        if transcription is not None:
            self.begin(transcription)

    def begin(self, transcription: Transcription, ends: Points | None = None, stopping: Rules | None = None) -> None:
        """Work on this transcription from now on, with what is known of the ends on another mesh."""
        self.nlp = transcription.transcribe(self.problem)
        check_freedom(self.nlp)
        refuse_dense(self.nlp)
        known = [beginning(self._terms.start, self.nlp), beginning(ends, self.nlp, guess=False)]
        given = [Z for Z in known if Z is not None]
        self.solver = MultistartSolver(self.nlp, np.vstack(given) if given else None, self._terms.count, self._rng, self.solves)
        self.solver.stopping.update(stopping or {})
        self._stopping = self.solver.stopping

    def run(self, work: Callable[[], Front], again: Callable[[Points, float], Points], ends: bool = False) -> Front:
        """The front that `work` returns, on the transcription that was given or on one that is found, simulated; where only its `ends` are
        asked for, those by which the mesh was found, on meshes of their own.

        Within, the time limit and Ctrl-C ask the work to end, and its progress is shown. Unless the transcription was given, points that
        are not verified are solved again by `again`.
        """
        verify = self._terms.verify
        with working(self._terms.time_limit, self._terms.progress, self._terms.workers) as (show, interrupts):
            self.solves.before = lambda: show(f"{self._about['name']}: {self.solves.counts.gradient_solves} gradient solves done")
            try:
                own = None
                if not self.fixed:
                    given, told = partial(beginning, self._terms.start), (verify or VERIFY, self.solves.tolerance, show)
                    chosen = search_meshes(self._statement, *told, given, self._terms.count)
                    self.solves.counts, self._stopping = chosen.counts, dict(chosen.rules)
                    self.ends = chosen.ends
                    own = chosen.ends if ends and chosen.ends and len(chosen.ends) == len(self.problem.goals) else None
                    if own is None:
                        self.begin(chosen.fine or chosen.search, chosen.ends, chosen.rules)
                front = work() if own is None else Front.of(own.replace(solver=self._about, stats=self._stats()))
            except Stopped as reason:
                self._stopped = str(reason)
                return Front.of(no_points(self.problem.goals, self.problem, self._about, self._stats()))
            self._stopped = interrupts.reason
            words = "; ".join(filter(None, [front.message, _found_once(self._told())]))
            front = front.replace(stats=front.stats | self._stats(), message=words)
            return front.verify(verify) if self.fixed or verify is None else Front.of(again(front, verify))

    def optimum(self, i: int) -> Front:
        """The optimum of objective i as a front of one point, simulated: on the given transcription, or on a mesh that is found for it."""
        task = Scalarised.single(i, len(self.problem.goals))
        self._sole = task.used
        if self.fixed:
            return self.run(lambda: self.front([self.solver.single(i)], None), resolve_unverified)
        terms, verify = self._terms, self._terms.verify
        limits = SEARCH.optimum * (verify or VERIFY)
        with working(terms.time_limit, terms.progress, terms.workers) as (show, interrupts):
            self.solves.before = lambda: show(f"{self._about['name']}: {self.solves.counts.gradient_solves} gradient solves done")
            wanted = Wanted(limits, feasible=limits, leaving=limits, objectives=limits)
            loop = MeshLoop(Programs(self.problem), self.solves, wanted, SEARCH.meshes, WORK.most)
            search = MeshSearch(loop, [task], partial(beginning, terms.start), terms.count, self._rng)
            try:
                search.go(coarse_meshes(self._statement))
            except Stopped as reason:
                words = f"{self._about['name']}: {reason} before the first solve"
                raise (KeyboardInterrupt(words) if str(reason) == "interrupted" else TimeoutError(words)) from None
            found = search.best(0)
            self._stopped = interrupts.reason
            told = {"starts": found.rule.converged, "optima": found.optima, "found": found.hits}
            points = from_vectors(
                found.nlp,
                found.z[None],
                self._about,
                self._stats() | told,
                message=_found_once({self.problem.goals[i].name: told}),
                status=[found.status],
                notes=[found.note],
                **certified(found.nlp, found.z[None], None, self._sole),
            )
            if found.status == INFEASIBLE:
                points = points.replace(notes=[f"{found.note}; {conflict(found.nlp, points[0])}"])
            return Front.of(points).verify(verify)

    def swept(self, points: int, method: str, error: float | None) -> Front:
        """The front of a sweep, with so many points or a curve that errs by less; its ends alone if one of them was not found."""
        found = list[Solved]()
        for _ in range(ENDS.from_rivals):
            ends, trace = lexicographic_ends(self.solver), None
            ranges = self.ranges(ends)
            if any(end.status != CONVERGED for end in ends):
                return self.sifted(ends)
            if error is not None and ranges.all():
                trace = CurveTrace(self.solver, [*ends, *found], partial(self._weights, ranges=ranges), error)
                found = trace.go()
            else:
                found = solve_tasks(self.solver, tasks_between(np.array([end.F for end in ends]), ranges, points, method))
            if not self.surpassed(ends, found):
                break
        if trace is None:
            return self.sifted([*ends, *found], ranges)
        front, left = self.sifted(trace.points() or trace.found, ranges), trace.curve.error
        missed = "" if left <= trace.wanted else f"the curve errs by about {left:.1e} of the ranges, and not by less than {error:g}"
        gaps = [sorted(float(front.signs[0] * one.F[0]) for one in gap) for gap in trace.gaps]
        return front.replace(stats=front.stats | {GAPS: gaps}, message="; ".join(filter(None, [front.message, missed])))

    def _weights(self, solved: Solved, ranges: np.ndarray) -> np.ndarray | None:
        """The weights (m,) of the objectives at a result; None where they are not known."""
        known = self._certificate(solved.z, ranges)["costates"]
        return None if known is None else known.weights

    def _certificate(self, z: np.ndarray, ranges: np.ndarray | None) -> dict[str, Any]:
        """The entries of `certified` for a vector, found once."""
        key = z.tobytes(), str(ranges)
        if key not in self._certificates:
            self._certificates[key] = {name: one for name, (one,) in certified(self.nlp, z[None], ranges, self._sole).items()}
        return self._certificates[key]

    def ranges(self, ends: Sequence[Solved]) -> np.ndarray:
        """Ranges (m,) of the objectives between the ends; 0 for one that is in conflict with no other."""
        F = np.array([end.F for end in ends])
        ranges, sizes = np.ptp(F, axis=0), np.abs(F).max(axis=0)
        return np.where(ranges > np.maximum(NO_RANGE * sizes, NOTHING * nlp_scales(self.nlp)), ranges, 0.0)

    def surpassed(self, ends: Sequence[Solved], found: Sequence[Solved]) -> bool:
        """Whether a sweep found a better value of an objective than its end, which then is only a local optimum."""
        F = np.array([solved.F for solved in found if solved.status == CONVERGED]).reshape(-1, len(ends))
        best = np.array([end.F[i] for i, end in enumerate(ends)])
        # What an end has lost to the others is none.
        return bool((best - F > 2 * END.slack * self._unit(self.ranges(ends))).any())

    def _unit(self, ranges: np.ndarray | None) -> np.ndarray:
        scales = nlp_scales(self.nlp)
        return scales if ranges is None else np.where(ranges > 0, ranges, scales)

    def sifted(self, found: Sequence[Solved], ranges: np.ndarray | None = None) -> Front:
        """The front of the results that converged, without dominated and equal points."""
        good = [solved for solved in found if solved.status == CONVERGED]
        if not good:
            nearest = self.front([min(found, key=lambda solved: solved.violation)], None)[0]
            return self.front([], None, message=f"no solve converged; {conflict(self.nlp, nearest)}", closest=nearest)
        F = np.array([solved.F for solved in good])
        # Rounded to the accuracy of the solves: otherwise one of two equal points might dominate the other.
        kept = distinct(F, self._unit(ranges))
        kept[kept] = separate(F[kept], self._unit(ranges))
        left = {"did not converge": len(found) - len(good), "dominated or equal": int(np.count_nonzero(~kept))}
        message = ", ".join(f"{count} {word}" for word, count in left.items() if count)
        chosen = [solved for solved, keep in zip(good, kept, strict=True) if keep]
        return self.front(chosen, ranges, message=message and f"of {len(found)} points left out: {message}")

    def front(self, found: Sequence[Solved], ranges: np.ndarray | None, **more: Any) -> Front:
        """The results as a front, with their optimality and costates; objectives are scaled by `ranges` (m,)."""
        Z = np.array([solved.z for solved in found]).reshape(len(found), len(self.nlp.variables))
        status, notes = [solved.status for solved in found], [WEAK if solved.message == WEAK else "" for solved in found]
        columns = [self._certificate(z, ranges) for z in Z]
        more |= {"status": status, "notes": notes, **{name: [one[name] for one in columns] for name in (columns[0] if columns else ())}}
        return Front.of(from_vectors(self.nlp, Z, self._about, self._stats(), **more))

    def _stats(self) -> dict[str, Any]:
        counts = self.solves.counts
        return costs(
            counts,
            wall_time=time.perf_counter() - self._began,
            seed=self._seed,
            tolerance=self.solves.tolerance,
            reproducible=not (counts.clocked or self._stopped),
            **({"stopped": self._stopped} if self._stopped else {}),
            **self._starts(),
        )

    def _told(self) -> dict[str, dict[str, int]]:
        """Starts that were made, different optima and how often the best was found, by the name of the objective."""
        return {
            self.problem.goals[i].name: {"starts": one.starts, "optima": one.optima(), "found": one.hits()}
            for i, one in self._stopping.items()
        }

    def _starts(self) -> dict[str, Any]:
        """The numbers of `_told`: of the only objective that was sought, or by name."""
        told = self._told()
        if self._sole is not None:
            return next(iter(told.values()), {})
        return {key: {name: numbers[key] for name, numbers in told.items()} for key in ("starts", "optima", "found") if told}


def _found_once(told: Mapping[str, Mapping[str, int]]) -> str:
    """Words on optima of single objectives that one start alone has found."""
    names = [f"that of '{name}' in {one['starts']}" for name, one in told.items() if one["found"] == 1 < one["starts"]]
    return f"optima that one start alone found, so that there may be better ones: {', '.join(names)}" if names else ""
