"""Exit codes of commands, the error for a wrong call, and signals: Ctrl-C before a command begins and after it has ended, SIGTERM as
Ctrl-C."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

DONE, FAILED, WRONG, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: done; failed (nothing feasible, a check not passed, runs missing); the call was wrong; Ctrl-C."""


class WrongCall(Exception):  # noqa: N818 - a message to the user in one line
    """The user's call is wrong. The text is the reason, in the user's words."""


@contextmanager
def wrong_call_on_value_error() -> Iterator[None]:
    """A context in which a ValueError becomes a `WrongCall`."""
    try:
        yield
    except ValueError as error:
        raise WrongCall(str(error)) from error


def complain(message: str, program: str) -> int:
    """One line on stderr."""
    print(f"{program}: {' '.join(message.split())}", file=sys.stderr)
    return WRONG


@contextmanager
def ended_at_once(program: str) -> Iterator[None]:
    """A context in which Ctrl-C ends the process with one line, for imports: an exception in the middle of one may come out as another."""

    def end(*_: Any) -> None:
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, f"{program}: interrupted\n".encode())
        os._exit(INTERRUPTED)

    previous = signal.getsignal(signal.SIGINT)
    # Only where Ctrl-C means what it usually does; a process in the background may ignore it.
    if previous is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


@contextmanager
def ended_as_by_ctrl_c() -> Iterator[None]:
    """A context in which SIGTERM does what Ctrl-C does: `kill`, `timeout` and the managers of clusters send it before they kill."""

    installed_in = os.getpid()

    def as_ctrl_c(number: int, frame: FrameType | None) -> None:
        handler = signal.getsignal(signal.SIGINT)
        if callable(handler) and os.getpid() == installed_in:
            handler(signal.SIGINT, frame)
        else:  # SIGTERM is to end a process in the background, which may ignore Ctrl-C, and one that was forked, too
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            signal.raise_signal(signal.SIGTERM)

    # Only where it means what it usually does, and where handlers can be set.
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, as_ctrl_c)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def deaf() -> None:
    """Ignore Ctrl-C from now on: the answer is given, and the process about to end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
