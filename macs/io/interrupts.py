"""Ctrl-C and time limits: requests to end long work, which it checks between its steps."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from contextvars import ContextVar
from functools import lru_cache
from types import FrameType, TracebackType

import numpy as np
from threadpoolctl import ThreadpoolController

from transcription.stopping import Asked, Stopped, asked_now, in_words, stopped_by

__all__ = ["PURPOSE", "Interrupts", "Stopped", "spending", "work_on_trajectories"]

_AT_ONCE: ContextVar[bool] = ContextVar("interrupted at once", default=False)
_SPENT: ContextVar[dict[str, float] | None] = ContextVar("spent", default=None)
PURPOSE: ContextVar[str] = ContextVar("purpose", default="other")  # what work is spent on, see `spending`

TIME_LIMIT = "time limit"
"""Reason to end work that has taken as long as it may."""


class Interrupts(AbstractContextManager["Interrupts"]):
    """Clock and Ctrl-C handler of long work; a context manager, within which the work is asked to end (`transcription.stopping`).

    In the main thread, the first Ctrl-C only sets `reason`; a second one interrupts at once, as usual. Work that is a part of other such
    work ends with it, and what interrupts the part interrupts the whole. Processes that the work has forked, such as a pool of the user's,
    hear no Ctrl-C: they finish what they were given.
    """

    def __init__(self, time_limit: float | None = None, earlier: float = 0.0) -> None:
        self._time_limit, self._earlier = time_limit, earlier
        self._interrupted, self._process = False, os.getpid()
        self._whole: Interrupts | None = None
        self._outer: Asked | None = None
        self._within = ExitStack()
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
        """Reason to end: "interrupted" or "time limit", or that of the work that this is a part of; "" if there is none."""
        return self._own_reason() or ("" if self._outer is None else in_words(self._outer))

    def check(self) -> None:
        """Raise `Stopped` if there is a reason to end."""
        if self.reason:
            raise Stopped(self.reason)

    def __enter__(self) -> Interrupts:
        self._outer = asked_now()
        self._within.enter_context(stopped_by(self._own_reason))
        if threading.current_thread() is threading.main_thread():
            previous = signal.getsignal(signal.SIGINT)
            owner = getattr(previous, "__self__", None)
            self._whole = owner if isinstance(owner, Interrupts) else None
            signal.signal(signal.SIGINT, self._interrupt)
            # A handler that was not set from Python cannot be set again from here.
            self._within.callback(signal.signal, signal.SIGINT, previous if previous is not None else signal.default_int_handler)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._within.close()

    def _own_reason(self) -> str:
        if self._interrupted:
            return "interrupted"
        return TIME_LIMIT if self._time_limit is not None and self._here > self._time_limit else ""

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        if os.getpid() != self._process:
            return
        if self._interrupted:
            raise KeyboardInterrupt
        self._interrupted = True
        if self._whole is not None and not self._whole._interrupted:
            self._whole._interrupt(number, frame)
        if _AT_ONCE.get():
            raise KeyboardInterrupt


@contextmanager
def at_once() -> Iterator[None]:
    """A context, of a function of the user's, in which the first Ctrl-C interrupts as usual: it may wait for processes that died of it."""
    token = _AT_ONCE.set(True)
    try:
        yield
    finally:
        _AT_ONCE.reset(token)


@contextmanager
def spending(what: str) -> Iterator[dict[str, float]]:
    """A context, or decorator, whose seconds and gradient solves (`Counts`), without those of others within, are spent on this; with the
    seconds of all that is within the outermost."""
    known = _SPENT.get()
    spent = {} if known is None else known
    token, before, began = _SPENT.set(spent), sum(spent.values()), time.perf_counter()
    inner = PURPOSE.set(what)
    try:
        yield spent
    finally:
        spent[what] = spent.get(what, 0.0) + time.perf_counter() - began - (sum(spent.values()) - before)
        _SPENT.reset(token)
        PURPOSE.reset(inner)


@contextmanager
def work_on_trajectories() -> Iterator[None]:
    """A context of work on trajectories. Some are far from feasible: statuses and violations say what is no number there, and warnings of
    numpy would add nothing. Matrices are small: more threads of BLAS than one would cost time, and make last digits those of a machine."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"), _libraries(len(sys.modules)).limit(limits=1, user_api="blas"):
        yield


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """The libraries that were loaded with so many modules; to look for them takes some milliseconds."""
    return ThreadpoolController()
