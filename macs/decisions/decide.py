"""decide: the point of a problem that suits a preference best, by gradients; satisfy: goals whose order of priority is enforced."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem
from problems.problem import Problem
from problems.vector import CompiledVectorProblem, VectorProblem
from transcription.base import Transcription, check_method, check_problem

from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.verified import VERIFY
from ..gradient_tools import Terms
from ..gradients.scalarised import MOST_ITERATIONS
from ..io.workers import Workers
from ..preferences.goals import FuzzySatisfactory
from ..preferences.preference import Preference
from ..preferences.ranges import Ranges
from ..preferences.stage import Stage
from .choice import Choice
from .solver import DecisionSolver


def decide(
    problem: Problem | CompiledProblem,
    transcription: Transcription | Preference | None = None,
    preference: Preference | None = None,
    *,
    ranges: Ranges | None = None,
    start: Points | Point | None = None,
    starts: int | str = "auto",
    seed: int | None = 0,
    tolerance: float = 1e-6,
    verify: float | None = VERIFY,
    max_iterations: int = MOST_ITERATIONS,
    time_limit: float | None = None,
    workers: Workers | None = None,
    progress: bool | None = None,
) -> Choice:
    """The point of a problem that suits a preference best, by gradients: a local optimum, and never worse than the best of `start`.

    Each stage of the preference is minimised as the one objective of a problem that has the user's objectives as parameters. Of several
    stages, each keeps what those before attained, but for a part of 1e-7 of its size, and of 1 at least. The vector that is found is one of
    the problem itself: the point is certified and simulated as all points are.

    Parameters
    ----------
    problem : Problem
    transcription : Transcription, optional
        It may be left out: `decide(problem, preference)`. Default: a mesh that is found, as by `optimize`; stages after the first are
        solved on the mesh of that. A point that is not verified there is solved again, on finer meshes or inside the limits that it
        exceeds, for the same preference. On a transcription that is given, points are only marked.
    preference : Preference
    ranges : Ranges, optional
        By which objectives are normalised. Default: those of `start`, or of the payoff table, which is found first.
    start : Front or Point, optional
        Points of the problem to begin at. Default: those of the payoff table.
    starts : int or "auto"
        Number of starts: the best-ranked points of `start`, the problem's guess, then random ones. "auto": the three best points of a
        `start` that is given; else all of the payoff table, and the guess if there is one. That table is found from as many starts.
    seed, tolerance, verify, max_iterations, time_limit, workers, progress
        As for `optimize`.

    Returns
    -------
    Choice
        Its `message` says what is to be known: hard limits that no point was found to meet together, a solve that did not converge. A
        point within all hard limits that a simulation does not confirm is chosen before confirmed ones beyond them.

    Raises
    ------
    ValueError
        For a black box, which has no derivatives; a preference with unknown names or targets beyond the ranges; points of another problem;
        peaks that would have to be raised; and as `optimize`.

    Examples
    --------
    >>> import macs, problems
    >>> problem = problems.load("goddard")
    >>> front = macs.sweep(problem, points=3, starts=1)
    >>> from macs.decisions import ReferencePoint, decide
    >>> choice = decide(problem, ReferencePoint({"flight time": 180.0}), start=front, starts=1)
    >>> choice.point.verified
    True
    """
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, workers, progress)
    solver, wanted = _stated(problem, transcription, preference, ranges, terms)
    return solver.run(lambda: solver.choose(wanted))


def satisfy(
    problem: Problem | CompiledProblem,
    transcription: Transcription | FuzzySatisfactory | None = None,
    preference: FuzzySatisfactory | None = None,
    *,
    ranges: Ranges | None = None,
    start: Points | Point | None = None,
    starts: int | str = "auto",
    seed: int | None = 0,
    tolerance: float = 1e-6,
    verify: float | None = VERIFY,
    max_iterations: int = MOST_ITERATIONS,
    time_limit: float | None = None,
    workers: Workers | None = None,
    progress: bool | None = None,
) -> Choice:
    """The choice by fuzzy satisfactory goals with the least lambda, of those tried, at which the memberships keep their order of priority.

    With the `regulating` of the preference as lambda, `decide` is called; while kappa > 0, lambda is raised, and the solves begin at the
    points found before as well (steps 2 to 4 of Bae and others). For m goals, lambda stays below 1/m: from there on, a worse membership of
    the less important goal would be a gain. If kappa > 0 still, the order becomes a hard limit, kappa <= 0.

    Parameters
    ----------
    problem, transcription, ranges, start, starts, seed, tolerance, verify, max_iterations, time_limit, workers, progress
        As for `decide`. It may be called as `satisfy(problem, preference)`, too.
    preference : FuzzySatisfactory
        Its `regulating` is the first lambda.

    Returns
    -------
    Choice
        Its `history` has every step with its lambda and kappa; its `preference` is that of the last step. Its `message` says if the order
        had to be imposed.

    Raises
    ------
    ValueError
        As `decide`; and if the preference is another one.

    Examples
    --------
    >>> import macs, problems
    >>> problem = problems.load("goddard")
    >>> front = macs.sweep(problem, points=3, starts=1)
    >>> from macs.decisions import FuzzySatisfactory, satisfy
    >>> goals = FuzzySatisfactory({}, priorities=["horizontal speed", "flight time"])
    >>> choice = satisfy(problem, goals, start=front, starts=1)
    >>> choice.degrees["horizontal speed"] > 0
    True
    """
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, workers, progress)
    solver, goals = _stated(problem, transcription, preference, ranges, terms)
    if not isinstance(goals, FuzzySatisfactory):
        raise ValueError(f"satisfy takes a FuzzySatisfactory, not {goals!r}; decide takes any preference")
    return solver.run(lambda: raise_lambda(solver, goals))


def _stated(problem: Any, transcription: Any, preference: Any, ranges: Ranges | None, terms: Terms) -> tuple[DecisionSolver, Preference]:
    """The solver of a statement, and its preference, in whichever place it was given; all checked before any work."""
    if preference is None and isinstance(transcription, Preference):
        transcription, preference = None, transcription
    check_statement(problem, transcription, preference, terms.start)
    solver = DecisionSolver(problem, transcription, ranges, terms)
    preference.check(solver.problem.goals)
    return solver, preference


def check_statement(problem: Any, transcription: Any, preference: Any, start: Any) -> None:
    """Raise ValueError for arguments of `decide` of the wrong type."""
    if isinstance(problem, VectorProblem | CompiledVectorProblem):
        check_problem(problem)
    if isinstance(problem, Points) or not hasattr(problem, "compile"):
        raise ValueError(
            f"decide needs derivatives, and so a Problem with dynamics, not {type(problem).__name__}; preference.rank(front) needs none"
        )
    check_method(transcription)
    if not isinstance(preference, Preference):
        raise ValueError(f"preference must be a Preference such as WeightedSum({{'flight time': 1.0}}), not {preference!r}")
    if start is not None and not isinstance(start, Points | Point):
        raise ValueError(f"start must be a Front or a Point, not {type(start).__name__}")


def raise_lambda(solver: DecisionSolver, preference: FuzzySatisfactory) -> Choice:
    """The choice at the least lambda, of those tried, that keeps the order of priority; the order is imposed if none does."""
    known: list[Point] = []
    for weight in lambdas(preference.regulating, len(preference.names)):
        trial = replace(preference, regulating=weight)
        choice, kappa = _at_lambda(solver, trial, known)
        if kappa <= 0.0 or preference.ordered or solver.stopped:
            return choice
        known.insert(0, choice.point)
    choice, _ = _at_lambda(solver, replace(trial, ordered=True), known)
    words = f"the order of priority was not kept up to lambda = {weight:.6g}; it was imposed"
    return replace(choice, message="; ".join(filter(None, [words, choice.message])))


def lambdas(first: float, m: int) -> list[float]:
    """Values of lambda for m goals: the first and its doubles, and where these would reach 1/m five more, each halving what is left."""
    weights, most = [first], 1.0 / m
    if first == 0.0:
        weights.append(FuzzySatisfactory.regulating)
    while 2.0 * weights[-1] < most:
        weights.append(2.0 * weights[-1])
    for _ in range(5 if weights[-1] < most else 0):
        weights.append(weights[-1] + 0.5 * (most - weights[-1]))
    return weights


def _at_lambda(solver: DecisionSolver, trial: FuzzySatisfactory, known: Sequence[Point]) -> tuple[Choice, float]:
    """The choice at one lambda, and its kappa, which its last step has, too."""
    goals = solver.problem.goals
    (stage,) = trial.stages(goals, solver.ranges)
    if trial.ordered and known:
        stage = _with_margin(stage, trial)
    choice = solver.choose(trial, {"lambda": trial.regulating}, known, [stage])
    kappa = float(trial.kappa(goals, solver.ranges, np.array([[*choice.objectives.values()]]))[0])
    if solver.history:
        last = solver.history[-1]
        solver.history[-1] = replace(last, about={**last.about, "kappa": kappa})
    return replace(choice, history=tuple(solver.history)), kappa


def _with_margin(stage: Stage, preference: FuzzySatisfactory) -> Stage:
    """A stage that keeps the order of priority by a little more than solves may exceed a limit by, 1e-7 in memberships."""
    pairs = len(preference.pairs)

    def limits(J: Sequence[Any]) -> list[Any]:
        every = stage.limits(J)
        return [*every[:-pairs], *(one + 1e-7 for one in every[-pairs:])]

    return replace(stage, limits=limits)
