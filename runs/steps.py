"""How far work of a few long steps is, for people: a bar on a terminal, a line for each step elsewhere. It writes to stderr."""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager
from types import TracebackType
from typing import Any, TextIO

from macs.io.console import EVERY, minutes
from macs.io.interrupts import Monitor, Stopped


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
