"""How a search stands, for people: a live display on a terminal, a plain line now and then elsewhere. It writes to stderr."""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager
from types import TracebackType
from typing import Any, TextIO

from .interrupts import Monitor, Stopped

EVERY = 10.0
"""Seconds between plain lines."""


class Told(AbstractContextManager["Told"]):
    """Says in one line what is being done, as long as it is entered; nothing unless it is `wanted`. Where there is no terminal, not more
    often than every `EVERY` seconds.

    Parameters
    ----------
    wanted : bool
    stream : text stream, optional
        stderr by default.
    """

    def __init__(self, wanted: bool, stream: TextIO | None = None) -> None:
        self._wanted, self._stream = wanted, stream or sys.stderr
        self._live: Any = None
        self._written = -float("inf")

    def __call__(self, words: str) -> None:
        """What is being done now."""
        if self._live is not None:
            self._live.update(words)
        elif self._wanted and time.perf_counter() - self._written >= EVERY:
            self._written = time.perf_counter()
            print(words, file=self._stream, flush=True)

    def __enter__(self) -> Told:
        if self._wanted and self._stream.isatty():
            from rich.console import Console
            from rich.status import Status

            self._live = Status("", console=Console(file=self._stream))
            self._live.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._live is not None:
            self._live.stop()


def minutes(seconds: float) -> str:
    """0:07, 12:30 or 2:00:05."""
    hours, rest = divmod(round(seconds), 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"


class Steps(AbstractContextManager["Steps"]):
    """Steps of a known number; Ctrl-C ends the work between two of them by raising `Stopped`, a second one at once.

    Parameters
    ----------
    title : str
    total : int
    stream : text stream, optional
        stderr by default.
    """

    def __init__(self, title: str, total: int, stream: TextIO | None = None) -> None:
        self._title, self._total, self._done = title, total, 0
        self._stream = stream or sys.stderr
        self._began, self._written = time.perf_counter(), -float("inf")
        self._monitor = Monitor(None, None, None)
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Steps:
        self._monitor.__enter__()
        if self._stream.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

            columns = TextColumn("{task.description}"), BarColumn(30), MofNCompleteColumn(), TimeElapsedColumn()
            self._bar = Progress(*columns, console=Console(file=self._stream), transient=True)
            self._bar.start()
            self._task = self._bar.add_task(self._title, total=self._total)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.stop()
        self._monitor.__exit__(kind, error, trace)

    def begin(self, what: str) -> None:
        """The next step: what it does."""
        self.check()
        self._done += 1
        if self._bar is not None:
            self._bar.update(self._task, description=f"{self._title}: {what}", completed=self._done - 1)
        elif (elapsed := time.perf_counter() - self._began) - self._written >= EVERY:
            self._written = elapsed
            print(f"{self._title}: {what}, step {self._done} of {self._total}, {minutes(elapsed)}", file=self._stream, flush=True)

    def asked(self) -> bool:
        """Whether somebody pressed Ctrl-C, for `transcription.stopping`."""
        return bool(self._monitor.reason)

    def check(self) -> None:
        """Raise `Stopped` if somebody pressed Ctrl-C."""
        if self._monitor.reason:
            raise Stopped(self._monitor.reason)
