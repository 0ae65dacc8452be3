"""The folder of a study, read and written.

study.json      the definition of the study, and the number of runs of each cell
CELL/RUN.nc     the front of a finished run, 0001.nc being the first: a run is finished once it has one, which is never changed again
                but by a call that makes runs by other code again
CELL/RUN.json   the record of a run: the code that made it, of a finished one its history, of any other its status and traceback
CELL/RUN.CODE.checkpoint, CELL/RUN.CODE.samples   the state of a run that has begun and not ended, written by its own process
.lock           the lock of the process that runs the study
.progress       how that process proceeds, written every second and deleted at its end, see `running`

Every file is written whole, all but checkpoints and samples by the process that runs the study. Those in JSON are records with a checksum.
"""

from __future__ import annotations

import json
import os
import socket
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NotRequired, Self, TypedDict
from zlib import crc32

import msgspec
import numpy as np
from filelock import FileLock, Timeout

from macs.front import Front
from macs.fronts.files import LARGEST_FRONT
from macs.io.atomic import read_whole, write_whole
from macs.io.text import duration, html_block, html_table, text_table

from ..execution.task import FINISHED, History, RunOutcome, SimulationRecord
from ..files import Count, Natural, Positive, checked, errors_begin_with, load_front, read_record, to_record
from .cells import Cell
from .code import Code

MISSING, UNREADABLE = "missing", "unreadable"


FORMAT, STUDY_VERSION = "macs study", 2
"""Of study.json."""


class Definition(msgspec.Struct):
    """The part of a study's definition that its folder needs."""

    name: str
    seed: Natural
    runs: Count
    cells: list[Cell]
    decides: list[str]
    verify: Positive | None = None
    note: str = ""
    reference: str | dict[str, str] | None = None


class Method(TypedDict):
    """A solver or a transcription by its name, with its settings."""

    name: NotRequired[str]
    method: NotRequired[str]
    settings: dict[str, Any]


class Details(TypedDict):
    """What the details of a cell have, at least."""

    problem: dict[str, Any]
    transcription: Method | None
    solver: Method
    terms: NotRequired[dict[str, Any]]


class RunRecord(msgspec.Struct):
    """The record of a run, see `RunOutcome`, and its `code`, see `StoredRun`; `front` is the checksum of its front's file. By default that
    of a run without a record."""

    status: Literal["finished", "crashed", "timeout", "out of memory", "killed", "missing"] = "missing"
    message: str = ""
    traceback: str = ""
    wall_time: float = 0.0
    history: History = {}
    simulated: SimulationRecord = {}
    front: int | None = None
    code: dict[str, str] = {}


@dataclass(frozen=True)
class StoredRun:
    """One run of a cell, as the folder has it."""

    cell: Cell
    number: int  # 1, 2,
    seed: int
    # "finished", "crashed", "timeout", "out of memory", "killed", "missing", or "unreadable": its front or its record is damaged.
    status: str
    message: str  # message, traceback: Why it is not finished; of a finished one with an empty front, why that is empty
    traceback: str = field(repr=False)
    wall_time: float  # seconds, of its process; 0 where nothing is known
    # Of a finished run: "evaluations", "inner_iterations", "gradient_solves", "elapsed" and "F" (a list of objectives, all minimised) at
    # about thirty counts, the last being its front's. Empty if its file is gone.
    history: Mapping[str, Any] = field(repr=False)
    simulated: Mapping[str, Any] = field(repr=False)  # of a finished run whose points were simulated: see `RunOutcome.simulated`
    path: Path  # of its front, whether it exists or not
    code: Code = field(default_factory=dict, repr=False)  # that made it, see `code`; empty if that is not known
    trust: bool = False  # whether its problem may be loaded from an address that is not in the catalogue

    @property
    def finished(self) -> bool:
        """Whether it has a front."""
        return self.status == FINISHED

    @property
    def state(self) -> str:
        """Whether it is "finished", "missing" or "failed"."""
        return self.status if self.status in (FINISHED, MISSING) else "failed"

    @cached_property
    def front(self) -> Front:
        """Its front, read at first use. Raises ValueError or FileNotFoundError if it cannot be read."""
        return load_front(self.path, self.trust)


HEADS = ["problem", "transcription", "solver", "finished", "failed", "missing", "median time"]
LEFT = [True] * 3 + [False] * 4
"""Of the table of a summary: titles of columns, and which are aligned left."""


