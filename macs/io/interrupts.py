"""Ctrl-C and time limits: requests to end long work, which it checks between its steps."""

from __future__ import annotations

import signal
import threading
import time
from contextlib import AbstractContextManager
from types import FrameType, TracebackType
from typing import Any

NO_TIME = 1e-6
"""Time limit, in seconds, of further work after work that used up its own: this then ends before its first step."""


class Stopped(Exception):  # noqa: N818 - an end, not an error
    """Raised to end the work with its results so far. The text is the reason."""


class Interrupts(AbstractContextManager["Interrupts"]):
    """Clock and Ctrl-C handler of long work; a context manager.

    In the main thread, the first Ctrl-C only sets `reason`; a second one interrupts at once, as usual.

    Parameters
    ----------
    time_limit : float, optional
        Seconds in this process.
    earlier : float
        Seconds that the work has already taken in other processes.
    """

    def __init__(self, time_limit: float | None = None, earlier: float = 0.0) -> None:
        self._time_limit, self._earlier = time_limit, earlier
        self._interrupted = False
        self._previous: Any = None
        self._began = time.perf_counter()

    @property
    def elapsed(self) -> float:
        """Seconds that the work has taken, those in earlier processes included."""
        return self._earlier + self._here

    @property
    def _here(self) -> float:
        return time.perf_counter() - self._began

    @property
    def reason(self) -> str:
        """Reason to end: "interrupted" or "time limit"; "" if there is none."""
        if self._interrupted:
            return "interrupted"
        return "time limit" if self._time_limit is not None and self._here > self._time_limit else ""

    def check(self) -> None:
        """Raise `Stopped` if there is a reason to end."""
        if self.reason:
            raise Stopped(self.reason)

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is threading.main_thread():
            self._previous = signal.signal(signal.SIGINT, self._interrupt)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._previous is not None:
            signal.signal(signal.SIGINT, self._previous)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        if self._interrupted:
            raise KeyboardInterrupt
        self._interrupted = True
