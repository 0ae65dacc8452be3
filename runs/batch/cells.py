"""Cells of a study: every problem with each of its transcriptions and every solver, by labels, and the terms of their runs."""

from __future__ import annotations

import hashlib
import json
import pickle
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from macs.evaluation.blackbox import PymooFunction, is_pymoo, plain_problem
from macs.io.text import call
from macs.refinement.mesh_search import default_transcription
from macs.search.rounds import PLANNED_EVALUATIONS
from macs.solvers.solver import Solver, solver
from macs.solvers.start import drawing
from problems import Problem, VectorProblem, load
from problems.catalogue import address_of
from problems.checks import check_count
from problems.compiled import CompiledProblem
from problems.vector import CompiledVectorProblem, without_dynamics
from transcription import Smooth, Transcription, stated, word
from transcription.inner import NAMED

from ..execution.task import Addressed, Payload
from ..files import Count, Section, check_known, checked, errors_begin_with, plain

Statement = Problem | CompiledProblem | VectorProblem | CompiledVectorProblem
Modules = tuple[str, str, str]
"""Of the problem, the transcription and the solver of a cell."""
AUTO = "auto"
"""In place of a budget: a search of MACS ends when it is done."""
WITHOUT = "no transcription"
"""Label of the transcription of a vector problem, which has none."""
OWN = "the problem's own mesh"
"""Label of a default transcription that cannot be written in a word."""


@dataclass(frozen=True)
class Cell:
    """The data that all runs of a cell share."""

    problem: str  # problem, transcription, solver: Labels, as the study names them; together they are the cell's name
    transcription: str
    solver: str
    evaluations: int | None  # budget of each run; None: until the search is done
    # Plain data that decide the runs' numbers: fingerprint and settings. Another study in the same folder differs in them.
    details: Mapping[str, Any] = field(hash=False, repr=False)

    @property
    def planned(self) -> int:
        """Its budget, or where there is none about what a search takes."""
        return PLANNED_EVALUATIONS if self.evaluations is None else self.evaluations

    @property
    def labels(self) -> tuple[str, str, str]:
        """Problem, transcription, solver."""
        return self.problem, self.transcription, self.solver

    @property
    def terms(self) -> Mapping[str, Any]:
        """The terms of its runs that differ from the study's: those of its solver, and of its problem where the study states none."""
        return self.details.get("terms", {})

    def runs(self, asked: int) -> int:
        """How many it has where so many are asked for."""
        return min(asked, self.terms.get("runs", asked))

    @property
    def apart(self) -> bool:
        """Whether its solver works on a transcription of its own, unlike the other solvers of the study."""
        return "transcription" in self.terms

    @property
    def name(self) -> str:
        """The labels in one line: goddard, dfet:4x6, macs."""
        return ", ".join(self.labels)

    @property
    def folder(self) -> str:
        """The name of its folder: of letters that any file system takes, and no other cell's."""
        plain = "__".join(re.sub(r"[^A-Za-z0-9.-]+", "-", label).strip(".") or "-" for label in self.labels)
        if len(plain) <= 80 and plain.lower() == "__".join(self.labels).replace(":", "-"):
            return plain
        return f"{plain[:80]}__{self._digest()[:4].hex()}"

    def seed(self, study: int, run: int) -> int:
        """The seed of run 1, 2, ...: 63 bits.

        Spawned from the study's seed by a key made of the cell's labels and of the run's number. So neither more runs nor other cells
        change it, and two cells never share one.
        """
        words = np.frombuffer(self._digest()[:16], dtype="<u4").tolist()
        return int(np.random.SeedSequence(study, spawn_key=(*words, run)).generate_state(1, np.uint64)[0] >> np.uint64(1))

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for the study's record."""
        return {**vars(self), "folder": self.folder, "details": dict(self.details)}

    def _digest(self) -> bytes:
        return hashlib.sha256(json.dumps(self.labels).encode()).digest()


# Terms of runs

INNER = "auto"
"""The inner level where none is stated."""