@dataclass(frozen=True)
class StudySummary:
    """The state of a study."""

    name: str
    path: Path
    runs: tuple[StoredRun, ...] = field(repr=False)  # all that there are to be, cell by cell

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
        return len(self.runs) - self.finished - self.missing

    @property
    def missing(self) -> int:
        """Runs that have not been made."""
        return self.count(MISSING)

    @property
    def cells(self) -> dict[Cell, tuple[StoredRun, ...]]:
        """Runs by cell."""
        return {cell: tuple(runs) for cell, runs in groupby(self.runs, key=lambda run: run.cell)}

    def __str__(self) -> str:
        """A table of the cells, and why runs failed."""
        rows, reasons = self._rows_and_reasons()
        lines = [f"{self.name}: {self.finished} of {len(self.runs)} runs finished", "", text_table([HEADS], rows, LEFT)]
        return "\n".join([*lines, *([""] if reasons else []), *reasons])

    def _repr_html_(self) -> str:
        """For notebooks: the same."""
        rows, reasons = self._rows_and_reasons()
        title = f"{self.name}: {self.finished} of {len(self.runs)} runs finished"
        return html_block(title, html_table([HEADS], rows, LEFT), reasons)

    def _rows_and_reasons(self) -> tuple[list[list[str]], list[str]]:
        """A row for each cell, and why runs failed, of which not too many are named."""
        rows, reasons = [], []
        for cell, runs in self.cells.items():
            counts, median = Counter(run.state for run in runs), median_time(runs)
            kinds = [str(counts[kind]) for kind in ("finished", "failed", "missing")]
            rows.append([*cell.labels, *kinds, "-" if median is None else duration(median)])
            reasons += [f"run {run.number} of {cell.name}: {reason(run)}"[:200] for run in runs if run.state == "failed"]
        more = [f"and {len(reasons) - 20} more"] if len(reasons) > 20 else []
        return rows, [*reasons[:20], *more]


class Store:
    """A study's folder."""

    def __init__(self, path: Path, definition: Mapping[str, Any], trust: bool = False) -> None:
        self.path = path
        self.definition = dict(definition)
        self.cells = tuple(checked(definition, Definition).cells)
        for cell in self.cells:
            checked(cell.details, Details)
        self.trust = trust

    @classmethod
    def open(cls, out: str | PathLike[str], trust: bool = False) -> Self:
        """The folder of a study. Raises ValueError if there is none, or it cannot be read."""
        path = Path(out)
        record = path / "study.json"
        if not path.is_dir():
            raise ValueError(f"there is no folder '{out}'" if not path.exists() else f"'{out}' is not a folder")
        try:
            data = read_record(record)
            if data["format"] != FORMAT:
                raise ValueError("it is not the record of a study")
            if data["version"] != STUDY_VERSION:
                raise ValueError(f"another version of MACS wrote it (format {data['version']}, not {STUDY_VERSION}): use that version")
            return cls(path, data["study"], trust)
        except FileNotFoundError:
            raise ValueError(f"'{out}' contains no study: there is no study.json in it") from None
        except OSError as error:
            raise ValueError(f"'{out}' cannot be read: {error.strerror or error}") from error
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"'{record}' cannot be read: {error}") from error

    @classmethod
    @contextmanager
    def claim(cls, out: str | PathLike[str], definition: Mapping[str, Any]) -> Iterator[Store]:
        """The folder of this study, made if it does not exist, and locked within the context.

        The study may have more cells than when it was last there. Its record has the largest number of runs ever asked for.
        """
        path = Path(out)
        cls._suits(path, definition)
        path.mkdir(parents=True, exist_ok=True)
        with locked(path / ".lock"):
            known = cls._suits(path, definition)
            latest = {**definition, "runs": max(definition["runs"], known.definition["runs"] if known else 0)}
            if known is None or latest != known.definition:
                record = {"format": FORMAT, "version": STUDY_VERSION, "study": latest}
                write_whole(path / "study.json", to_record(record, indent=1))
            yield cls(path, latest)

    @classmethod
    def _suits(cls, path: Path, definition: Mapping[str, Any]) -> Store | None:
        """The study in a folder; None if the folder is new. Raises ValueError if it contains something else."""
        if (path / "study.json").exists():
            store = cls.open(path)
            store.check(definition, grown=True)
            return store
        if os.path.lexists(path) and not path.is_dir():
            raise ValueError(f"'{path}' is not a folder")
        others = sorted(one.name for one in path.iterdir() if not one.name.startswith(".")) if path.exists() else []
        if others:
            raise ValueError(f"'{path}' contains no study but other things, '{others[0]}' for one; give a folder of its own")
        return None

    def check(self, definition: Mapping[str, Any], grown: bool = False) -> None:
        """Raise ValueError with the first difference unless this is the same study; it may have more cells now if it is `grown`."""
        here, there = ({key: one.get(key) for key in definition["decides"]} for one in (definition, self.definition))
        ours, theirs = ({cell.name: cell.to_dict() for cell in cells} for cells in (checked(definition, Definition).cells, self.cells))
        different = _difference(there, here)
        for name in (*theirs, *(() if grown else ours)):
            if not different and (name in ours) != (name in theirs):
                different = f"cell '{name}' is {'there but not here' if name in theirs else 'here but not there'}"
            different = different or _difference(theirs[name], ours[name], f"{name}: ")
        if different:
            raise ValueError(f"'{self.path}' contains another study: {different}; give another folder")

    # Its runs

    def runs(self, count: int | None = None) -> Iterator[StoredRun]:
        """All runs there are to be, cell by cell: finished, failed, unreadable and missing ones. By default as many as were asked for."""
        for cell in self.cells:
            for number in range(1, cell.runs(self.definition["runs"] if count is None else count) + 1):
                yield self.run(cell, number)

    def front_path(self, cell: Cell, number: int) -> Path:
        """The file of a run's front."""
        return self.path / cell.folder / f"{number:04d}.nc"

    def run(self, cell: Cell, number: int) -> StoredRun:
        """One run."""
        path, record, status, message = self.front_path(cell, number), RunRecord(), UNREADABLE, ""
        try:
            record = _record(path.with_suffix(".json"))
            if path.exists():
                _check_front(path, record)
        except (ValueError, OSError) as error:
            message = str(error)
        else:
            status = FINISHED if path.exists() else MISSING if record.status == FINISHED else record.status
            message = record.message if status != MISSING else ""
        return StoredRun(
            cell=cell,
            number=number,
            seed=cell.seed(self.definition["seed"], number),
            status=status,
            message=message,
            traceback=record.traceback,
            wall_time=record.wall_time,
            history=record.history,
            simulated=record.simulated,
            path=path,
            code=record.code,
            trust=self.trust,
        )

    def summary(self, count: int | None = None) -> StudySummary:
        """The state of the study, with the runs that were asked for or `count` of each cell."""
        return StudySummary(self.definition["name"], self.path, tuple(self.runs(count)))

    def checkpoint_path(self, run: StoredRun, code: str) -> Path:
        """Where a run by the code with this digest is kept while it lasts, so that no other code continues it; in a folder that is made.
        The path is absolute, as its process may be in another folder."""
        path = run.path.with_suffix(f".{code}.checkpoint").absolute()
        path.parent.mkdir(exist_ok=True)
        return path

    def keep(self, run: StoredRun, outcome: RunOutcome, code: Code) -> None:
        """Write the outcome of a run, and the code that made it. Its front comes last and makes it finished; then its checkpoints are
        deleted. Raises OSError if a file cannot be written."""
        front = run.path
        front.parent.mkdir(exist_ok=True)
        checksum = crc32(outcome.front) if outcome.status == FINISHED else None
        write_whole(front.with_suffix(".json"), to_record({**vars(outcome), "front": checksum, "code": dict(code)}))
        if outcome.status == FINISHED:
            if front.exists() and run.status == UNREADABLE:
                # It could not be read, but it is the user's to delete.
                front.replace(front.with_name(f"{front.name}.unreadable"))
            write_whole(front, outcome.front)
            for path in (*front.parent.glob(f"{front.stem}.*.checkpoint"), *front.parent.glob(f"{front.stem}.*.samples")):
                path.unlink(missing_ok=True)
        elif run.status != UNREADABLE:  # what is there is by other code
            front.unlink(missing_ok=True)


