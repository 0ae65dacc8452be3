"""What `macs serve` shows: the files of a front, of a folder of fronts, or of a study. They are looked at when the page asks for the state,
and read again only once they have changed. Nothing is written, and nothing that a file names is run unasked."""

from __future__ import annotations

import hashlib
import threading
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike, stat_result
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from macs.front import Front
from problems.compiled import Objective

from ..batch.cells import Cell
from ..batch.running import ProgressRecord, read_progress
from ..batch.store import Store, StoredRun, StudySummary
from ..execution.task import History
from ..files import checked, read_record
from ..report.comparison import compared, comparisons
from ..report.report import tables_across
from .page import packed
from .pages import cells_data, failures_data, measured_data, problem_name, read_front, run_data, solver_name, tables_data
from .points import LIMITS, curve_data, details, goals_data

SUFFIX = ".nc"
T = TypeVar("T")


def stamps_of(*paths: Path) -> str:
    """A text that differs once one of some files has been written again, or is gone: their numbers, sizes and times."""
    known = [_stat(path) for path in paths]
    return str([one and (one.st_ino, one.st_size, one.st_mtime_ns) for one in known])


def _stat(path: Path) -> stat_result | None:
    """About a file; None if it is not there, or gone by now."""
    try:
        return path.stat()
    except OSError:
        return None


class Readings:
    """What was made of files; it is made again once one of them has changed."""

    def __init__(self) -> None:
        self._known: dict[tuple[Path, ...], tuple[str, Any]] = {}

    def of(self, make: Callable[[], T], *paths: Path) -> T:
        """What `make` returns for these files, or did when they were the same as now."""
        stamps = stamps_of(*paths)  # before the files are read: what changes meanwhile is read again
        if self._known.get(paths, ("",))[0] != stamps:
            self._known[paths] = stamps, make()
        return self._known[paths][1]

    def forget(self) -> None:
        """Forget what was made of files that are gone."""
        self._known = {paths: one for paths, one in self._known.items() if any(map(_stat, paths))}


@dataclass(frozen=True)
class Answer:
    """Plain data as JSON, and a word that differs once they differ."""

    content: bytes
    version: str

    @classmethod
    def of(cls, data: Any) -> Answer:
        """The answer that has these data."""
        content = msgspec.json.encode(data)
        return cls(content, hashlib.sha256(content).hexdigest()[:16])


class Followed(ABC):
    """Files that a page follows. One request at a time looks at them; what was seen before stays if they cannot be read now."""

    title: str

    def __init__(self) -> None:
        self._looking = threading.Lock()
        self._state: Mapping[str, Any] = {}
        self.answers: dict[str, Answer] = {}  # "data": as `pages` has them, but for comparisons of solvers; "going": points so far
        self.fronts: dict[str, Front] = {}  # of the runs in the data, by the name of their details

    @abstractmethod
    def look(self) -> Mapping[str, Any]:
        """Renew answers and fronts; returns the state. Raises ValueError or OSError where the files cannot be read."""

    def status(self) -> dict[str, Any]:
        """The state, what cannot be read now, and the version of each answer."""
        with self._looking:
            trouble = ""
            try:
                self._state = self.look()
            except (ValueError, OSError) as error:
                trouble = _line(error)
            return {**self._state, "trouble": trouble, "versions": {name: one.version for name, one in self.answers.items()}}

    def answer(self, name: str) -> bytes | None:
        """The content of an answer; None if there is none of this name."""
        return self.answers[name].content if name in self.answers else None

    def details(self, block: str) -> bytes | None:
        """What is shown of the points of a run once they are selected, compressed; None if there is no such run."""
        front = self.fronts.get(block)
        return None if front is None else packed(details(front, LIMITS.most))


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


@dataclass(frozen=True)
class Shown:
    """A front, and its data on the page."""

    front: Front
    data: msgspec.Raw


