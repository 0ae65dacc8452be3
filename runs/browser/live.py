"""What `macs serve` shows: the files of a front, of a folder of fronts, or of a study. They are looked at when the page asks for the state,
and read again only once they have changed. Nothing is written, and nothing that a file names is run unasked."""

from __future__ import annotations

import hashlib
import threading
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from macs.front import Front
from problems.compiled import Objective

from ..batch.cells import Cell
from ..batch.running import ProgressRecord, read_progress
from ..batch.store import MISSING, Store, StoredRun, StudySummary
from ..execution.task import History, samples_path
from ..files import checked, read_record
from ..report.comparison import compared, comparisons
from ..report.report import tables_across
from .page import packed
from .pages import cells_data, failures_data, measured_data, problem_name, read_front, run_data, solver_name, tables_data
from .points import LIMITS, details, goals_data

SUFFIX = ".nc"


class Stamp(NamedTuple):
    """What differs once a file has been written again: its number, its size, and the time in seconds since 1970."""

    number: int
    size: int
    time: float


def stamp_of(path: Path) -> Stamp | None:
    """The stamp of a file; None if it is not there."""
    try:
        found = path.stat()
    except OSError:
        return None
    return Stamp(found.st_ino, found.st_size, found.st_mtime_ns * 1e-9)


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
            return {**self._state, "trouble": trouble, "versions": self.versions()}

    def versions(self) -> dict[str, str]:
        """The version of each answer."""
        return {name: one.version for name, one in self.answers.items()}

    def answer(self, name: str) -> Answer | None:
        """The answer of this name; None if there is none."""
        return self.answers.get(name)

    def details(self, block: str) -> bytes | None:
        """What is shown of the points of a run once they are selected, compressed; None if there is no such run."""
        front = self.fronts.get(block)
        return None if front is None else packed(details(front, LIMITS.most))


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


class FollowedFronts(Followed):
    """One front, or all fronts of a folder, compared where they are of the same problem."""

    def __init__(self, path: str | PathLike[str]) -> None:
        super().__init__()
        self._path, self.title = Path(path), Path(path).resolve().name
        self._single = not self._path.is_dir()
        self._read: dict[Path, tuple[Stamp | None, Front]] = {}
        if self._single:
            read_front(self._path)
        elif not self._files():
            raise ValueError(f"'{path}' contains neither a study (study.json) nor a front (*{SUFFIX})")

    def look(self) -> Mapping[str, Any]:
        """See `Followed`."""
        before, self._read = self._read, {}
        unreadable = []
        for path in self._files():
            stamp = stamp_of(path)
            try:
                self._read[path] = before[path] if path in before and before[path][0] == stamp else (stamp, read_front(path))
            except (ValueError, OSError) as error:
                if self._single:
                    raise
                unreadable.append(f"{path.name} cannot be read now: {_line(error)}")
        groups: dict[Any, list[Path]] = {}
        for path, (_, front) in self._read.items():
            groups.setdefault((problem_name(front), tuple(front.goals)), []).append(path)
        shown = [self._comparison(name, goals, paths) for (name, goals), paths in groups.items()]
        title, kind = (shown[0]["name"], "front") if self._single else (self.title, "fronts")
        self.answers["data"] = Answer.of({"title": title, "kind": kind, "comparisons": shown, "unreadable": unreadable})
        self.fronts = {_block(path): front for path, (_, front) in self._read.items()}
        return {}

    def _files(self) -> list[Path]:
        if self._single:
            return [self._path]
        return sorted(path for path in self._path.iterdir() if path.suffix == SUFFIX and not path.name.startswith("."))

    def _comparison(self, name: str, goals: Sequence[Objective], paths: Sequence[Path]) -> dict[str, Any]:
        """As `front_page` has it; of a folder with the names of the files in place of solvers."""
        labels = [solver_name(self._read[path][1]) if self._single else path.stem for path in paths]
        runs = [
            run_data(self._read[path][1], label, block=_block(path), version=str(self._read[path][0]))
            for path, label in zip(paths, labels, strict=True)
        ]
        ids = f"{name}, {', '.join(goal.name for goal in goals)}"
        return {"id": ids, "name": name, "goals": goals_data(goals), "solvers": labels, "runs": runs}


def _block(path: Path) -> str:
    """The name of a front in addresses: of letters that say nothing of its path."""
    return hashlib.sha256(path.name.encode()).hexdigest()[:16]


