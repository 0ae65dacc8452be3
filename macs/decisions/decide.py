"""decide: the point of a problem that suits a preference best, by gradients."""

from __future__ import annotations

from typing import Any

from problems.compiled import CompiledProblem
from problems.problem import Problem
from problems.vector import CompiledVectorProblem, VectorProblem
from transcription.base import Transcription, check_method, check_problem

from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.verified import VERIFY
from ..gradient_tools import Terms
from ..gradients.scalarised import MOST_ITERATIONS
from ..preferences import Preference, Ranges
from .choice import Choice
from .desk import Desk


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
    seed, tolerance, verify, max_iterations, time_limit, progress
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
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import ReferencePoint, decide
    >>> choice = decide(load("goddard"), ReferencePoint({"flight time": 180.0}), start=front, starts=1)
    >>> print(choice.point.verified)
    True
    """
    if preference is None and isinstance(transcription, Preference):
        transcription, preference = None, transcription
    check_statement(problem, transcription, preference, start)
    assert not isinstance(transcription, Preference) and preference is not None
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, progress)
    desk = Desk(problem, transcription, ranges, terms)
    preference.check(desk.problem.goals)
    return desk.work(lambda: desk.decided(preference))


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
