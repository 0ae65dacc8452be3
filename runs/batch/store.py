"""The folder of a study: what is in it, who may write to it, and how what is in it is read.

study.json      what the study is, and how many runs of each cell there are to be
CELL/RUN.nc     the front of a finished run, 0001.nc being the first: a run is finished once it has one, which nobody touches any more
CELL/RUN.json   of a finished run: how it converged; of any other: how it ended, with a traceback
CELL/RUN.checkpoint, CELL/RUN.samples   of a run that is going on, or was: where it goes on. Its own process writes these two
.lock           held by the process that runs the study, as long as it lives

Every file is written whole, the others by the process that runs the study alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from macs.front import Front
from macs.io.atomic import write_whole
from macs.io.text import duration, text_table

from ..execution.task import CRASHED, FINISHED, KILLED, MEMORY, TIMEOUT, Outcome, samples_path
from .cells import Cell
from .file import same
from .lock import locked

MISSING, UNREADABLE = "missing", "unreadable"


FORMAT = "macs study"


VERSION = 1


FREE = ("description", "runs", "time_limit", "reference", "paper", "goal", "nominal", "flights", "note", "cells")
"""What may differ between two calls, or is compared on its own; everything else decides the numbers."""


@dataclass(frozen=True)
class StoredRun:
    """One run of a cell, as the folder has it.

    Attributes
    ----------
    cell : Cell
    number : int
        1, 2, ...
    seed : int
    status : str
        "finished", "crashed", "timeout", "out of memory", "killed", "missing", or "unreadable": there is a front that cannot be read.
    message, traceback : str
        Why it is not finished; of a finished one with an empty front, why that is empty.
    wall_time : float
        Seconds, of its process; 0 where nothing is known.
    history : mapping
        Of a finished run: "evaluations", "inner_iterations", "gradient_solves", "elapsed" and "F" (a list of objectives, all minimised) at
        about thirty counts, the last being its front's. Empty if its file is gone.
    flown : mapping
        Of a finished run whose points were flown: see `Outcome.flown`.
    path : Path
        Where its front is, or would be.
    """

    cell: Cell
    number: int
    seed: int
    status: str
    message: str
    traceback: str = field(repr=False)
    wall_time: float
    history: Mapping[str, Any] = field(repr=False)
    flown: Mapping[str, Any] = field(repr=False)
    path: Path

    @property
    def finished(self) -> bool:
        """Whether there is a front."""
        return self.status == FINISHED

    @cached_property
    def front(self) -> Front:
        """Its front, read when it is asked for. Raises ValueError or FileNotFoundError if there is none to read."""
        return Front.load(self.path)


@dataclass(frozen=True)
class Summary:
    """How a study stands.

    Attributes
    ----------
    name : str
    path : Path
    runs : tuple of StoredRun
        All that there are to be, cell by cell.
    """

    name: str
    path: Path
    runs: tuple[StoredRun, ...] = field(repr=False)

    def count(self, *statuses: str) -> int:
        """How many runs have one of the statuses."""
        return sum(run.status in statuses for run in self.runs)

    @property
    def finished(self) -> int:
        """Runs with a front."""
        return self.count(FINISHED)

    @property
    def failed(self) -> int:
        """Runs that ended without one, or whose front cannot be read."""
        return self.count(CRASHED, TIMEOUT, MEMORY, KILLED, UNREADABLE)

    @property
    def missing(self) -> int:
        """Runs that have not been made."""
        return self.count(MISSING)

    @property
    def cells(self) -> dict[Cell, tuple[StoredRun, ...]]:
        """Runs by cell."""
        found: dict[str, list[StoredRun]] = {}
        for run in self.runs:
            found.setdefault(run.cell.folder, []).append(run)
        return {runs[0].cell: tuple(runs) for runs in found.values()}

    def __str__(self) -> str:

        return summary_text(self)


class Store:
    """A study's folder.

    Attributes
    ----------
    path : Path
    definition : dict
        What `Study.definition` gave: "name", "seed", "runs", "reference", "paper", and so on.
    cells : tuple of Cell
    """

    def __init__(self, path: Path, definition: Mapping[str, Any]) -> None:
        self.path = path
        self.definition = dict(definition)
        self.cells = tuple(Cell.from_dict(data) for data in definition["cells"])

    @classmethod
    def open(cls, out: str | PathLike[str]) -> Store:
        """The folder of a study. Raises ValueError if there is none, or it cannot be read."""
        path = Path(out)
        record = path / "study.json"
        try:
            if not path.is_dir():
                raise ValueError(f"there is no folder '{out}'" if not path.exists() else f"'{out}' is not a folder")
            data = json.loads(record.read_text(encoding="utf-8"))
            if data.get("format") != FORMAT:
                raise ValueError(f"'{record}' is no study's")
            if data["version"] > VERSION:
                raise ValueError(f"'{out}' was written by a later MACS: update MACS")
            return cls(path, data["study"])
        except FileNotFoundError:
            raise ValueError(f"'{out}' holds no study: there is no study.json in it") from None
        except OSError as error:
            raise ValueError(f"'{out}' cannot be read: {error.strerror or error}") from error
        except (UnicodeDecodeError, json.JSONDecodeError, AttributeError, KeyError, TypeError) as error:
            raise ValueError(f"'{record}' cannot be read: {type(error).__name__}: {error}") from error

    @classmethod
    @contextmanager
    def claim(cls, out: str | PathLike[str], definition: Mapping[str, Any]) -> Iterator[Store]:
        """The folder of this study, made if there is none, and no other process's as long as this is entered. Its record says how many runs
        were ever asked for.

        Raises
        ------
        ValueError
            It holds another study, or other things, or another process has claimed it.
        OSError
            It cannot be written.
        """
        path = Path(out)
        cls._suits(path, definition)
        path.mkdir(parents=True, exist_ok=True)
        with locked(path / ".lock"):
            known = cls._suits(path, definition)
            latest = {**definition, "runs": max(definition["runs"], known.definition["runs"] if known else 0)}
            if known is None or latest != known.definition:
                record = {"format": FORMAT, "version": VERSION, "study": latest}
                write_whole(path / "study.json", json.dumps(record, indent=1).encode() + b"\n")
            yield cls(path, latest)

    @classmethod
    def _suits(cls, path: Path, definition: Mapping[str, Any]) -> Store | None:
        """What is in a folder; None if it is new. Raises ValueError if it holds something else."""
        if (path / "study.json").exists():
            store = cls.open(path)
            store.check(definition)
            return store
        if path.exists() and not path.is_dir():
            raise ValueError(f"'{path}' is not a folder")
        others = sorted(one.name for one in path.iterdir() if not one.name.startswith(".")) if path.exists() else []
        if others:
            raise ValueError(f"'{path}' holds no study but other things, '{others[0]}' for one; give a folder of its own")
        return None

    def check(self, definition: Mapping[str, Any]) -> None:
        """Raise ValueError that says what differs unless this is the same study; only the number of runs and the time limit may differ."""
        here, there = ({key: one[key] for key in one if key not in FREE} for one in (definition, self.definition))
        ours = {cell.name: cell.to_dict() for cell in map(Cell.from_dict, definition["cells"])}
        theirs = {cell.name: cell.to_dict() for cell in self.cells}
        different = same(there, here)
        for name in (*theirs, *ours):
            if not different and (name in ours) != (name in theirs):
                different = f"cell '{name}' is {'there but not here' if name in theirs else 'here but not there'}"
            different = different or same(theirs[name], ours[name], f"{name}: ")
        if different:
            raise ValueError(f"'{self.path}' holds another study: {different}; give another folder")

    # What is in it

    def runs(self, count: int | None = None) -> Iterator[StoredRun]:
        """All runs there are to be, cell by cell: finished, failed, unreadable and missing ones. By default as many as were asked for."""
        for cell in self.cells:
            for number in range(1, (self.definition["runs"] if count is None else count) + 1):
                yield self.run(cell, number)

    def run(self, cell: Cell, number: int) -> StoredRun:
        """One run."""
        path, record = self.front_path(cell, number), _record(self.record_path(cell, number))
        status, message = record.get("status", MISSING), str(record.get("message", ""))
        if path.exists():
            status = FINISHED
            try:
                _check(path, record)
            except (ValueError, OSError) as error:
                status, message = UNREADABLE, str(error)
        elif status not in (CRASHED, TIMEOUT, MEMORY, KILLED):
            status, message = MISSING, ""
        return StoredRun(
            cell=cell,
            number=number,
            seed=cell.seed(self.definition["seed"], number),
            status=status,
            message=message,
            traceback=str(record.get("traceback", "")),
            wall_time=record["wall_time"] if isinstance(record.get("wall_time"), float) else 0.0,
            history=record["history"] if isinstance(record.get("history"), dict) else {},
            flown=record["flown"] if isinstance(record.get("flown"), dict) else {},
            path=path,
        )

    def summary(self, count: int | None = None) -> Summary:
        """How it stands."""
        return Summary(self.definition["name"], self.path, tuple(self.runs(count)))

    def front_path(self, cell: Cell, number: int) -> Path:
        """Where the front of a run is."""
        return self.path / cell.folder / f"{number:04d}.nc"

    def record_path(self, cell: Cell, number: int) -> Path:
        """Where it is said how a run went."""
        return self.path / cell.folder / f"{number:04d}.json"

    def checkpoint_path(self, cell: Cell, number: int) -> Path:
        """Where a run is kept while it lasts, in a folder that is there. It has the study's own path, wherever the process may be."""
        path = self.front_path(cell, number).with_suffix(".checkpoint").absolute()
        path.parent.mkdir(exist_ok=True)
        return path

    def keep(self, cell: Cell, number: int, outcome: Outcome) -> None:
        """Write what came of a run; its front last, which is what makes it finished: then it has no more need of a checkpoint. Raises
        OSError if that cannot be written."""
        front, record, checkpoint = self.front_path(cell, number), self.record_path(cell, number), self.checkpoint_path(cell, number)
        about = {"status": outcome.status, "message": outcome.message, "seed": cell.seed(self.definition["seed"], number)}
        about |= {"wall_time": outcome.wall_time, "traceback": outcome.traceback, "history": outcome.history, "flown": outcome.flown}
        about |= {"crc32": crc32(outcome.front)} if outcome.status == FINISHED else {}
        write_whole(record, json.dumps(about).encode())
        if outcome.status == FINISHED:
            if front.exists():
                # Nobody could read it, but it is not ours to throw away.
                front.replace(front.with_name(f"{front.name}.unreadable"))
            write_whole(front, outcome.front)
            for path in (checkpoint, samples_path(checkpoint)):
                path.unlink(missing_ok=True)