class FollowedStore(Store):
    """A study's folder; the same run is the same object as long as its front and its record are the same files."""

    def __init__(self, path: Path, definition: Mapping[str, Any], trust: bool = False) -> None:
        super().__init__(path, definition, trust)
        self.stamps: dict[tuple[str, int], tuple[Stamp | None, Stamp | None]] = {}
        self._runs: dict[tuple[str, int], StoredRun] = {}
        self.own_stamp = stamp_of(path / "study.json")  # differs once the study is to have more runs, say

    def run(self, cell: Cell, number: int) -> StoredRun:
        """One run."""
        key, front = (cell.folder, number), self.path / cell.folder / f"{number:04d}.nc"
        # Taken before the files are read: what changes meanwhile is read again.
        stamps = stamp_of(front), stamp_of(front.with_suffix(".json"))
        if self.stamps.get(key) != stamps or key not in self._runs:
            self._runs[key] = super().run(cell, number)
            self.stamps[key] = stamps
        return self._runs[key]


Key = tuple[str, int]
"""The folder of a cell, and the number of a run."""


def key_of(run: StoredRun) -> Key:
    """What names a run in the study's folder."""
    return run.cell.folder, run.number


@dataclass(frozen=True)
class Sampled:
    """The last sample of a run that has not ended."""

    stamp: Stamp | None
    evaluations: int
    elapsed: float
    F: np.ndarray


