"""How a study proceeds, in a file that the process which runs it writes every second: for other processes that show it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from types import TracebackType

import msgspec

from macs.io.atomic import write_whole
from problems.compiled import Objective

from ..files import checked, read_record, to_record

FILE = ".progress"
"""Its name, in the study's folder."""
EVERY, STALE = 1.0, 20.0
"""Seconds between two writes, and seconds after which the process that wrote it is taken to be gone."""


class Going(msgspec.Struct):
    """A run that is being made: its cell's folder, its number, its evaluations and seconds so far."""

    folder: str
    number: int
    evaluations: int
    elapsed: float


class Goal(msgspec.Struct):
    """Name, unit and sense of an objective."""

    name: str
    unit: str
    sense: str


class Progress(msgspec.Struct):
    """How a study proceeds."""

    began: float  # when this call of the study began, in seconds since 1970
    elapsed: float  # seconds since then
    left: float | None  # seconds that the rest takes, if it goes on like this; None if that is not known yet
    going: list[Going]  # the runs that are being made; runs on the workers of an executor are not known
    goals: dict[str, list[Goal]] = {}  # objectives by label of the problem: no front has to be read to know them


class ProgressFile(AbstractContextManager["ProgressFile"]):
    """The file of a study that is running; on leaving the context it is deleted.

    It is only there to be looked at, so a write that fails is no error.
    """

    def __init__(
        self,
        folder: Path,
        goals: Mapping[str, Sequence[Objective]],
        going: Callable[[], tuple[list[Going], float | None]],
    ) -> None:
        self._path, self._going = folder / FILE, going
        self._goals = {label: [Goal(goal.name, goal.unit, goal.sense) for goal in ones] for label, ones in goals.items()}
        self._began, self._clock, self._written = time.time(), time.monotonic(), -float("inf")

    def refresh(self) -> None:
        """Write how it stands, if the last time is long enough ago."""
        now = time.monotonic()
        if now - self._written < EVERY:
            return
        self._written = now
        going, left = self._going()
        told = Progress(self._began, now - self._clock, left, going, self._goals)
        with suppress(OSError):
            write_whole(self._path, to_record(msgspec.to_builtins(told)))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with suppress(OSError):
            self._path.unlink(missing_ok=True)


def read_progress(folder: Path) -> Progress | None:
    """How the study in a folder proceeds; None if no process makes it now. Of a process that was killed the file stays, and gets old."""
    path = folder / FILE
    try:
        if abs(time.time() - path.stat().st_mtime) > STALE:
            return None
        return checked(read_record(path), Progress)
    except (OSError, ValueError):  # it is for the eye alone: without it, no run is known to be going on
        return None
