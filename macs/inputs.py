"""Checks of what a solver is given, before any work."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from problems.compiled import CompiledProblem, Variable
from problems.problem import Problem
from transcription.base import NLP, Transcription

from .front import Front
from .point import Point


def check_run(evaluations: Any, seed: Any, tolerance: Any, time_limit: Any, callback: Any, checkpoint: Any) -> None:
    """Raise ValueError for arguments of `solve` and `minimize` that make no sense."""
    check_count("evaluations", evaluations, 1)
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0):
        raise ValueError(f"seed must be a whole number of at least 0, or None, not {seed!r}")
    for name, value in (("tolerance", tolerance), ("time_limit", time_limit)):
        if value is None and name == "time_limit":
            continue
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not math.isfinite(value) or value <= 0:
            raise ValueError(f"{name} must be a positive number, not {value!r}")
    if callback is not None and not callable(callback):
        raise ValueError(f"callback must be callable, not {callback!r}")
    if checkpoint is not None:
        raise ValueError("checkpoint: not available yet")


def check_count(name: str, value: Any, least: int) -> None:
    """Raise ValueError unless `value` is a whole number of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{name} must be a whole number of at least {least}, not {value!r}")


def check_problem(problem: Any, transcription: Any) -> None:
    """Raise ValueError if these are no problem and no transcription."""
    if not isinstance(problem, Problem | CompiledProblem):
        raise ValueError(f"problem must be a Problem, not {type(problem).__name__}; problems.load makes one from a name")
    if not isinstance(transcription, Transcription):
        raise ValueError(f"transcription must be a Transcription such as DFET(elements=4, order=6), not {transcription!r}")


def check_freedom(nlp: NLP) -> None:
    """Raise ValueError if there is nothing to search."""
    if not len(nlp.free):
        raise ValueError(
            f"problem '{nlp.problem.name}' leaves nothing to decide: no control, no parameter, no free time and no free initial state"
        )


def beginning(start: Any, nlp: NLP) -> np.ndarray | None:
    """Full vectors to begin with: what the caller gave, after what the problem's user guessed; None if neither did.

    `start` is a Front, Points, or an array (k, n) of decisions, or (k, d) of their free variables.
    """
    rows = []
    if np.isfinite(nlp.guess).any():
        middle = 0.5 * (nlp.lower[nlp.free] + nlp.upper[nlp.free])
        rows.append(nlp.first_guess(np.where(np.isfinite(nlp.guess), nlp.guess, middle)[None]))
    if start is not None:
        _check_names(start, nlp.variables)
        given = _array(start)
        if given.shape[1] == len(nlp.free) != len(nlp.variables):
            rows.append(nlp.first_guess(decisions(given, [nlp.variables[i] for i in nlp.free])))
        else:
            rows.append(decisions(given, nlp.variables))
    return np.vstack(rows) if rows else None


def decisions(start: Any, variables: Sequence[Variable]) -> np.ndarray:
    """Decisions (k, D) to begin with, checked against their bounds.

    Raises
    ------
    ValueError
        If they have another length, are no numbers, or lie outside the bounds; the message names the variable.
    """
    _check_names(start, variables)
    Z = _array(start)
    if Z.shape[1] != len(variables):
        raise ValueError(f"start: decisions have {Z.shape[1]} entries, {len(variables)} expected; a start belongs to one problem and mesh")
    lower, upper, scale = (np.array([getattr(v, name) for v in variables]) for name in ("lower", "upper", "scale"))
    wrong = ~np.isfinite(Z) | (lower - 1e-6 * scale > Z) | (upper + 1e-6 * scale < Z)
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        v = variables[column]
        raise ValueError(f"start: decision {row} has {v.name} = {Z[row, column]:g}, outside its bounds ({v.lower:g}, {v.upper:g})")
    return np.clip(Z, lower, upper)


def _check_names(start: Any, variables: Sequence[Variable]) -> None:
    """Refuse a Front or Points whose decisions are of other variables."""
    points = [start] if isinstance(start, Point) else start
    for point in points if isinstance(points, Front | list | tuple) else ():
        if isinstance(point, Point) and [v.name for v in point.variables] != [v.name for v in variables]:
            raise ValueError("start: the points are of other variables; a start belongs to one problem and mesh")


def _array(start: Any) -> np.ndarray:
    if isinstance(start, Point):
        start = [start]
    if isinstance(start, Front):
        start = start.decision
    elif isinstance(start, Sequence) and start and all(isinstance(point, Point) for point in start):
        start = [point.decision for point in start]
    try:
        Z = np.atleast_2d(np.array(start, dtype=float))
    except (TypeError, ValueError):
        raise ValueError("start must be a Front, Points or an array of decisions, all of one length") from None
    if Z.ndim != 2:
        raise ValueError(f"start must have two dimensions (points, variables), not {Z.ndim}")
    return Z
