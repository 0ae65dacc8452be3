"""A study: every problem on every transcription by every solver, many independent runs of each. What it is; `executing` runs it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import KW_ONLY, dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from problems.checks import check_count, check_positive
from transcription import Smooth

from .batch import cells as combining
from .batch import file as studyfile
from .batch.cells import Cell
from .batch.file import INNER, check_inner, sampling, written
from .batch.store import Store, StoredRun, Summary
from .execution.task import Payload, Task
from .measures.references import check_reference
from .report.changed_data import check as check_nominal
from .report.goal import Goal
from .report.published import check as check_paper
from .report.published import check_against

if TYPE_CHECKING:
    from .report.report import Report

QUICK_RUNS, QUICK_EVALUATIONS, QUICK_LEAST, MANY_CELLS = 2, 500, 50, 8


@dataclass(frozen=True, eq=False)
class Study:
    """Independent runs of solvers on problems; `run` makes them, and makes only those that are missing when it is called again.

    Every problem is combined with each of its transcriptions and with every solver. Run i of such a cell has a seed that depends on `seed`,
    on the cell's labels and on i alone: more runs, or more solvers, change none of those there are.

    Parameters
    ----------
    name : str
    problems : names, Problems, or mapping
        A name or address that `problems.load` takes, a `Problem`, several of them, or {label: one of them}. A mapping's value may also be
        {"problem": name, ...}, the rest of which `problems.load` gets as data.
    transcriptions : words, Transcriptions, or mapping, optional
        One or several, for all problems; {label: one}; or {label of a problem: one or several}, if its keys are the problems' labels.
        Default: the problem's own.
    solvers : names, Solvers, or mapping
        One or several names, such as "macs", or `Solver`s; or {label: one of them}, or {label: {"solver": name, settings...}}.
    terms : mapping, optional
        {label of a solver: what it works with where that is not what the others do}: any of transcription (one), evaluations, inner and
        start. Reports compare it with the others on each of their transcriptions.
    evaluations : int, or mapping, optional
        Budget of each run, or {label of a problem: budget}. Default: the problem's own.
    runs : int
        Of each cell.
    seed : int
        The one that all seeds are spawned from.
    reference : optional
        What reports measure fronts against; see `report`.
    inner : str, optional
        The inner level, by name. Default: the problem's own, which mostly is "auto".
    tolerance : float, default 1e-6
        As for `solve`.
    start : "uniform", "smooth", Smooth or mapping, optional
        How the first candidates of a run are drawn, as for `solve`; a mapping holds settings of `transcription.Smooth`. Default: the
        problem's own, or else each variable by itself, after the problem's guess.
    verify : float, optional
        Simulate the points of each run, see `Front.simulate`; reports count only those that violate nothing by more than this, in
        the constraints' scales, with their objectives as flown. Default: points are what the solver says.
    time_limit : float, optional
        Seconds of a run, after which it is ended and recorded as a timeout; called again, it goes on where it was. It changes no number.
    description : str
        One line, for lists.
    paper : sequence of mappings
        Published tables to print beside ours; see `reporting.published`.
    goal : mapping, optional
        Of which objective reports draw the goal attainment, between which values; see `reporting.goal.Goal`.
    nominal : str, optional
        Label of the problem whose front reports fly under the data of all others, which have the same variables and objectives; see
        `reporting.changed`.
    flights : bool, default True
        Whether reports show the flights that stand for each front.
    note : str
        What readers of the report should know beforehand.

    Raises
    ------
    ValueError
        Whatever does not make sense, before any work; the message names it.
    """

    name: str
    _: KW_ONLY
    problems: Any
    transcriptions: Any = None
    solvers: Any
    terms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    evaluations: Any = None
    runs: int
    seed: int
    reference: Any = None
    inner: str | None = None
    tolerance: float = 1e-6
    start: Any = None
    verify: float | None = None
    time_limit: float | None = None
    description: str = ""
    paper: Sequence[Mapping[str, Any]] = ()
    goal: Mapping[str, Any] | None = None
    nominal: str | None = None
    flights: bool = True
    note: str = ""
    cells: tuple[Cell, ...] = field(init=False, repr=False)
    """Every combination, problems first."""
    payloads: Mapping[tuple[str, str, str], Payload] = field(init=False, repr=False)
    """By labels of a cell: its problem and transcription, and its solver, pickled for the processes that run them."""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip():
            raise ValueError(f"study: name must be a word, not {self.name!r}")
        with studyfile.told(f"study '{self.name}'"):
            self._check_values()
            combined = combining.combine(
                self.problems, self.transcriptions, self.solvers, self.evaluations, self.terms, self.inner, self.start
            )
            asked = (self.goal, self.nominal, self.reference)
            stated = combining.problems(combined) if self.paper or any(one is not None for one in asked) else {}
            if self.paper:
                check_against(self.paper, stated, combining.solvers(combined))
            if self.reference is not None:
                check_reference(self.reference, stated)
            if self.goal is not None:
                Goal.of(self.goal, stated)
            if self.nominal is not None:
                check_nominal(self.nominal, stated)
        object.__setattr__(self, "cells", tuple(cell for cell, _ in combined))
        object.__setattr__(self, "payloads", {cell.labels: payload for cell, payload in combined})

    @classmethod
    def load(cls, source: str | PathLike[str]) -> Study:
        """The study in a TOML file, or one that comes with the project, by name.

        Raises
        ------
        ValueError
            There is no such study, the file is not TOML, or a key or value in it makes no sense; the message names it.
        """
        given = studyfile.read(source)
        with studyfile.told(str(source)):
            return cls(**given)

    def run(
        self,
        out: str | PathLike[str],
        *,
        jobs: int = 1,
        executor: Executor | None = None,
        retry: bool = False,
        progress: bool = False,
    ) -> Summary:
        """Make the runs that `out` does not have yet. Each that has begun goes on from a checkpoint of its own.

        Parameters
        ----------
        out : path
            A folder, made if it is not there; `store` says what is in it. A finished run in it is neither made again nor touched.
        jobs : int
            How many processes of this machine work at a time.
        executor : concurrent.futures.Executor, optional
            Who does the work instead: threads, processes, a Dask client's `get_executor()`. Each of its workers keeps one process, in which
            the runs happen; so a run that crashes or hangs takes none of them down.
        retry : bool
            Make those runs again, too, that ended with an exception. Those that were killed or took too long always are.
        progress : bool
            Show on the terminal how it stands.

        Returns
        -------
        Summary
            How many runs of each cell there are by now, and why others failed. That some failed is no error.

        Raises
        ------
        ValueError
            `out` holds another study, or is in use by another process.
        OSError
            A run's file could not be written; those that are finished stay as they are.
        KeyboardInterrupt
            Ctrl-C; the same again goes on.
        """
        from .batch.running import execute

        return execute(out, self.definition(), self.runs, self._task, jobs=jobs, executor=executor, retry=retry, progress=progress)

    def status(self, out: str | PathLike[str]) -> Summary:
        """How many runs of each cell `out` has, and why others failed. Raises ValueError if it holds another study, or none."""
        store = Store.open(out)
        store.check(self.definition())
        return store.summary(self.runs)

    def report(
        self,
        out: str | PathLike[str],
        *,
        foreign: Mapping[str, Sequence[str | PathLike[str]]] | None = None,
        figures: bool = True,
        progress: bool = False,
    ) -> Report:
        """Tables and figures of the runs that `out` has; see `reporting.report.report`. Raises ValueError if it holds another study,
        or none."""
        from .report.report import report

        Store.open(out).check(self.definition())
        return report(out, foreign=foreign, figures=figures, progress=progress)

    def inner_of(self, cell: Cell) -> str:
        """The inner level of a cell's runs, by name."""
        return self._terms(cell).get("inner", self.inner or INNER)

    def sampling_of(self, cell: Cell) -> Smooth | str | None:
        """What `solve` gets as its `start` in a cell's runs."""
        return sampling(self._terms(cell).get("start", self.start))

    def quick(self) -> Study:
        """The same, to see that it works, within a minute: two runs, or one where there are many cells, of at most 500 evaluations.

        Budgets of solvers on terms of their own shrink as the largest does. Its name ends in -quick.
        """
        share = min(1.0, QUICK_EVALUATIONS / max(cell.evaluations for cell in self.cells))
        own = {label: dict(terms) for label, terms in self.terms.items()}
        for label, terms in own.items():
            if "evaluations" in terms:
                given = {cell.problem: cell.evaluations for cell in self.cells if cell.solver == label}
                terms["evaluations"] = {problem: min(n, max(QUICK_LEAST, int(share * n))) for problem, n in given.items()}
        budgets = {
            cell.problem: min(cell.evaluations, QUICK_EVALUATIONS) for cell in self.cells if "evaluations" not in own.get(cell.solver, {})
        }
        runs = min(self.runs, QUICK_RUNS if len(self.cells) <= MANY_CELLS else 1)
        return replace(self, name=f"{self.name}-quick", runs=runs, evaluations=budgets or None, terms=own)

    def definition(self) -> dict[str, Any]:
        """All that decides the numbers, and what reports print, as plain data."""
        return {
            "name": self.name,
            "description": self.description,
            "seed": int(self.seed),
            "runs": int(self.runs),
            "inner": self.inner or INNER,
            "tolerance": float(self.tolerance),
            "start": written(self.start),
            "verify": self.verify,
            "time_limit": self.time_limit,
            "reference": studyfile.plain(self.reference),
            "paper": studyfile.plain(self.paper),
            "goal": studyfile.plain(self.goal),
            "nominal": self.nominal,
            "flights": self.flights,
            "note": self.note,
            "cells": [cell.to_dict() for cell in self.cells],
        }

    def _task(self, run: StoredRun, checkpoint: Path) -> Task:
        """What a worker needs to make a run."""
        return Task(
            payload=self.payloads[run.cell.labels],
            evaluations=run.cell.evaluations,
            seed=run.seed,
            inner=self.inner_of(run.cell),
            tolerance=float(self.tolerance),
            time_limit=self.time_limit,
            start=self.sampling_of(run.cell),
            verify=self.verify,
            checkpoint=checkpoint,
        )

    def _terms(self, cell: Cell) -> dict[str, Any]:
        """What a cell's runs have of their own: the problem's inner level and start where the study names none, and the solver's terms."""
        return {**cell.terms, **self.terms.get(cell.solver, {})}

    def _check_values(self) -> None:
        check_count("runs", self.runs, 1)
        check_count("seed", self.seed, 0)
        check_positive("tolerance", self.tolerance)
        for name in ("time_limit", "verify"):
            if getattr(self, name) is not None:
                check_positive(name, getattr(self, name))
        sampling(self.start)
        if self.inner is not None:
            check_inner(self.inner)
        check_paper(self.paper)
        if not isinstance(self.flights, bool):
            raise ValueError(f"flights must be True or False, not {self.flights!r}")
        for name in ("description", "note"):
            if not isinstance(getattr(self, name), str):
                raise ValueError(f"{name} must be a line of text, not {getattr(self, name)!r}")
