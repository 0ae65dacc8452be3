"""Terms of runs: the inner level and the start of a problem, of a study, or of one of its solvers."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict
from typing import Any

from macs.solvers.start import drawing
from problems import CompiledVectorProblem, Problem, VectorProblem
from problems.compiled import CompiledProblem
from transcription import Smooth
from transcription.inner import NAMED

from ..files import Section, check_known, checked, errors_begin_with

INNER = "auto"
"""The inner level where none is stated."""


class Terms(Section):
    """The terms of one solver of a study, where they differ from those of the others."""

    transcription: Any = None
    evaluations: Any = None
    inner: Any = None
    start: Any = None


def check_terms(terms: Any, solvers: Collection[str]) -> None:
    """Raise ValueError that names what is wrong in a study's `terms`, of solvers with these labels."""
    if not isinstance(terms, Mapping):
        raise ValueError(f"terms must be a table of tables, one for a solver, not {terms!r}")
    for label, own in terms.items():
        if label not in solvers:
            raise ValueError(f"terms: there is no solver '{label}'; there are {', '.join(solvers)}")
        with errors_begin_with(f"terms of '{label}'"):
            checked(own, Terms)
            if not own:
                raise ValueError(f"it must be a table with {', '.join(Terms.__struct_fields__)}, not {own!r}")
            given = own.get("transcription")
            if any(isinstance(one, list | tuple | Mapping) for one in (given.values() if isinstance(given, Mapping) else [given])):
                raise ValueError(f"transcription must be one, or one for each problem, not {given!r}")
            if "inner" in own:
                check_inner(own["inner"])
            sampling(own.get("start"))


def terms_of_problem(
    problem: Problem | CompiledProblem | VectorProblem | CompiledVectorProblem, inner: str | None, start: Any
) -> dict[str, Any]:
    """The inner level and start that a problem states, where the study states none: plain data. A compiled or vector problem has none.

    Raises ValueError if they are wrong.
    """
    found: dict[str, Any] = {}
    if not isinstance(problem, Problem):
        return found
    if inner is None:
        check_inner(problem.default_inner)
        found |= {"inner": problem.default_inner} if problem.default_inner != INNER else {}
    if start is None and problem.default_start is not None:
        found["start"] = written(problem.default_start)
    return found


def check_inner(inner: Any) -> None:
    """Raise ValueError unless there is an inner level of this name."""
    check_known("inner level", [inner], NAMED)


def sampling(start: Any) -> Smooth | str | None:
    """The argument `start` of `solve`. Raises ValueError if there is no such start."""
    if isinstance(start, Mapping):
        check_known("setting of start", start, Smooth.__dataclass_fields__)
        return Smooth(**start)
    found = drawing(start)
    if found is None and start is not None:
        raise ValueError(f"start must be 'uniform', 'smooth', or a table of the settings of Smooth, not {start!r}")
    return found


def written(start: Any) -> Any:
    """A start as plain data, which `sampling` reads."""
    found = sampling(start)
    return asdict(found) if isinstance(found, Smooth) else found
