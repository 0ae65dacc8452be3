"""Exit codes of commands, the error for a wrong call, streams, and signals: Ctrl-C before a command begins and after it has ended, SIGTERM
as Ctrl-C."""

from __future__ import annotations

import errno
import io
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from types import FrameType
from typing import Any

DONE, FAILED, WRONG, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: done; failed (nothing feasible, a check not passed, runs missing); the call was wrong; Ctrl-C."""

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of a disk, for which the call is not to blame."""
CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""Characters that a terminal obeys instead of showing them, but for ends of lines and tabulators."""


class WrongCall(Exception):  # noqa: N818 - a message to the user in one line
    """The user's call is wrong. The text is the reason, in the user's words."""


class Plain:
    """A stream that shows control characters, such as a foreign file may have in its texts, and obeys none. If it is `patient`, it need not
    be writable: what was to be said on it is lost."""

    def __init__(self, beneath: Any, patient: bool = False) -> None:
        self.beneath, self._patient = beneath, patient

    def __getattr__(self, name: str) -> Any:
        return getattr(self.beneath, name)

    @staticmethod
    def shown(text: str) -> str:
        """A text with its control characters as Python writes them."""
        return CONTROLS.sub(lambda found: ascii(found[0])[1:-1], text)

    def write(self, text: str) -> int:
        """As of any stream."""
        with suppress(OSError) if self._patient else nullcontext():
            self.beneath.write(self.shown(text))
        return len(text)

    def flush(self) -> None:
        """As of any stream."""
        with suppress(OSError) if self._patient else nullcontext():
            self.beneath.flush()


@contextmanager
def streams() -> Iterator[None]:
    """A context in which output and errors go to `Plain` streams; those that are closed lead nowhere."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open(mode))  # noqa: SIM115 - until the process ends
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A unit that the terminal cannot show is no reason to fail.
        sys.stdout.reconfigure(errors="replace")
    with redirect_stdout(Plain(sys.stdout)), redirect_stderr(Plain(sys.stderr, patient=True)):
        yield


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
        if os.getpid() != installed_in and hasattr(signal, "alarm"):  # forked: five seconds for what others wait for
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(5)
        elif callable(handler) and os.getpid() == installed_in:
            handler(signal.SIGINT, frame)
        else:  # SIGTERM is to end a process in the background, too, which may ignore Ctrl-C
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
