"""Gradient tools: single optima, the ends of a front, and sweeps along it, by exact derivatives on one mesh.

Results are local optima: they depend on the start.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from problems.checks import check_count
from problems.compiled import CompiledProblem
from problems.peaks import refuse_peaks
from problems.problem import Problem
from transcription.base import Transcription, check_freedom, check_problem
from transcription.nlp.optimality import optimality
from transcription.nlp.scalarized import Solved
from transcription.nlp.scaling import nlp_scales

from .evaluation.evaluator import CONVERGED
from .front import Front
from .fronts.builders import nearest_violation, vectors_points
from .fronts.points import Point
from .fronts.provenance import costs
from .fronts.verified import VERIFY, check_verify
from .gradients.first_mesh import default_transcription
from .gradients.mending import mended
from .gradients.multistart import MOST_ITERATIONS, MultistartSolver
from .io.console import working
from .io.interrupts import NO_TIME, Interrupts
from .pareto.directions import divisions_below, simplex_lattice
from .pareto.ranges import BETTER, distinct
from .solvers.start import beginning, check_run

ROUNDS = 3
"""Largest number of times that points or ends of a sweep are solved again from a better start that another point gave."""


NO_RANGE, NOTHING = 1e-8, 1e-10
"""An objective whose values at the ends differ by less than these fractions of its size, or of its scale, is in no conflict."""


def optimize(
    problem: Problem | CompiledProblem,
    transcription: Transcription | None = None,
    *,
    objective: str | None = None,
    start: Any = None,
    starts: int = 1,
    seed: int | None = 0,
    tolerance: float = 1e-6,
    verify: float | None = VERIFY,
    max_iterations: int = MOST_ITERATIONS,
    time_limit: float | None = None,
    progress: bool = False,
) -> Point:
    """The local optimum of one objective; the others are ignored.

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
    starts : int
        Number of starts: the first is `start` or the problem's guess, the others are random. The best result is returned.
    seed : int, optional
        Seed of the random starts. None draws one, which is recorded in `stats`.
    tolerance : float
        Largest scaled residual of a feasible point.
    verify : float, optional
        How much a point may miss when it is simulated, in scales, and still be `verified`; see `Front.verify`. None: it is not simulated.
    max_iterations : int
        Most iterations of IPOPT in one strategy of a solve.
    time_limit : float, optional
        Seconds after which the work ends with its results so far.
    progress : bool
        Show the progress on the terminal.

    Returns
    -------
    Point
        With its `optimality`, simulated. If no solve converged, the least infeasible point, with its status.

    Raises
    ------
    ValueError
        If the problem is not stated correctly, an argument is not valid, or a peak is neither minimised nor bounded above; before any work.
    """
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, progress)
    job = _Job("optimize", problem, transcription, terms, objective=objective)
    names = [goal.name for goal in job.nlp.problem.goals]
    if objective is not None and objective not in names:
        raise ValueError(f"there is no objective {objective!r}; there are {', '.join(names)}")
    i = 0 if objective is None else names.index(objective)
    reference = np.where(np.arange(len(names)) == i, 0.0, np.inf)
    with job.working():
        found = job.front([job.solver.solve(reference, np.eye(len(names))[i])], None)
    return job.settled(found)[0]


def payoff(
    problem: Problem | CompiledProblem,
    transcription: Transcription | None = None,
    *,
    start: Any = None,
    starts: int = 1,
    seed: int | None = 0,
    tolerance: float = 1e-6,
    verify: float | None = VERIFY,
    max_iterations: int = MOST_ITERATIONS,
    time_limit: float | None = None,
    progress: bool = False,
) -> Front:
    """The ends of the front: for each objective its best value, and for that the best values of the others, in their order.

    Parameters
    ----------
    problem, transcription, start, starts, seed, tolerance, verify, max_iterations, time_limit, progress
        As for `optimize`.

    Returns
    -------
    Front
        Exactly one point for each objective, in the order of their declaration. The `status` of a point says whether it converged.

    Raises
    ------
    ValueError
        As for `optimize`.
    """
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, progress)
    job = _Job("payoff", problem, transcription, terms)
    with job.working():
        ends = job.ends()
        found = job.front(ends, job.ranges(ends), sort=False)
    return job.settled(found, sifted=False)


def sweep(
    problem: Problem | CompiledProblem,
    transcription: Transcription | None = None,
    *,
    points: int,
    method: str = "pascoletti-serafini",
    start: Any = None,
    starts: int = 1,
    seed: int | None = 0,
    tolerance: float = 1e-6,
    verify: float | None = VERIFY,
    max_iterations: int = MOST_ITERATIONS,
    time_limit: float | None = None,
    progress: bool = False,
) -> Front:
    """A front by gradient solves along it, each from the best point found before.

    Parameters
    ----------
    problem, transcription, start, starts, seed, tolerance, verify, max_iterations, time_limit, progress
        As for `optimize`; each point is solved from so many `starts`.
    points : int
        Number of points, the ends included; with three or more objectives, the largest number.
    method : "pascoletti-serafini" or "epsilon"
        "pascoletti-serafini": from evenly spread points on the line, or simplex, between the ends, all objectives are decreased in
        proportion to their ranges, which spreads the points evenly (Pascoletti and Serafini 1984; Das and Dennis 1998). "epsilon": the
        first objective is optimised at evenly spread limits of the others (Haimes, Lasdon and Wismer 1971).

    Returns
    -------
    Front
        Points that converged, mutually non-dominated. `message` says how many were left out and, if none converged, why.

    Raises
    ------
    ValueError
        As for `optimize`; also for an unknown method, fewer points than objectives, and a problem with one objective.
    """
    check_count("points", points, 2)
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}; there are {', '.join(METHODS)}")
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, progress)
    job = _Job("sweep", problem, transcription, terms, points=int(points), method=method)
    check_points(points, len(job.nlp.problem.goals))
    with job.working():
        front = job.swept(points, method)
    return job.settled(front)


@dataclass(frozen=True)
class Terms:
    """The arguments that all gradient tools have; see `optimize`."""

    start: Any
    starts: int
    seed: int | None
    tolerance: float
    verify: float | None
    max_iterations: int
    time_limit: float | None
    progress: bool

    def __post_init__(self) -> None:
        check_run(1, self.seed, self.tolerance, self.time_limit, None, None)
        check_count("starts", self.starts, 1)
        check_count("max_iterations", self.max_iterations, 1)
        check_verify(self.verify)


class _Job:
    """One call of a gradient tool: its NLP, its solver, and the front made of its results."""

    def __init__(
        self, name: str, problem: Problem | CompiledProblem, transcription: Transcription | None, terms: Terms, **settings: Any
    ) -> None:
        check_problem(problem, transcription)
        compiled = problem.compile()
        refuse_peaks(compiled)
        self.nlp = (transcription or default_transcription(problem)).transcribe(compiled)
        check_freedom(self.nlp)
        self._terms, self._fixed = terms, transcription is not None
        self._seed = secrets.randbits(63) if terms.seed is None else int(terms.seed)
        given = beginning(terms.start, self.nlp)
        self._began = time.perf_counter()
        self._interrupts: Interrupts | None = None
        rng = np.random.default_rng(self._seed)
        self.solver = MultistartSolver(self.nlp, given, int(terms.starts), rng, float(terms.tolerance), int(terms.max_iterations))
        self._about = {"name": name, "settings": {**settings, "starts": int(terms.starts)}}

    @contextmanager
    def working(self) -> Iterator[None]:
        """Within, the time limit and Ctrl-C ask the work to end, and its progress is shown."""
        with working(self._terms.time_limit, self._terms.progress) as (show, interrupts):
            self._interrupts = interrupts
            self.solver.tell(lambda: show(f"{self._about['name']}: {self.solver.counts.gradient_solves} gradient solves done"))
            yield

    @property
    def _stopped(self) -> str:
        """The reason why the work was ended early; empty if it was not."""
        return "" if self._interrupts is None else self._interrupts.reason

    def settled(self, front: Front, sifted: bool = True) -> Front:
        """The front, simulated; unless its transcription was given, with points that are not verified solved again. All of its points,
        unless it is to be `sifted`."""
        marked = front.verify(self._terms.verify)
        if self._fixed or self._stopped or self._terms.verify is None:
            return marked
        limit = self._terms.time_limit
        left = None if limit is None else max(limit - (time.perf_counter() - self._began), NO_TIME)
        return Front.of(mended(marked, left, self._terms.progress, sifted))

    def swept(self, points: int, method: str) -> Front:
        """The front of a sweep; its ends alone if one of them was not found."""
        for _ in range(ROUNDS):
            ends = self.ends()
            if any(end.status != CONVERGED for end in ends):
                return self.sifted(ends)
            found = self.along(targets(np.array([end.F for end in ends]), self.ranges(ends), points, method))
            if not self.surpassed(ends, found):
                break
        return self.sifted([*ends, *found], self.ranges(ends))

    def ends(self) -> list[Solved]:
        """The lexicographic optimum of each objective."""
        return [self.solver.lexicographic(i) for i in range(len(self.nlp.problem.goals))]

    def along(self, tasks: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Solved]:
        """The results of all tasks (reference, weights), in their order.

        A result that is better for another task than that task's own result becomes a start for it. With several `starts`, each task is
        also solved from the result of the next one.
        """
        solver = self.solver
        found = [solver.solve(*task) for task in tasks]

        def again(k: int, start: np.ndarray) -> None:
            found[k] = solver.better([found[k], solver.from_vector(start, *tasks[k])], *tasks[k])

        if solver.starts > 1:
            for k in range(len(tasks) - 2, -1, -1):
                again(k, found[k + 1].z)
        for _ in range(ROUNDS):
            rivals = [solver.rival(solved, *task) for solved, task in zip(found, tasks, strict=True)]
            for k, rival in enumerate(rivals):
                if rival is not None:
                    again(k, rival)
            if all(rival is None for rival in rivals):
                break
        return found

    def ranges(self, ends: Sequence[Solved]) -> np.ndarray:
        """Ranges (m,) of the objectives between the ends; 0 for one that is in conflict with no other."""
        F = np.array([end.F for end in ends])
        ranges, sizes = np.ptp(F, axis=0), np.abs(F).max(axis=0)
        return np.where(ranges > np.maximum(NO_RANGE * sizes, NOTHING * nlp_scales(self.nlp)), ranges, 0.0)

    def surpassed(self, ends: Sequence[Solved], found: Sequence[Solved]) -> bool:
        """Whether a sweep found a better value of an objective than its end, which then is only a local optimum."""
        F = np.array([solved.F for solved in found if solved.status == CONVERGED]).reshape(-1, len(ends))
        best = np.array([end.F[i] for i, end in enumerate(ends)])
        return bool((best - F > BETTER * self._unit(self.ranges(ends))).any())

    def _unit(self, ranges: np.ndarray | None) -> np.ndarray:
        scales = nlp_scales(self.nlp)
        return scales if ranges is None else np.where(ranges > 0, ranges, scales)

    def sifted(self, found: Sequence[Solved], ranges: np.ndarray | None = None) -> Front:
        """The front of the results that converged, without dominated and equal points."""
        good = [solved for solved in found if solved.status == CONVERGED]
        if not good:
            nearest = self.front([min(found, key=lambda solved: solved.violation)], None)[0]
            return self.front([], None, message=f"no solve converged; {nearest_violation(nearest)}", closest=nearest)
        F = np.array([solved.F for solved in good])
        # Rounded to the accuracy of the solves: otherwise one of two equal points might dominate the other.
        kept = distinct(F, self._unit(ranges))
        left = {"did not converge": len(found) - len(good), "dominated or equal": int(np.count_nonzero(~kept))}
        message = ", ".join(f"{count} {word}" for word, count in left.items() if count)
        chosen = [solved for solved, keep in zip(good, kept, strict=True) if keep]
        return self.front(chosen, ranges, message=message and f"of {len(found)} points left out: {message}")

    def front(self, found: Sequence[Solved], ranges: np.ndarray | None, **more: Any) -> Front:
        """The results as a front, with their optimality; objectives are scaled by `ranges` (m,)."""
        Z = np.array([solved.z for solved in found]).reshape(len(found), len(self.nlp.variables))
        certificates = [optimality(self.nlp, z, ranges) for z in Z]
        stats = costs(
            self.solver.counts,
            wall_time=time.perf_counter() - self._began,
            seed=self._seed,
            tolerance=self.solver.tolerance,
            reproducible=not (self.solver.counts.clocked or self._stopped),
            **({"stopped": self._stopped} if self._stopped else {}),
        )
        status = [solved.status for solved in found]
        return Front.of(vectors_points(self.nlp, Z, self._about, stats, status=status, optimality=certificates, **more))


METHODS = ("pascoletti-serafini", "epsilon")


Task = tuple[np.ndarray, np.ndarray]
"""Reference and weights, as `transcription.nlp.scalarized.scalarize` takes them."""


def check_points(points: int, m: int) -> None:
    """Raise ValueError if so many points are too few for a front of m objectives."""
    if m == 1:
        raise ValueError("a problem with one objective has no front to sweep; use optimize")
    if points < m:
        raise ValueError(f"points must be at least {m}, one for each objective, not {points}")


def targets(ends: np.ndarray, ranges: np.ndarray, points: int, method: str) -> list[Task]:
    """Scalarised problems whose solutions, with the ends, make a front of at most `points` points.

    Parameters
    ----------
    ends : array (m, m)
        Objectives, all minimised; row i is the end that is best in objective i.
    ranges : array (m,)
        Ranges of the objectives between the ends; 0 for one that is in conflict with no other.
    points : int
        Number of points, the ends included.
    method : "pascoletti-serafini" or "epsilon"

    Returns
    -------
    list of (reference (m,), weights (m,))
        With two objectives in the order along the front. Empty if the objectives are not in conflict.
    """
    if np.count_nonzero(ranges) < 2:
        return []
    return (_from_simplex if method == "pascoletti-serafini" else _at_limits)(ends, ranges, points)


def _from_simplex(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Task]:
    """Tasks from a lattice on the simplex between the ends, with the ranges as weights."""
    m = len(ends)
    inner = [share for share in simplex_lattice(m, divisions_below(m, points)) if share.max() < 1.0]
    # An objective with zero range has weight 0: its reference is a hard limit.
    level = np.where(ranges > 0, ends, ends.max(axis=0))
    return [(share @ level, ranges) for share in inner]


def _at_limits(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Task]:
    """Tasks for the first objective that is in conflict, at all combinations of evenly spread limits of the others."""
    m = len(ends)
    first, *others = np.flatnonzero(ranges > 0)
    levels = int((points - m) ** (1.0 / len(others)) + 1e-9)
    # With two objectives the loosest limit gives an end; with more, combinations with it are new points.
    shares = np.arange(1, levels + 1) / (levels + (len(others) == 1))
    tasks = []
    for combination in product(shares, repeat=len(others)):
        reference = ends.max(axis=0)
        reference[first] = 0.0
        reference[others] -= (1.0 - np.array(combination)) * ranges[others]
        tasks.append((reference, np.where(np.arange(m) == first, ranges, 0.0)))
    return tasks