class FollowedFronts(Followed):
    """One front, or all fronts of a folder, compared where they are of the same problem."""

    def __init__(self, path: str | PathLike[str]) -> None:
        super().__init__()
        self._path, self.title = Path(path), Path(path).resolve().name
        self._single, self._readings = not self._path.is_dir(), Readings()
        if self._single:
            read_front(self._path)
        elif not self._files():
            raise ValueError(f"'{path}' contains neither a study (study.json) nor a front (*{SUFFIX})")

    def look(self) -> Mapping[str, Any]:
        """See `Followed`."""
        found: dict[Path, Shown] = {}
        unreadable = []
        for path in self._files():
            try:
                found[path] = self._readings.of(lambda path=path: self._show(path), path)  # type: ignore[misc]
            except (ValueError, OSError) as error:
                if self._single:
                    raise
                unreadable.append(f"{path.name} cannot be read now: {_line(error)}")
        self._readings.forget()
        groups: dict[Any, dict[Path, Shown]] = {}
        for path, one in found.items():
            groups.setdefault((problem_name(one.front), tuple(one.front.goals)), {})[path] = one
        shown = [self._comparison(name, goals, ones) for (name, goals), ones in groups.items()]
        title, kind = (shown[0]["name"], "front") if self._single else (self.title, "fronts")
        self.answers["data"] = Answer.of({"title": title, "kind": kind, "comparisons": shown, "unreadable": unreadable})
        self.fronts = {_block(path): one.front for path, one in found.items()}
        return {}

    def _files(self) -> list[Path]:
        if self._single:
            return [self._path]
        return sorted(path for path in self._path.iterdir() if path.suffix == SUFFIX and not path.name.startswith("."))

    def _label(self, path: Path, front: Front) -> str:
        """The name of the solver; of a folder that of the file in its place."""
        return solver_name(front) if self._single else path.stem

    def _show(self, path: Path) -> Shown:
        version, front = stamps_of(path), read_front(path)  # what changes meanwhile is read again
        data = run_data(front, self._label(path, front), block=_block(path), version=version, curve=curve_data(front))
        return Shown(front, msgspec.Raw(msgspec.json.encode(data)))

    def _comparison(self, name: str, goals: Sequence[Objective], shown: Mapping[Path, Shown]) -> dict[str, Any]:
        """As `front_page` has it."""
        labels = [self._label(path, one.front) for path, one in shown.items()]
        ids = f"{name}, {', '.join(goal.name for goal in goals)}"
        return {"id": ids, "name": name, "goals": goals_data(goals), "solvers": labels, "runs": [one.data for one in shown.values()]}


def _block(path: Path) -> str:
    """The name of a front in addresses: of letters that say nothing of its path."""
    return hashlib.sha256(path.name.encode()).hexdigest()[:16]


def _files_of(run: StoredRun) -> tuple[Path, Path]:
    """The front of a run, and its record."""
    return run.path, run.path.with_suffix(".json")


class FollowedStore(Store):
    """A study's folder; the same run is the same object as long as its front and its record are the same files."""

    def __init__(self, path: Path, definition: Mapping[str, Any], trust: bool = False) -> None:
        super().__init__(path, definition, trust)
        self.readings = Readings()

    def run(self, cell: Cell, number: int) -> StoredRun:
        """One run."""
        front = self.front_path(cell, number)
        return self.readings.of(lambda: super(FollowedStore, self).run(cell, number), front, front.with_suffix(".json"))


Key = tuple[str, int]
"""The folder of a cell, and the number of a run."""


def key_of(run: StoredRun) -> Key:
    """What names a run in the study's folder."""
    return run.cell.folder, run.number


