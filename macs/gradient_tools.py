"""Gradient tools: single optima, the ends of a front, and sweeps along it, by exact derivatives on one mesh.

They are exact where the problem is smooth, and local: the result depends on the start.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Sequence
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
from .fronts.builders import nearest_misses, vectors_points
from .fronts.points import Point
from .fronts.provenance import costs
from .gradients.multistart import MultistartSolver
from .pareto.directions import divisions_below, simplex_lattice
from .pareto.ranges import BETTER, distinct
from .solvers.start import beginning, check_run

ROUNDS = 3
"""How often points of a sweep, or its ends, are solved anew because another one turned out to be better for their purpose."""


NO_RANGE, NOTHING = 1e-8, 1e-10
"""An objective that differs between the ends by less than these fractions of its size there, or of its scale, is in no conflict."""


def optimize(
    problem: Problem | CompiledProblem,
    transcription: Transcription,
    *,
    objective: str | None = None,
    start: Any = None,
    starts: int = 1,
    seed: int | None = 0,
    tolerance: float = 1e-6,
) -> Point:
    """Minimise, or maximise, one objective and ignore the others.

    Parameters
    ----------
    problem : Problem
    transcription : Transcription
    objective : str, optional
        Its name; the first one by default.
    start : Front, Points or array (k, n), optional
        Decisions to begin with, all variables or the free ones only; the best of them is taken.
    starts : int
        From how many vectors to try, `start` or the problem's guess being the first, random ones the others; the best is kept.
    seed : int, optional
        Of the random ones. None draws one, which `stats` record.
    tolerance : float
        Largest scaled residual of a feasible point.

    Returns
    -------
    Point
        With `optimality`. Where nothing converged, the least infeasible vector that was met, with the status that says why.

    Raises
    ------
    ValueError
        If the problem is stated wrongly, an argument makes no sense, or a peak is used otherwise than minimised or bounded above; before
        any work.
    """
    job = _Job("optimize", problem, transcription, start, starts, seed, tolerance, objective=objective)
    names = [goal.name for goal in job.nlp.problem.goals]
    if objective is not None and objective not in names:
        raise ValueError(f"there is no objective {objective!r}; there are {', '.join(names)}")
    i = 0 if objective is None else names.index(objective)
    reference = np.where(np.arange(len(names)) == i, 0.0, np.inf)
    return job.front([job.solver.solve(reference, np.eye(len(names))[i])], None)[0]


def payoff(
    problem: Problem | CompiledProblem,
    transcription: Transcription,
    *,
    start: Any = None,
    starts: int = 1,
    seed: int | None = 0,
    tolerance: float = 1e-6,
) -> Front:
    """The ends of the front: for each objective its best value, and the best of the others that go with it, in their order.

    Parameters
    ----------
    problem, transcription, start, starts, seed, tolerance
        As for `optimize`.

    Returns
    -------
    Front
        Exactly one point an objective, in the order in which they were declared; what did not converge has its status.

    Raises
    ------
    ValueError
        As `optimize`.
    """
    job = _Job("payoff", problem, transcription, start, starts, seed, tolerance)
    ends = job.ends()
    return job.front(ends, job.ranges(ends), sort=False)


def sweep(
    problem: Problem | CompiledProblem,
    transcription: Transcription,
    *,
    points: int,
    method: str = "pascoletti-serafini",
    start: Any = None,
    starts: int = 1,
    seed: int | None = 0,
    tolerance: float = 1e-6,
) -> Front:
    """A front of solves along it, each beginning where the nearest one ended.

    Parameters
    ----------
    problem, transcription, start, starts, seed, tolerance
        As for `optimize`; `starts` holds for every point.
    points : int
        How many, the ends included; with three objectives or more, at most.
    method : "pascoletti-serafini" or "epsilon"
        From points evenly spread over the line, or simplex, between the ends, straight down to the front, all objectives falling in
        proportion to their ranges: which spreads the points evenly (Pascoletti and Serafini 1984; Das and Dennis 1998). Or the first
        objective at evenly spread limits of the others (Haimes, Lasdon and Wismer 1971).

    Returns
    -------
    Front
        Points that converged, mutually non-dominated. `message` says what was left out, and why it is empty if nothing converged.

    Raises
    ------
    ValueError
        As `optimize`; for an unknown method, or fewer points than objectives; and for a problem with one objective.
    """
    check_count("points", points, 2)
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}; there are {', '.join(METHODS)}")
    job = _Job("sweep", problem, transcription, start, starts, seed, tolerance, points=int(points), method=method)
    check_points(points, len(job.nlp.problem.goals))
    for _ in range(ROUNDS):
        ends = job.ends()
        if any(end.status != CONVERGED for end in ends):
            return job.sifted(ends)
        found = job.along(targets(np.array([end.F for end in ends]), job.ranges(ends), points, method))
        if not job.surpassed(ends, found):
            break
    return job.sifted([*ends, *found], job.ranges(ends))


class _Job:
    """One call: its NLP, its solves, and how they become a front."""

    def __init__(
        self,
        name: str,
        problem: Problem | CompiledProblem,
        transcription: Transcription,
        start: Any,
        starts: int,
        seed: int | None,
        tolerance: float,
        **settings: Any,
    ) -> None:
        check_run(1, seed, tolerance, None, None, None)
        check_count("starts", starts, 1)
        check_problem(problem, transcription)
        compiled = problem.compile() if isinstance(problem, Problem) else problem
        refuse_peaks(compiled)
        self.nlp = transcription.transcribe(compiled)
        check_freedom(self.nlp)
        self._seed = secrets.randbits(63) if seed is None else int(seed)
        given = beginning(start, self.nlp)
        self._began = time.perf_counter()
        self.solver = MultistartSolver(self.nlp, given, int(starts), np.random.default_rng(self._seed), float(tolerance))
        self._about = {"name": name, "settings": {**settings, "starts": int(starts)}}

    def ends(self) -> list[Solved]:
        """The lexicographic optimum of each objective."""
        return [self.solver.lexicographic(i) for i in range(len(self.nlp.problem.goals))]

    def along(self, tasks: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Solved]:
        """One solve, or as many as there are starts, for each reference and weights; in their order.

        Whatever is better for another task than its own answer becomes a start for it; so does the answer next to it on the way back, if
        several starts are wanted.
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
        """Ranges (m,) of the objectives between the ends; 0 for one that is in conflict with no other, and so has none."""
        F = np.array([end.F for end in ends])
        ranges, sizes = np.ptp(F, axis=0), np.abs(F).max(axis=0)
        return np.where(ranges > np.maximum(NO_RANGE * sizes, NOTHING * nlp_scales(self.nlp)), ranges, 0.0)

    def surpassed(self, ends: Sequence[Solved], found: Sequence[Solved]) -> bool:
        """Whether a sweep found an objective to be better than at its end, which then is a local optimum only."""
        F = np.array([solved.F for solved in found if solved.status == CONVERGED]).reshape(-1, len(ends))
        best = np.array([end.F[i] for i, end in enumerate(ends)])
        return bool((best - F > BETTER * self._unit(self.ranges(ends))).any())

    def _unit(self, ranges: np.ndarray | None) -> np.ndarray:
        scales = nlp_scales(self.nlp)
        return scales if ranges is None else np.where(ranges > 0, ranges, scales)

    def sifted(self, found: Sequence[Solved], ranges: np.ndarray | None = None) -> Front:
        """The front of what converged, without points that are dominated or come twice."""
        good = [solved for solved in found if solved.status == CONVERGED]
        if not good:
            nearest = self.front([min(found, key=lambda solved: solved.violation)], None)[0]
            return self.front([], None, message=f"no solve converged; {nearest_misses(nearest)}", closest=nearest)
        F = np.array([solved.F for solved in good])
        # To as many digits as the solves have; with all of them, of two equal points the one or the other might dominate.
        kept = distinct(F, self._unit(ranges))
        left = {"did not converge": len(found) - len(good), "dominated or alike": int(np.count_nonzero(~kept))}
        message = ", ".join(f"{count} {word}" for word, count in left.items() if count)
        chosen = [solved for solved, keep in zip(good, kept, strict=True) if keep]
        return self.front(chosen, ranges, message=message and f"of {len(found)} points left out: {message}")

    def front(self, found: Sequence[Solved], ranges: np.ndarray | None, **more: Any) -> Front:
        """Solves as a front, certified; objectives in `ranges` (m,)."""
        Z = np.array([solved.z for solved in found]).reshape(len(found), len(self.nlp.variables))
        certificates = [optimality(self.nlp, z, ranges) for z in Z]
        stats = costs(
            self.solver.counts,
            wall_time=time.perf_counter() - self._began,
            seed=self._seed,
            tolerance=self.solver.tolerance,
            reproducible=not self.solver.counts.clocked,
        )
        status = [solved.status for solved in found]
        return Front.of(vectors_points(self.nlp, Z, self._about, stats, status=status, optimality=certificates, **more))