class SolverTerms(Section):
    """The terms of one solver of a study, where they differ from those of the others."""

    transcription: Any = None
    evaluations: Any = None
    inner: Any = None
    start: Any = None
    runs: Count | None = None


def check_terms(terms: Any, solvers: Collection[str]) -> None:
    """Raise ValueError that names what is wrong in a study's `terms`, of solvers with these labels."""
    if not isinstance(terms, Mapping):
        raise ValueError(f"terms must be a table of tables, one for a solver, not {terms!r}")
    check_known("solver in terms", terms, solvers)
    for label, own in terms.items():
        with errors_begin_with(f"terms of '{label}'"):
            checked(own, SolverTerms)
            if not own:
                raise ValueError(f"it must be a table with {', '.join(SolverTerms.__struct_fields__)}, not {own!r}")
            given = own.get("transcription")
            if any(isinstance(one, list | tuple | Mapping) for one in (given.values() if isinstance(given, Mapping) else [given])):
                raise ValueError(f"transcription must be one, or one for each problem, not {given!r}")
            if "inner" in own:
                check_inner(own["inner"])
            sampling(own.get("start"))


def terms_of_problem(problem: Statement, inner: str | None, start: Any) -> dict[str, Any]:
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


# Cells


def combine(
    problems: Any, transcriptions: Any, solvers: Any, evaluations: Any, terms: Mapping[str, Any], inner: str | None, start: Any
) -> tuple[list[tuple[Cell, Payload, Modules]], dict[str, CompiledProblem | CompiledVectorProblem], dict[str, Solver]]:
    """The cells, problems first, each with its problem, transcription and solver pickled for the processes that run them, and the modules
    of these; and the problems and solvers by label.

    Parameters are those of `Study`. Raises ValueError that names the problem, transcription, solver or term that is wrong.
    """
    stated = {label: _problem(label, given) for label, given in _labelled("problems", problems).items()}
    methods = {label: _solver(label, given) for label, given in _labelled("solvers", solvers).items()}
    vectors = [label for label, one in stated.items() if isinstance(one, VectorProblem | CompiledVectorProblem)]
    flying = {label: one for label, one in stated.items() if label not in vectors}
    _refuse_transcriptions("transcriptions", transcriptions, vectors)
    schemes = {label: {WITHOUT: None} for label in vectors} | (_schemes(transcriptions, flying) if flying else {})
    budgets = _budgets(evaluations, stated)
    check_terms(terms, methods)
    labels = transcriptions if isinstance(transcriptions, Mapping) and not set(transcriptions) & set(stated) else {}
    # Of each solver: {label of a problem: its transcriptions by label}, and {label of a problem: its budget}.
    offered, allowed = dict.fromkeys(methods, schemes), dict.fromkeys(methods, budgets)
    for solver_label, given in terms.items():
        with errors_begin_with(f"terms of '{solver_label}'"):
            if "transcription" in given:
                _refuse_transcriptions("transcription", given["transcription"], vectors)
                own = _by_problem("transcription", given["transcription"], flying, lambda problem: problem.default_transcription)
                offered[solver_label] = schemes | {name: _named_schemes(_by_label(one, labels)) for name, one in own.items()}
            if "evaluations" in given:
                allowed[solver_label] = _budgets(given["evaluations"], stated)
    combined = []
    compiled: dict[str, CompiledProblem | CompiledVectorProblem] = {}
    for label, statement in stated.items():
        with errors_begin_with("problems", anything=f"'{label}' is stated wrongly"):
            problem = compiled[label] = statement.compile()
            # The place of its file is not part of what identifies a problem: a study may move.
            identity = {"name": problem.name, "data": dict(problem.data), "fingerprint": problem.fingerprint}
        with errors_begin_with(f"problems: '{label}'"):
            theirs = terms_of_problem(statement, inner, start)
        # Solvers on the transcriptions of the study stand side by side, before those on transcriptions of their own.
        places = [(name, one) for name in schemes[label] for one in methods if offered[one] is schemes]
        places += [(name, one) for one in methods if offered[one] is not schemes for name in offered[one][label]]
        pickles: dict[int, bytes] = {}
        for name, solver_label in places:
            scheme, budget, method = offered[solver_label][label][name], allowed[solver_label][label], methods[solver_label]
            place = f"{label}, {name}, {solver_label}"
            if id(scheme) not in pickles:
                pickles[id(scheme)] = _pickled(f"{label}, {name}", _sendable(problem), scheme)
            own = {**theirs, **terms.get(solver_label, {})}
            if allowed[solver_label] is not budgets:
                own["evaluations"] = AUTO if budget is None else budget
            if budget is None and not method.searches_until_done:
                raise ValueError(f"{place}: evaluations {AUTO!r} is for MACS; state a number, if need be in terms of '{solver_label}'")
            with errors_begin_with(place):
                method.check_objectives(len(problem.goals))
                _check_method(method, scheme, problem, own.get("start", start))
            details = {"problem": identity, "transcription": scheme and scheme.to_dict(), "solver": method.about()}
            details |= {"terms": own} if own else {}
            cell = Cell(label, name, solver_label, budget, plain(details))
            modules = address_of(problem.address).partition(":")[0], type(scheme).__module__, type(method).__module__
            combined.append((cell, (pickles[id(scheme)], _pickled(place, method)), modules))
    return combined, compiled, methods


