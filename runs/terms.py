"""On what terms a solver works in a study: those of all, its own, or those of the problem where the study says nothing."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict
from typing import Any

from macs.solvers.start import drawing, unknown
from problems import Problem
from problems.compiled import CompiledProblem
from transcription import Smooth
from transcription.inner import NAMED

from .batch.file import told

TERMS = ("transcription", "evaluations", "inner", "start")
"""What a solver may work with instead of what the others do."""
INNER = "auto"
"""The inner level where nobody names one."""


def check(terms: Any, solvers: Collection[str]) -> None:
    """Raise ValueError that names what makes no sense in a study's `terms`, of solvers with these labels."""
    if not isinstance(terms, Mapping):
        raise ValueError(f"terms must be a table of tables, one for a solver, not {terms!r}")
    for label, own in terms.items():
        if label not in solvers:
            raise ValueError(f"terms: there is no solver '{label}'; there are {', '.join(solvers)}")
        with told(f"terms of '{label}'"):
            _check_own(own)


def _check_own(own: Any) -> None:
    if not isinstance(own, Mapping) or not own:
        raise ValueError(f"there must be a table of {', '.join(TERMS)}, not {own!r}")
    for key in own:
        if key not in TERMS:
            raise ValueError(unknown("key", key, TERMS))
    if isinstance(own.get("transcription"), list | tuple | Mapping):
        raise ValueError(f"transcription must be one, not {own['transcription']!r}")
    if "inner" in own:
        check_inner(own["inner"])
    sampling(own.get("start"))


def of_problem(problem: Problem | CompiledProblem, inner: str | None, start: Any) -> dict[str, Any]:
    """The inner level and start of a problem's own, where a study names none and they are not what solvers do anyway: plain data.

    Raises ValueError if they make no sense. A compiled problem has none.
    """
    found: dict[str, Any] = {}
    if isinstance(problem, CompiledProblem):
        return found
    if inner is None:
        check_inner(problem.default_inner)
        found |= {"inner": problem.default_inner} if problem.default_inner != INNER else {}
    if start is None and problem.default_start is not None:
        found["start"] = written(problem.default_start)
    return found


def check_inner(inner: Any) -> None:
    """Raise ValueError unless there is an inner level of this name."""
    if inner not in NAMED:
        raise ValueError(unknown("inner level", inner, NAMED))


def sampling(start: Any) -> Smooth | str | None:
    """What `solve` gets as its `start`. Raises ValueError for what makes no sense."""
    if isinstance(start, Mapping):
        for key in start:
            if key not in Smooth.__dataclass_fields__:
                raise ValueError(unknown("setting of start", key, Smooth.__dataclass_fields__))
        return Smooth(**start)
    found = drawing(start)
    if found is None and start is not None:
        raise ValueError(f"start must be 'uniform', 'smooth', or a table of the settings of Smooth, not {start!r}")
    return found


def written(start: Any) -> Any:
    """A start as plain data, which `sampling` understands."""
    found = sampling(start)
    return asdict(found) if isinstance(found, Smooth) else found