METHODS = ("pascoletti-serafini", "epsilon")


Task = tuple[np.ndarray, np.ndarray]
"""Reference and weights, as `transcription.nlp.scalarized.scalarize` takes them."""


def check_points(points: int, m: int) -> None:
    """Raise ValueError for a number of points with which m objectives make no front."""
    if m == 1:
        raise ValueError("a problem with one objective has no front to sweep; use optimize")
    if points < m:
        raise ValueError(f"points must be at least {m}, one for each objective, not {points}")


def targets(ends: np.ndarray, ranges: np.ndarray, points: int, method: str) -> list[Task]:
    """Problems whose answers, with the ends, make a front of at most `points` points.

    Parameters
    ----------
    ends : array (m, m)
        Objectives, minimised, of the end that is best in each of them.
    ranges : array (m,)
        Of the objectives between the ends; 0 for one that is in conflict with no other.
    points : int
        Ends included.
    method : "pascoletti-serafini" or "epsilon"

    Returns
    -------
    list of (reference (m,), weights (m,))
        Neighbours in the list are neighbours on the front, as far as there is such an order. Empty if the objectives are not in conflict.
    """
    if np.count_nonzero(ranges) < 2:
        return []
    return (_down if method == "pascoletti-serafini" else _limited)(ends, ranges, points)


def _down(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Task]:
    """From a lattice on the simplex between the ends, all ranges at once."""
    m = len(ends)
    inner = [share for share in simplex_lattice(m, divisions_below(m, points)) if share.max() < 1.0]
    # An objective without a range has no weight, so that the least value is its limit.
    level = np.where(ranges > 0, ends, ends.max(axis=0))
    return [(share @ level, ranges) for share in inner]


def _limited(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Task]:
    """The first objective that is in conflict, at all combinations of evenly spread limits of the others."""
    m = len(ends)
    first, *others = np.flatnonzero(ranges > 0)
    levels = int((points - m) ** (1.0 / len(others)) + 1e-9)
    # Of two objectives, the loosest limit gives an end; of more, combinations with it are new.
    shares = np.arange(1, levels + 1) / (levels + (len(others) == 1))
    tasks = []
    for combination in product(shares, repeat=len(others)):
        reference = ends.max(axis=0)
        reference[first] = 0.0
        reference[others] -= (1.0 - np.array(combination)) * ranges[others]
        tasks.append((reference, np.where(np.arange(m) == first, ranges, 0.0)))
    return tasks