def _check(path: Path, record: Mapping[str, Any]) -> None:
    """Raise ValueError or OSError unless a front can be read: at once, where its content is what was written; else by reading it."""
    if crc32(path.read_bytes()) != record.get("crc32"):
        Front.load(path)


def _record(path: Path) -> dict[str, Any]:
    """What is said of a run; nothing where there is no such file, or it is damaged."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError):
        return {}
    return data if isinstance(data, dict) else {}


LINE = 200
"""Longest reason, in characters."""


WORTH = 20
"""Most failures told one by one."""


def summary_text(summary: Summary) -> str:
    """A table of the cells, and why runs failed."""
    rows, reasons = [], []
    for cell, runs in summary.cells.items():
        finished = [run for run in runs if run.finished]
        times = [run.wall_time for run in finished if run.wall_time]
        missing = sum(run.status == "missing" for run in runs)
        failed = len(runs) - len(finished) - missing
        rows.append([*cell.labels, str(len(finished)), str(failed), str(missing), duration(float(np.median(times))) if times else "-"])
        for run in runs:
            if not run.finished and run.status != "missing":
                reasons.append(f"run {run.number} of {cell.name}: {reason(run.status, run.message)}"[:LINE])
    more = [f"and {len(reasons) - WORTH} more"] if len(reasons) > WORTH else []
    table = text_table(
        [["problem", "transcription", "solver", "finished", "failed", "missing", "median time"]], rows, [True] * 3 + [False] * 4
    )
    headline = f"{summary.name}: {summary.finished} of {len(summary.runs)} runs finished"
    failures = ["", *reasons[:WORTH], *more] if reasons else []
    return "\n".join([headline, "", table, *failures])


def reason(status: str, message: str) -> str:
    """crashed: ValueError: no such thing."""
    return f"{status}: {message}" if message else status
