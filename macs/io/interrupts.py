"""Watching a search: progress, callbacks, and the ways in which it may end before its budget does."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ..solvers.progress import Progress


class Stopped(Exception):  # noqa: N818 - an end, not an error
    """The search is to end with what it has. The text says why."""


class Monitor(AbstractContextManager["Monitor"]):
    """Ends a search on Ctrl-C, after a time limit or when a callback says so, always with what it has.

    While it is entered in the main thread, the first Ctrl-C only asks the search to stop, before its next batch or the next long solve
    within one; a second one interrupts at once, as usual.

    The time limit is for this process; `earlier` are the seconds that the search has taken in others.
    """

    def __init__(
        self,
        time_limit: float | None,
        callback: Callable[[Progress], Any] | None,
        display: Callable[[Progress], None] | None,
        earlier: float = 0.0,
    ):
        self._time_limit, self._callback, self._display = time_limit, callback, display
        self._interrupted = False
        self._previous: Any = None
        self._earlier = earlier
        self.started = time.perf_counter()

    @property
    def elapsed(self) -> float:
        """Seconds that the search has taken, earlier ones included."""
        return self._earlier + self._here

    @property
    def _here(self) -> float:
        return time.perf_counter() - self.started

    def __enter__(self) -> Monitor:
        if threading.current_thread() is threading.main_thread():
            self._previous = signal.signal(signal.SIGINT, self._interrupt)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._previous is not None:
            signal.signal(signal.SIGINT, self._previous)

    @property
    def reason(self) -> str:
        """Why to end: "interrupted", "time limit", or nothing as long as there is no reason."""
        if self._interrupted:
            return "interrupted"
        return "time limit" if self._time_limit is not None and self._here > self._time_limit else ""

    def before_batch(self, progress: Progress) -> None:
        """Pass progress on to the display; raise `Stopped` if the search is to end here."""
        self.show(progress)
        if self.reason:
            raise Stopped(self.reason)

    def show(self, progress: Progress) -> None:
        """Pass progress on to the display."""
        if self._display is not None:
            self._display(progress)

    def after_iteration(self, progress: Progress) -> None:
        """Pass progress on to display and callback; raise `Stopped` if the callback returns True."""
        self.show(progress)
        answer = None if self._callback is None else self._callback(progress)
        if isinstance(answer, bool | np.bool_) and answer:
            raise Stopped("callback")

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        if self._interrupted:
            raise KeyboardInterrupt
        self._interrupted = True