class FollowedStudy(Followed):
    """A study's folder, while the study runs or later."""

    def __init__(self, folder: str | PathLike[str], trust: bool = False) -> None:
        super().__init__()
        self._store = FollowedStore.open(folder, trust)
        self.title = str(self._store.definition["name"])
        self._read: dict[Key, tuple[StoredRun, Front, msgspec.Raw]] = {}  # finished runs, and their data on the page
        self._sampled: dict[Key, Sampled] = {}
        self._goals: dict[str, list[dict[str, Any]]] = {}
        # What the files were of which the comparison of solvers was made or is to be made, when that ended, and the seconds that it took.
        self._measuring, self._measured, self._wanted = threading.Lock(), Answer(b"", ""), ""
        self._ended, self._took = 0.0, 0.0

    def look(self) -> Mapping[str, Any]:
        """See `Followed`."""
        if self._store.own_stamp != stamp_of(self._store.path / "study.json"):
            self._store = FollowedStore.open(self._store.path, self._store.trust)
        store = self._store
        summary, progress = store.summary(), read_progress(store.path)
        unreadable = self._read_fronts(summary)
        self._sampled = self._read_samples(summary, progress)
        if progress is not None:
            self._goals |= {label: [msgspec.to_builtins(goal) for goal in goals] for label, goals in progress.goals.items()}
        shown = self._comparisons()
        data = {"title": summary.name, "kind": "study", "failures": failures_data(summary), "unreadable": unreadable}
        self.answers["data"] = Answer.of({**data, "comparisons": [one for one, _ in shown]})
        self.answers["going"] = Answer.of({one["id"]: self._going(one["goals"], runs) for one, runs in shown})
        self.fronts = {self._block(run): front for run, front, _ in self._read.values()}
        # While the study runs, comparing takes at most a tenth of the time.
        if progress is None or time.monotonic() - self._ended >= 10.0 * self._took:
            self._wanted = Answer.of([str(store.stamps), sorted(self._goals)]).version
        return self._status(summary, progress)

    def versions(self) -> dict[str, str]:
        """See `Followed`."""
        return {**super().versions(), "measures": self._wanted}

    def answer(self, name: str) -> Answer | None:
        """See `Followed`. The comparison of solvers, which may take minutes, is made once it is asked for."""
        if name != "measures" or not self._wanted:
            return super().answer(name)
        with self._measuring:
            wanted = self._wanted
            if self._measured.version != wanted:
                began = time.monotonic()
                self._measured = Answer(msgspec.json.encode(self._measures(self._store)), wanted)
                self._ended = time.monotonic()
                self._took = self._ended - began
            return self._measured

    def _measures(self, store: Store) -> dict[str, Any]:
        """Indicators, attainment surfaces, convergence and tables of the finished runs."""
        try:
            summary = store.summary()
            found = comparisons(store, {}) if summary.finished else []
            data = {f"{one.problem}, {one.transcription}": measured_data(one, store.definition) for one in found}
            tables = tables_data(tables_across(found, store.definition))
            return {"comparisons": data, "tables": tables, "finished": summary.finished, "trouble": ""}
        except (ValueError, OSError) as error:
            return {"comparisons": {}, "tables": [], "finished": 0, "trouble": _line(error)}

    def _read_fronts(self, summary: StudySummary) -> list[str]:
        """Read the fronts that are new; returns why others cannot be read now."""
        unreadable: list[str] = []
        before, self._read = self._read, {}
        for run in summary.runs:
            key = key_of(run)
            if not run.finished:
                continue
            if key in before and before[key][0] is run:
                self._read[key] = before[key]
                continue
            try:
                front = _front_of(run)
            except (ValueError, OSError) as error:
                unreadable.append(f"Run {run.number} of {run.cell.name} cannot be read now: {_line(error)}")
                continue
            more = {"seed": str(run.seed), "version": str(self._store.stamps[key])}
            data = run_data(front, run.cell.solver, run.number, self._block(run), **more)
            self._read[key] = run, front, msgspec.Raw(msgspec.json.encode(data))
        return unreadable

    def _read_samples(self, summary: StudySummary, progress: ProgressRecord | None) -> dict[Key, Sampled]:
        """The runs that are being made, each with its last sample if it has one."""
        if progress is None:
            return {}
        told = {(one.folder, one.number): one for one in progress.going}
        found: dict[Key, Sampled] = {}
        for run in summary.runs:
            key, path = key_of(run), samples_path(run.path.with_suffix(".checkpoint"))
            stamp = None if run.finished else stamp_of(path)
            # On the workers of an executor only the samples show that a run is being made.
            if key not in told and (stamp is None or stamp.time < progress.began):
                continue
            before = self._sampled.get(key)
            last = before if before is not None and before.stamp == stamp else _last_sample(path, stamp)
            if key in told:
                last = replace(last, evaluations=told[key].evaluations, elapsed=told[key].elapsed)
            found[key] = last
        return found

    def _block(self, run: StoredRun) -> str:
        """The name of a run in addresses and in the page: the same as long as the study has the same cells."""
        return f"{self._store.cells.index(run.cell)}-{run.number}"

    def _comparisons(self) -> list[tuple[dict[str, Any], list[StoredRun]]]:
        """As `study_page` has them, but for measures and tables; of each all runs, made or not."""
        shown = []
        for (problem, transcription), solvers in compared(self._store).items():
            runs = [run for ones in solvers.values() for run in ones]
            read = [self._read[key_of(run)] for run in runs if key_of(run) in self._read]
            if not read and problem not in self._goals:
                continue
            goals = goals_data(read[0][1].goals) if read else self._goals[problem]
            name = problem_name(read[0][1]) if read and read[0][1].source is not None and ".py:" in problem else problem
            ids = {"id": f"{problem}, {transcription}", "name": f"{name}, {transcription}"}
            shown.append(({**ids, "goals": goals, "solvers": list(solvers), "runs": [data for *_, data in read]}, runs))
        return shown

    def _going(self, goals: Sequence[Mapping[str, Any]], runs: Sequence[StoredRun]) -> list[dict[str, Any]]:
        """The points so far of each run that is being made, objectives as columns in the user's senses."""
        signs = np.array([Objective(**goal).sign for goal in goals])
        found = []
        for run in runs:
            sampled = self._sampled.get(key_of(run))
            if sampled is not None and sampled.F.ndim == 2 and sampled.F.shape[1] == len(signs):
                objectives = (sampled.F * signs).T.tolist()
                found.append({"solver": run.cell.solver, "number": run.number, "objectives": objectives})
        return found

    def _status(self, summary: StudySummary, progress: ProgressRecord | None) -> dict[str, Any]:
        """How many runs of each cell there are in which state, and the runs that are being made."""
        going = self._sampled

        def state(run: StoredRun) -> str:
            if run.finished:
                return "finished"
            return "running" if key_of(run) in going else "waiting" if run.status == MISSING else "failed"

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
        times = {"elapsed": progress.elapsed, "left": progress.left} if progress is not None else {"elapsed": None, "left": None}
        total = {"total": len(summary.runs), **states, "alive": progress is not None, **times}
        return {**total, "cells": cells_data(summary, state), "going": made}


def _front_of(run: StoredRun) -> Front:
    """The front of a run as data: where its problem is not trusted, it cannot be simulated, but shown."""
    try:
        return run.front
    except ValueError:
        return read_front(run.path)


def _last_sample(path: Path, stamp: Stamp | None) -> Sampled:
    """The last sample in a file; one without points if there is none that can be read."""
    try:
        columns = checked(read_record(path), History)
        return Sampled(stamp, columns["evaluations"][-1], columns["elapsed"][-1], np.array(columns["F"][-1], dtype=float))
    except (OSError, ValueError, LookupError):  # it is replaced, or deleted as the run has ended: the next look shows
        return Sampled(stamp, 0, 0.0, np.empty((0, 0)))


def followed(path: Path, trust: bool = False) -> Followed:
    """What is shown of a path: a study's folder, a front, or a folder of fronts. Raises ValueError if it is none of these."""
    if not path.exists():
        raise ValueError(f"there is no file or folder '{path}'")
    return FollowedStudy(path, trust) if (path / "study.json").exists() else FollowedFronts(path)