def _refuse_transcriptions(key: str, given: Any, vectors: Sequence[str]) -> None:
    """Raise ValueError for a transcription of a vector problem, of those with these labels."""
    for label in vectors:
        if given is not None and not (isinstance(given, Mapping) and label not in given):
            raise ValueError(f"{key}: {without_dynamics(label)}: state none for it, but {{label: ...}} for the other problems")


def _check_method(method: Solver, scheme: Transcription | None, problem: CompiledProblem | CompiledVectorProblem, start: Any) -> None:
    """Raise ValueError unless a solver suits a problem and its transcription."""
    if isinstance(problem, CompiledProblem):
        assert scheme is not None
        method.check_transcription(scheme, problem)
        return
    method.check_vector(problem)
    if isinstance(sampling(start), Smooth):
        raise ValueError(f"start: {without_dynamics(problem.name)}, so there are no smooth profiles")


def _sendable(problem: CompiledProblem | CompiledVectorProblem) -> Any:
    """What other processes make the same problem of: of a vector problem that has an address, that, since its function may not pickle."""
    if isinstance(problem, CompiledProblem) or not problem.address:
        return problem
    return Addressed(problem.address, dict(problem.data))


def _labelled(key: str, given: Any) -> dict[str, Any]:
    """{label: one} for one, several, or a mapping of them."""
    if isinstance(given, Mapping):
        found = dict(given)
    else:
        found = {}
        for one in given if isinstance(given, list | tuple) else [given]:
            label = _label(one)
            if label in found:
                raise ValueError(f"{key}: '{label}' is there twice; give each a label, {{label: ...}}")
            found[label] = one
    if not found:
        raise ValueError(f"{key}: there are none")
    for label in found:
        if not isinstance(label, str) or not label.strip():
            raise ValueError(f"{key}: a label must be a word, not {label!r}")
    return found


def _label(one: Any) -> str:
    """The label of a problem, solver or transcription. The latter's word, if it has one, so the same method always has the same label."""
    if isinstance(one, Transcription):
        about = one.to_dict()
        return word(one) or call(about["method"], about["settings"])
    if is_pymoo(one):
        return type(one).__name__
    return type(one).__name__.lower() if isinstance(one, Solver) else one.name if isinstance(one, Statement) else str(one)


def _problem(label: str, given: Any) -> Statement:
    data = dict(given) if isinstance(given, Mapping) else {"problem": given}
    name = data.pop("problem", None)
    if isinstance(name, Statement) and not data:
        return name
    if is_pymoo(name) and not data:
        with errors_begin_with(f"problems: '{label}'"):
            return plain_problem(name, name=label)
    if not isinstance(name, str):
        raise ValueError(
            f"problems: '{label}' must be a name, a Problem, one of pymoo, or a table with its name as problem = ..., not {given!r}"
        )
    with errors_begin_with("problems", anything=f"'{name}' does not load"):
        return load(name, **data)