def _record(path: Path) -> RunRecord:
    """The record of a run. Raises ValueError or OSError if it cannot be read."""
    if not path.exists():
        return RunRecord()
    with errors_begin_with(f"its record '{path}' is damaged"):
        return checked(read_record(path), RunRecord)


def _check_front(path: Path, record: RunRecord) -> None:
    """Raise ValueError or OSError unless a front is the one of its record; without a record, unless it can be read. Its problem is not
    loaded."""
    if record.status == MISSING:
        Front.load(path)
    elif crc32(read_whole(path, LARGEST_FRONT)) != record.front:
        raise ValueError(f"'{path}' is damaged: its content is not what was written")


def _difference(one: Mapping[str, Any], other: Mapping[str, Any], place: str = "") -> str:
    """The first difference between two tables of plain data, in words; empty if there is none."""
    for key in (*one, *(key for key in other if key not in one)):
        name = f"{place}{key}"
        first, second = one.get(key), other.get(key)
        if isinstance(first, Mapping) and isinstance(second, Mapping):
            inner = _difference(first, second, f"{name}.")
            if inner:
                return inner
        elif first != second:
            return f"{name} is {json.dumps(first)} there and {json.dumps(second)} here"
    return ""


def reason(run: StoredRun | RunOutcome) -> str:
    """crashed: ValueError: no such thing."""
    return f"{run.status}: {run.message}" if run.message else run.status


def median_time(runs: Sequence[StoredRun]) -> float | None:
    """Median seconds of finished runs; None if it is not known."""
    times = [run.wall_time for run in runs if run.finished and run.wall_time]
    return float(np.median(times)) if times else None


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """A context in which no other process has the lock on a file, which is made if it does not exist."""
    lock, owner = FileLock(path), path.with_name(f"{path.name}.owner")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        by = ""
        with suppress(OSError):
            by = f", {read_whole(owner, 1000).decode(errors='replace')}"
        raise ValueError(f"'{path.parent}' is being written by another process{by}") from None
    try:
        # In a file of its own, which can be read while the lock is taken. It is for the message alone, so a full disk is no error.
        with suppress(OSError):
            write_whole(owner, f"{os.getpid()} on {socket.gethostname()}".encode())
        yield
    finally:
        lock.release()