class FollowedStudy(Followed):
    """A study's folder, while the study runs or later."""

    def __init__(self, folder: str | PathLike[str], trust: bool = False) -> None:
        super().__init__()
        self._folder, self._trust = Path(folder), trust
        self._store = FollowedStore.open(folder, trust)
        self.title = str(self._store.definition["name"])
        self._stores, self._shown = Readings(), Readings()
        self._measuring, self._measured = threading.Lock(), Answer(b"", "")

    def look(self) -> Mapping[str, Any]:
        """See `Followed`."""
        store = self._stores.of(lambda: FollowedStore.open(self._folder, self._trust), self._folder / "study.json")
        self._store = store
        summary, progress = store.summary(), read_progress(store.path)
        shown, unreadable = self._read(summary)
        self._shown.forget()
        store.readings.forget()
        going = _going(summary, progress)
        found = self._comparisons(shown)
        data = {"title": summary.name, "kind": "study", "failures": failures_data(summary), "unreadable": unreadable}
        self.answers["data"] = Answer.of({**data, "comparisons": [one for one, _ in found]})
        self.answers["going"] = Answer.of({one["id"]: _points_so_far(one["goals"], runs, going) for one, runs in found})
        # Made once it is asked for, as it may take minutes.
        self.answers["measures"] = Answer(b"", Answer.of([stamps_of(*_files_of(run)) for run in summary.runs]).version)
        self.fronts = {self._block(run): shown[key_of(run)].front for run in summary.runs if key_of(run) in shown}
        return _state(summary, progress, going)

    def answer(self, name: str) -> bytes | None:
        """See `Followed`. The comparison of solvers is made now, unless it is known for these runs."""
        if name != "measures" or name not in self.answers:
            return super().answer(name)
        with self._measuring:
            wanted = self.answers[name].version
            if self._measured.version != wanted:
                self._measured = Answer(msgspec.json.encode(_measures(self._store)), wanted)
            return self._measured.content

    def _read(self, summary: StudySummary) -> tuple[dict[Key, Shown], list[str]]:
        """The finished runs that can be read, and why others cannot now."""
        shown: dict[Key, Shown] = {}
        unreadable: list[str] = []
        for run in summary.runs:
            if run.finished:
                try:
                    shown[key_of(run)] = self._shown.of(lambda run=run: self._show(run), *_files_of(run))  # type: ignore[misc]
                except (ValueError, OSError) as error:
                    unreadable.append(f"Run {run.number} of {run.cell.name} cannot be read now: {_line(error)}")
        return shown, unreadable

    def _show(self, run: StoredRun) -> Shown:
        try:
            front = run.front
        except ValueError:  # where its problem is not trusted, it cannot be simulated, but shown
            front = read_front(run.path)
        more = {"seed": str(run.seed), "version": stamps_of(*_files_of(run))}
        return Shown(front, msgspec.Raw(msgspec.json.encode(run_data(front, run.cell.solver, run.number, self._block(run), **more))))

    def _block(self, run: StoredRun) -> str:
        """The name of a run in addresses and in the page: the same as long as the study has the same cells."""
        return f"{self._store.cells.index(run.cell)}-{run.number}"

    def _comparisons(self, shown: Mapping[Key, Shown]) -> list[tuple[dict[str, Any], list[StoredRun]]]:
        """As `study_page` has them, but for measures and tables; of each all runs, made or not."""
        objectives = self._store.definition.get("objectives", {})
        found = []
        for (problem, transcription), solvers in compared(self._store).items():
            runs = [run for ones in solvers.values() for run in ones]
            read = [shown[key_of(run)] for run in runs if key_of(run) in shown]
            if not read and problem not in objectives:  # studies by older versions do not state them
                continue
            goals = goals_data(read[0].front.goals) if read else objectives[problem]
            name = problem_name(read[0].front) if read and read[0].front.source is not None and ".py:" in problem else problem
            ids = {"id": f"{problem}, {transcription}", "name": f"{name}, {transcription}"}
            found.append(({**ids, "goals": goals, "solvers": list(solvers), "runs": [one.data for one in read]}, runs))
        return found


