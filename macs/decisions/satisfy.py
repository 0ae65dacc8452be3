"""satisfy: fuzzy satisfactory goals whose order of priority is enforced step by step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem, Objective
from problems.problem import Problem
from transcription.base import Transcription

from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.verified import VERIFY
from ..gradient_tools import Terms
from ..gradients.scalarised import MOST_ITERATIONS
from ..preferences import FuzzySatisfactory, Ranges, Stage
from .choice import Choice
from .decide import check_statement
from .desk import Desk

TWICE, NEARER, STEPS = 2.0, 0.5, 5
"""lambda is raised to twice what it was; once that would reach 1/m, by half of what is left up to there, at most so many times."""
MARGIN = 1e-7
"""By how much an order that is imposed is kept, in memberships: more than what a solve may exceed it by."""


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
    progress: bool | None = None,
) -> Choice:
    """The choice by fuzzy satisfactory goals with the least lambda, of those tried, at which the memberships keep their order of priority.

    With the `regulating` of the preference as lambda, `decide` is called; while kappa > 0, lambda is raised, and the solves begin at the
    points found before as well (steps 2 to 4 of Bae and others). For m goals, lambda stays below 1/m: from there on, a worse membership of
    the less important goal would be a gain. If kappa > 0 still, the order becomes a hard limit, kappa <= 0.

    Parameters
    ----------
    problem, transcription, ranges, start, starts, seed, tolerance, verify, max_iterations, time_limit, progress
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
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import FuzzySatisfactory, satisfy
    >>> goals = FuzzySatisfactory({}, priorities=["horizontal speed", "flight time"])
    >>> choice = satisfy(load("goddard"), DFET(6, 6, basis="bernstein"), goals, start=front, starts=1)
    >>> choice.degrees["horizontal speed"] > 0
    True
    """
    if preference is None and isinstance(transcription, FuzzySatisfactory):
        transcription, preference = None, transcription
    check_statement(problem, transcription, preference, start)
    if not isinstance(preference, FuzzySatisfactory):
        raise ValueError(f"satisfy takes a FuzzySatisfactory, not {preference!r}; decide takes any preference")
    assert not isinstance(transcription, FuzzySatisfactory)
    terms = Terms(start, starts, seed, tolerance, verify, max_iterations, time_limit, progress)
    desk = Desk(problem, transcription, ranges, terms)
    preference.check(desk.problem.goals)
    return desk.work(lambda: satisfied(desk, preference))


def satisfied(desk: Desk, preference: FuzzySatisfactory) -> Choice:
    """The last choice of the loop."""
    goals, found = desk.problem.goals, list[Point]()
    for weight in _raised(preference.regulating, len(preference.names)):
        trial = replace(preference, regulating=weight)
        choice = desk.decided(trial, {"lambda": weight}, found)
        kappa = _kappa(trial, goals, desk, choice)
        choice = _with_kappa(desk, choice, kappa)
        if kappa <= 0.0 or preference.ordered or desk.stopped:
            return choice
        found.insert(0, choice.point)
    trial = replace(preference, regulating=weight, ordered=True)
    choice = desk.decided(_Ordered(**vars(trial)), {"lambda": weight}, found)
    choice = _with_kappa(desk, replace(choice, preference=trial), _kappa(trial, goals, desk, choice))
    words = f"the order of priority was not kept up to lambda = {weight:.6g}; it was imposed"
    return replace(choice, message="; ".join(filter(None, [words, choice.message])))


def _raised(first: float, m: int) -> Sequence[float]:
    """Values of lambda, the first and rising ones below 1/m."""
    weights, most = [first], 1.0 / m
    if first == 0.0:
        weights.append(FuzzySatisfactory.regulating)
    while TWICE * weights[-1] < most:
        weights.append(TWICE * weights[-1])
    for _ in range(STEPS if weights[-1] < most else 0):
        weights.append(weights[-1] + NEARER * (most - weights[-1]))
    return weights


def _kappa(preference: FuzzySatisfactory, goals: Sequence[Objective], desk: Desk, choice: Choice) -> float:
    return float(preference.kappa(goals, desk.ranges, np.array([list(choice.objectives.values())]))[0])


def _with_kappa(desk: Desk, choice: Choice, kappa: float) -> Choice:
    """The choice whose last step has its kappa."""
    if desk.history:
        last = desk.history[-1]
        desk.history[-1] = replace(last, about={**last.about, "kappa": kappa})
    return replace(choice, history=tuple(desk.history))


@dataclass(frozen=True, repr=False)
class _Ordered(FuzzySatisfactory):
    """The same goals, of which the order is kept a little more than it need be."""

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        (stage,) = super().stages(goals, ranges)
        pairs = len(self._pairs())

        def limits(J: Sequence[Any]) -> list[Any]:
            every = stage.limits(J)
            return [*every[:-pairs], *(one + MARGIN for one in every[-pairs:])]

        return (replace(stage, limits=limits),)