def _schemes(given: Any, problems: Mapping[str, Statement]) -> dict[str, dict[str, Transcription | None]]:
    """Transcriptions by label, for each problem."""
    if isinstance(given, Mapping) and not set(given) & set(problems):
        return dict.fromkeys(problems, _named_schemes(given))
    by_problem = _by_problem("transcriptions", given, problems, _own_scheme)
    return {label: _named_schemes(one) for label, one in by_problem.items()}


def _own_scheme(problem: Problem) -> Any:
    method = default_transcription(problem)
    return method if word(method) else {OWN: method}


def _named_schemes(given: Any) -> dict[str, Transcription | None]:
    return {label: _scheme(label, one) for label, one in _labelled("transcriptions", given).items()}


def _by_label(given: Any, labels: Mapping[str, Any]) -> Any:
    """A transcription with its label if it is given as one of those of the study, else as it is."""
    return {given: labels[given]} if isinstance(given, str) and given in labels else given


def _scheme(label: str, given: Any) -> Transcription:
    if isinstance(given, str | Mapping):
        with errors_begin_with("transcriptions"):
            return stated(given)
    if not isinstance(given, Transcription):
        raise ValueError(
            f"transcriptions: '{label}' must be a word such as dfet:4x6, a table with its method and settings, or a Transcription, "
            f"not {given!r}"
        )
    return given


def _solver(label: str, given: Any) -> Solver:
    if isinstance(given, Solver):
        return given
    settings = dict(given) if isinstance(given, Mapping) else {"solver": given}
    name = settings.pop("solver", None)
    if not isinstance(name, str):
        raise ValueError(f"solvers: '{label}' must be a name, a Solver, or a table with its name as solver = \"macs\", not {given!r}")
    with errors_begin_with("solvers"):
        return solver(name, **settings)


def _budgets(given: Any, problems: Mapping[str, Statement]) -> dict[str, int | None]:
    """The budget of each problem; None: until the search is done."""
    found = _by_problem("evaluations", given, problems, lambda problem: problem.default_evaluations)
    for label, budget in found.items():
        if budget is None:
            raise ValueError(f"evaluations: problem '{label}' has no number of its own: state one, or {AUTO!r} for MACS")
        if not isinstance(budget, str):
            check_count("evaluations" if budget is given else f"evaluations of '{label}'", budget, 1)
        elif budget != AUTO:
            raise ValueError(f"evaluations must be a whole number or {AUTO!r}, not {budget!r}")
    return {label: None if budget == AUTO else int(budget) for label, budget in found.items()}


def _by_problem(key: str, given: Any, problems: Mapping[str, Statement], own: Callable[[Any], Any]) -> dict[str, Any]:
    """A value for each problem: one for all, by labels, or if none is given the problem's `own`."""
    if given is None:
        found = {}
        for label, problem in problems.items():
            if isinstance(problem, CompiledProblem | CompiledVectorProblem):
                raise ValueError(f"{key}: problem '{label}' has none of its own: state them")
            found[label] = own(problem)
        return found
    if not isinstance(given, Mapping):
        return dict.fromkeys(problems, given)
    check_known(f"problem in {key}", given, problems)
    for label in problems:
        if label not in given:
            raise ValueError(f"{key}: none for problem '{label}'")
    return {label: given[label] for label in problems}


def _pickled(place: str, *parts: Any) -> bytes:
    """Bytes that another process can make the same of: one thing, or a tuple of several."""
    for one in parts:
        function = getattr(getattr(one, "rows", None), "function", None)
        function = type(function.problem) if isinstance(function, PymooFunction) else function
        name = type(one).__name__ if type(one).__module__ == "__main__" else getattr(function, "__name__", "the function")
        if "__main__" in (type(one).__module__, getattr(function, "__module__", "")):
            raise ValueError(f"{place}: other processes cannot import {name} from a script; put it into a module of its own")
    try:
        return pickle.dumps(parts if len(parts) > 1 else parts[0])
    except Exception as error:
        raise ValueError(f"{place}: it cannot be sent to another process ({error})") from error