def _measures(store: Store) -> dict[str, Any]:
    """Indicators, attainment surfaces, convergence and tables of the finished runs."""
    try:
        summary = store.summary()
        found = comparisons(store, {}) if summary.finished else []
        data = {f"{one.problem}, {one.transcription}": measured_data(one, store.definition) for one in found}
        tables = tables_data(tables_across(found, store.definition))
        return {"comparisons": data, "tables": tables, "finished": summary.finished, "trouble": ""}
    except (ValueError, OSError) as error:
        return {"comparisons": {}, "tables": [], "finished": 0, "trouble": _line(error)}


@dataclass(frozen=True)
class Going:
    """A run that is being made: its evaluations and seconds so far, and the objectives, all minimised, of its last sample."""

    evaluations: int = 0
    elapsed: float = 0.0
    F: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))


def _going(summary: StudySummary, progress: ProgressRecord | None) -> dict[Key, Going]:
    """The runs that are being made."""
    if progress is None:
        return {}
    told = {(one.folder, one.number): one for one in progress.going}
    found: dict[Key, Going] = {}
    for run in summary.runs:
        key = key_of(run)
        samples = [(known.st_mtime, one) for one in run.path.parent.glob(f"{run.path.stem}.*samples") if (known := _stat(one))]
        written, path = max(samples, default=(0.0, run.path.with_suffix(".samples")))
        # On the workers of an executor only the samples show that a run is being made.
        if not run.finished and (key in told or written >= progress.began):
            last = _last_sample(path)
            found[key] = replace(last, evaluations=told[key].evaluations, elapsed=told[key].elapsed) if key in told else last
    return found


def _last_sample(path: Path) -> Going:
    """The last sample in a file; one without points if there is none that can be read."""
    try:
        columns = checked(read_record(path), History)
        return Going(columns["evaluations"][-1], columns["elapsed"][-1], np.array(columns["F"][-1], dtype=float))
    except (OSError, ValueError, LookupError):  # it is replaced, or deleted as the run has ended: the next look shows
        return Going()


def _points_so_far(goals: Sequence[Mapping[str, Any]], runs: Sequence[StoredRun], going: Mapping[Key, Going]) -> list[dict[str, Any]]:
    """The last sample of each run that is being made, objectives as columns in the user's senses."""
    signs = np.array([Objective(**goal).sign for goal in goals])
    made = [(run, going[key_of(run)].F) for run in runs if key_of(run) in going]
    return [
        {"solver": run.cell.solver, "number": run.number, "objectives": (F * signs).T.tolist()}
        for run, F in made
        if F.ndim == 2 and F.shape[1] == len(signs)
    ]


def _state(summary: StudySummary, progress: ProgressRecord | None, going: Mapping[Key, Going]) -> dict[str, Any]:
    """How many runs of each cell there are in which state, and the runs that are being made."""

    def state(run: StoredRun) -> str:
        return "running" if key_of(run) in going else {"missing": "waiting"}.get(run.state, run.state)

    made = [
        {
            "name": f"{run.cell.name}, run {run.number}",
            "evaluations": going[key_of(run)].evaluations,
            "budget": run.cell.evaluations,
            "elapsed": going[key_of(run)].elapsed,
        }
        for run in sorted(summary.runs, key=lambda run: (run.number, run.cell.name))
        if key_of(run) in going
    ]
    states = dict.fromkeys(("finished", "running", "waiting", "failed"), 0) | Counter(map(state, summary.runs))
    times = {"elapsed": None, "left": None} if progress is None else {"elapsed": progress.elapsed, "left": progress.left}
    total = {"total": len(summary.runs), **states, "alive": progress is not None, **times}
    return {**total, "cells": cells_data(summary, state), "going": made}


def followed(path: Path, trust: bool = False) -> Followed:
    """What is shown of a path: a study's folder, a front, or a folder of fronts. Raises ValueError if it is none of these."""
    if not path.exists():
        raise ValueError(f"there is no file or folder '{path}'")
    return FollowedStudy(path, trust) if (path / "study.json").exists() else FollowedFronts(path)
