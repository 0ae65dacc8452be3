"""Study: many independent runs of every solver on every problem and transcription, stated, run and reported."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import KW_ONLY, MISSING, dataclass, field, fields, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from macs.fronts.verified import VERIFY
from macs.io.text import html_block, html_table
from problems.checks import short_repr, unknown
from problems.compiled import Objective
from transcription import Smooth

from .batch import file as studyfile
from .batch.cells import AUTO, INNER, Cell, Modules, check_inner, combine, sampling, written
from .batch.code import Code, code_of_method
from .batch.store import Store, StoredRun, StudySummary
from .execution.task import Payload, RunTask
from .files import Count, Flag, Natural, Positive, Text, checked, errors_begin_with, plain
from .measures.references import ReferenceKey, check_reference
from .report.goal import StatedGoal
from .report.published import check_against
from .report.sensitivity import check_dispersions, check_nominal

if TYPE_CHECKING:
    from .report.report import Report


def _key(kind: Any = None, *, decides: bool = False, record: Callable[[Any], Any] | None = plain) -> dict[str, Any]:
    """The metadata of a field of `Study` that is a key of study files."""
    return {"kind": kind, "decides": decides, "record": record}


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """Independent runs of solvers on problems; `run` makes them, and makes only those that are missing when it is called again.

    Every problem is combined with each of its transcriptions and with every solver. Run i of such a cell has a seed that depends on `seed`,
    on the cell's labels and on i alone: more runs, or more solvers, change none of those there are.

    Parameters
    ----------
    name : str
    problems : names, Problems, or mapping
        A name or address that `problems.load` takes, a `Problem`, a `VectorProblem`, a problem of pymoo, several of them, or
        {label: one of them}. A mapping's value may also be {"problem": name, ...}, the rest of which `problems.load` gets as data.
    transcriptions : words, Transcriptions, or mapping, optional
        One or several, for all problems; {label: one}; or {label of a problem: one or several}, if its keys are the problems' labels.
        Default: the problem's own.
    solvers : names, Solvers, or mapping
        One or several names, such as "macs", or solvers; or {label: one of them}, or {label: {"solver": name, settings...}}.
    terms : mapping, optional
        {label of a solver: terms of its own}: any of transcription (one, its label among `transcriptions`, or {label of a problem: one}),
        evaluations, inner, start and runs: at most so many, one for a solver that draws nothing. Reports compare it with the others on
        each of their transcriptions; if all solvers have their own, with each other.
    evaluations : int, "auto", or mapping, optional
        Budget of each run, or {label of a problem: budget}; "auto": searches of MACS end when they are done. Default: the problem's own.
    runs : int
        Number of runs of each cell, a combination of problem, transcription and solver.
    seed : int
        The one that all seeds are spawned from.
    reference : optional
        What reports measure fronts against: "union", "truth", a case, a file, or one by problem. Default: truth if known, else union.
    inner : str, optional
        The inner level, by name. Default: the problem's own, usually "auto".
    tolerance : float, default 1e-6
        As for `solve`.
    start : "uniform", "smooth", Smooth or mapping, optional
        How the first candidates of a run are drawn, as for `solve`; a mapping has settings of `transcription.Smooth`. Default: the
        problem's own, or else each variable by itself, after the problem's guess.
    verify : float or None, default 1e-3
        How much a point may miss when it is simulated, in scales, and still be verified, as for `solve`; see `Front.verify`. Reports count
        only points whose states and constraints pass, with their objectives as simulated. None, in a file `false`: points are not
        simulated, and count as the solver returns them.
    time_limit : float, optional
        Seconds of a run, after which it is ended and recorded as a timeout; called again, it goes on where it was. It changes no number.
    description : str
        One line, for lists.
    paper : sequence of mappings
        Published tables to print beside ours; see `report.published`.
    goal : mapping, optional
        Of which objective reports draw the goal attainment, between which values; see `report.goal.StatedGoal`.
    nominal : str, optional
        Label of the problem whose front reports simulate under the data of all others, which have the same variables and objectives; see
        `report.sensitivity`.
    dispersions : mapping, optional
        Settings of the case's dispersions, such as `cases` and `seed`, under which reports simulate the points of every front;
        see `report.sensitivity`.
    flights : bool, default True
        Whether reports show the flights that stand for each front.
    pictures : mapping, optional
        Figures of the report on the page of its results, with words below each: {end of a figure's name: words}, such as {"means":
        "Figure 11 of the paper: ..."}; the longest end counts, and no run depends on them. Default: `report.page.PICTURES`.
    note : str
        Text that stands at the beginning of the report.
    trust : bool
        Whether a report loads addresses that the study's folder names and that are not in the catalogue; see `load`. A study stated in
        Python is the user's own words, so it does.

    Raises
    ------
    ValueError
        A value is wrong; the message names it, before any work.

    Examples
    --------
    >>> from runs import Study
    >>> study = Study("mine", problems="four_bar_truss", solvers=["macs", "nsga2"], evaluations=500, runs=2, seed=1)
    >>> len(study.cells)
    2
    """

    name: str = field(metadata=_key(Text, decides=True))
    _: KW_ONLY
    problems: Any = field(metadata=_key(record=None))
    transcriptions: Any = field(metadata=_key(record=None), default=None)
    solvers: Any = field(metadata=_key(record=None))
    terms: Mapping[str, Mapping[str, Any]] = field(metadata=_key(record=None), default_factory=dict)
    evaluations: Any = field(metadata=_key(record=None), default=None)
    runs: int = field(metadata=_key(Count))
    seed: int = field(metadata=_key(Natural, decides=True))
    reference: Any = field(metadata=_key(ReferenceKey), default=None)
    inner: str | None = field(metadata=_key(decides=True, record=lambda inner: inner or INNER), default=None)
    tolerance: float = field(metadata=_key(Positive, decides=True), default=1e-6)
    start: Any = field(metadata=_key(decides=True, record=written), default=None)
    verify: float | None = field(metadata=_key(Positive | None, decides=True), default=VERIFY)
    time_limit: float | None = field(metadata=_key(Positive | None), default=None)
    description: str = field(metadata=_key(Text), default="")
    paper: Sequence[Mapping[str, Any]] = field(metadata=_key(), default=())
    goal: Mapping[str, Any] | None = field(metadata=_key(), default=None)
    nominal: str | None = field(metadata=_key(), default=None)
    dispersions: Mapping[str, Any] | None = field(metadata=_key(), default=None)
    flights: bool = field(metadata=_key(Flag), default=True)
    pictures: Mapping[str, str] = field(metadata=_key(dict[str, Text]), default_factory=dict)
    note: str = field(metadata=_key(Text), default="")
    trust: bool = field(default=True, repr=False)
    cells: tuple[Cell, ...] = field(init=False, repr=False)
    """Every combination, problems first."""
    objectives: Mapping[str, tuple[Objective, ...]] = field(init=False, repr=False)
    """By label of the problem."""
    payloads: Mapping[tuple[str, str, str], Payload] = field(init=False, repr=False)
    """By labels of a cell: its problem and transcription, and its solver, pickled for the processes that run them."""
    modules: Mapping[tuple[str, str, str], Modules] = field(init=False, repr=False)
    """By labels of a cell: where the code of its problem, transcription and solver is."""

    def __repr__(self) -> str:
        return short_repr(self)

    def _repr_html_(self) -> str:
        """For notebooks: a row for each cell."""
        rows = [[*cell.labels, f"{cell.evaluations or AUTO}", str(cell.runs(self.runs))] for cell in self.cells]
        heads = ["problem", "transcription", "solver", "evaluations of a run", "runs"]
        table = html_table([heads], rows, [True, True, True, False, False])
        return html_block(f"study {self.name}", table, [self.description] if self.description else [])

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip():
            raise ValueError(f"study: name must be a word, not {self.name!r}")
        if self.name in (".", "..") or set(self.name) & set("/\\\0"):
            raise ValueError(f"study: its name is that of a folder, so it must not be {self.name!r}")
        with errors_begin_with(f"study '{self.name}'"):
            for key in _KEYS:
                if key.metadata["kind"] is not None:
                    checked(getattr(self, key.name), key.metadata["kind"], key.name)
            sampling(self.start)
            if self.inner is not None:
                check_inner(self.inner)
            combined, stated, solvers = combine(
                self.problems, self.transcriptions, self.solvers, self.evaluations, self.terms, self.inner, self.start
            )
            check_against(self.paper, stated, solvers)
            if self.reference is not None:
                check_reference(self.reference, stated)
            if self.goal is not None:
                StatedGoal.of(self.goal, stated)
            if self.nominal is not None:
                check_nominal(self.nominal, stated)
            if self.dispersions is not None:
                check_dispersions(self.dispersions, stated)
        object.__setattr__(self, "cells", tuple(cell for cell, *_ in combined))
        object.__setattr__(self, "objectives", {label: tuple(problem.goals) for label, problem in stated.items()})
        object.__setattr__(self, "payloads", {cell.labels: payload for cell, payload, _ in combined})
        object.__setattr__(self, "modules", {cell.labels: modules for cell, _, modules in combined})

    @classmethod
    def load(cls, source: str | PathLike[str], trust: bool = False) -> Study:
        """The study in a TOML file, or one that comes with the project, by name.

        Parameters
        ----------
        source : path or str
        trust : bool
            Whether addresses of code in the file, and in its folder, may be loaded that are not in the catalogue: that runs the code.

        Raises
        ------
        ValueError
            There is no such study, the file is not TOML, a key or value in it is wrong, or an address in it is not trusted; the message
            names it.
        """
        keys = {key.name: key.default is MISSING and key.default_factory is MISSING for key in _KEYS} | {"name": False}
        stated = studyfile.read(source, keys, trust)
        with errors_begin_with(str(source)):
            return cls(**stated, trust=trust)

    def run(
        self,
        out: str | PathLike[str],
        *,
        jobs: int = 1,
        executor: Executor | None = None,
        retry: bool = False,
        fresh: bool = False,
        solvers: Sequence[str] | None = None,
        progress: bool = False,
    ) -> StudySummary:
        """Make the runs that `out` does not have yet, those of more solvers or problems, too; one that has begun goes on from a checkpoint.

        The record of a run has the code that made it, see `batch.code`; a warning says how many are by other code than there is now.

        Parameters
        ----------
        out : path
            A folder, made if it does not exist; see `batch.store` for its files. A finished run in it is neither made again nor changed,
            unless it is by other code and `fresh`.
        jobs : int
            How many processes of this machine work at a time.
        executor : concurrent.futures.Executor, optional
            The executor that makes the runs instead: threads, processes, a Dask client's `get_executor()`. Each of its workers keeps one
            process for its runs, so a run that crashes or hangs ends none of the workers.
        retry : bool
            Make those runs again, too, that ended with an exception. Those that were killed or took too long always are.
        fresh : bool
            Make those runs again, too, that are by other code than there is now; each is replaced as soon as its new front is there.
        solvers : sequence of str, optional
            Make the runs of these only, by label. Default: of all.
        progress : bool
            Show on the terminal how it stands.

        Returns
        -------
        StudySummary
            How many runs of each cell there are by now, and why others failed. That some failed is no error.

        Raises
        ------
        ValueError
            The study has no such solver; `out` contains another study, or is in use by another process.
        OSError
            A run's file could not be written; those that are finished stay as they are.
        KeyboardInterrupt
            Ctrl-C; the same again goes on.
        """
        from .batch.running import check_workers, execute

        check_workers(jobs, executor)
        chosen = self.chosen(solvers)
        with Store.claim(out, self.definition()) as store:
            execute(store, self.runs, chosen, self._task, self.code, jobs, executor, retry, fresh, progress)
            return store.summary(self.runs)

    def code(self, cell: Cell) -> Code:
        """The digests of the modules that a run of a cell depends on; see `batch.code`."""
        return code_of_method(*self.modules[cell.labels])

    def chosen(self, solvers: Sequence[str] | None) -> list[str]:
        """The labels of these solvers, or of all, each once. Raises ValueError if the study has no such solver."""
        known = dict.fromkeys(cell.solver for cell in self.cells)
        if isinstance(solvers, str):
            raise ValueError(f"study '{self.name}': solvers must be a sequence of labels, not '{solvers}'")
        for one in solvers or ():
            if one not in known:
                raise ValueError(f"study '{self.name}': {unknown('solver', one, known)}")
        return [one for one in known if solvers is None or one in solvers]

    def status(self, out: str | PathLike[str]) -> StudySummary:
        """The state of the runs in `out`, with the reasons of failures. Raises ValueError if it contains another study, or none."""
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
        """Tables and figures of the runs that `out` has; see `report.report.report`. Raises ValueError if it contains another study,
        or none."""
        from .report.report import report

        Store.open(out).check(self.definition())
        return report(out, foreign=foreign, figures=figures, progress=progress, trust=self.trust)

    def inner_of(self, cell: Cell) -> str:
        """The inner level of a cell's runs, by name."""
        return self._terms(cell).get("inner", self.inner or INNER)

    def sampling_of(self, cell: Cell) -> Smooth | str | None:
        """The argument `start` of `solve` in a cell's runs."""
        return sampling(self._terms(cell).get("start", self.start))

    def quick(self) -> Study:
        """The same, to see that it works, within a minute: two runs, or one where there are many cells, of at most 500 evaluations.

        Budgets of solvers on terms of their own shrink as the largest does. Its name ends in -quick.
        """
        share = min(1.0, 500 / max(cell.planned for cell in self.cells))
        own = {label: dict(terms) for label, terms in self.terms.items()}
        for label, terms in own.items():
            if "evaluations" in terms:
                given = {cell.problem: cell.planned for cell in self.cells if cell.solver == label}
                terms["evaluations"] = {problem: min(n, max(50, int(share * n))) for problem, n in given.items()}
        budgets = {cell.problem: min(cell.planned, 500) for cell in self.cells if "evaluations" not in own.get(cell.solver, {})}
        runs = min(self.runs, 2 if len(self.cells) <= 8 else 1)
        return replace(self, name=f"{self.name}-quick", runs=runs, evaluations=budgets or None, terms=own)

    def definition(self) -> dict[str, Any]:
        """The study as plain data: the value of each key, the cells, and under "decides" the keys that decide the numbers."""
        recorded = {one.name: one.metadata for one in _KEYS if one.metadata["record"] is not None}
        return {
            **{name: key["record"](getattr(self, name)) for name, key in recorded.items()},
            "decides": [name for name, key in recorded.items() if key["decides"]],
            "objectives": {
                label: [{"name": goal.name, "unit": goal.unit, "sense": goal.sense} for goal in goals]
                for label, goals in self.objectives.items()
            },
            "cells": [cell.to_dict() for cell in self.cells],
        }

    def _task(self, run: StoredRun, checkpoint: Path) -> RunTask:
        """The task that makes a run."""
        return RunTask(
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
        """The terms of a cell's runs: the problem's inner level and start where the study states none, and the solver's own."""
        return {**cell.terms, **self.terms.get(cell.solver, {})}


_KEYS = tuple(one for one in fields(Study) if one.metadata)
