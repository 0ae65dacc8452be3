"""Displays of long work, on stderr: live on a terminal, a plain line every ten seconds elsewhere.

By default, functions of the library show work that takes long, on a terminal or in a notebook; see `Display`.
"""

from __future__ import annotations

import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar, Token
from io import StringIO
from types import TracebackType
from typing import Any, Self, TextIO

from .interrupts import Interrupts, work_on_trajectories
from .workers import Workers, processes

LINE_EVERY = 10.0
"""Seconds between plain lines."""
SHOWN_AFTER = 2.0
"""Seconds after which work is shown by default."""


_INSIDE: ContextVar[bool] = ContextVar("inside a display", default=False)
"""Whether the work is a part of other work that is shown, and need not be."""


class Display(AbstractContextManager, ABC):
    """Display of the state of long work; a context manager."""

    transient = False
    """Whether the display is removed from a terminal at the end."""

    def __init__(self, shown: bool | None = True, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr or StringIO()
        self._visible = getattr(self._stream, "shown", str)  # the command line shows control characters of foreign texts
        self._shown = is_live(self._stream) if shown is None else shown
        self._delay = SHOWN_AFTER if shown is None else 0.0
        self._live: Any = None
        self._token: Token[bool] | None = None
        self._began, self._written = time.perf_counter(), -float("inf")

    @abstractmethod
    def line(self) -> str:
        """The state of the work in one line; "" if it is not known yet."""

    def render(self) -> Any:
        """The state of the work for a terminal, as an object that rich can print."""
        from rich.text import Text

        return Text(self._visible(self.line()))

    @property
    def elapsed(self) -> float:
        """Seconds since the work began."""
        return time.perf_counter() - self._began

    def refresh(self) -> None:
        """Begin a display that was delayed. Without a terminal, write a plain line, if the last one is `LINE_EVERY` seconds old."""
        if not self._due or self._live is not None:
            return
        if self._stream.isatty():
            self._begin()
        elif self.elapsed - self._written >= LINE_EVERY:
            self._write(self.line())

    @property
    def _due(self) -> bool:
        """Whether the work is to be shown by now."""
        return self._shown and time.perf_counter() - self._began >= self._delay

    def say(self, line: str) -> None:
        """Write a line now; on a terminal above the live display."""
        if self._live is not None:
            self._live.console.print(self._visible(line), markup=False, highlight=False)
        elif self._shown:
            self._write(line)

    def __enter__(self) -> Self:
        self._shown = self._shown and not (self._delay and _INSIDE.get())
        if self._shown:
            self._token = _INSIDE.set(True)
            if not self._delay and self._stream.isatty():
                self._begin()
        return self

    def _begin(self) -> None:
        from rich.console import Console
        from rich.live import Live

        console = Console(file=getattr(self._stream, "beneath", self._stream))
        self._live = Live(console=console, refresh_per_second=8, transient=self.transient, get_renderable=self.render)
        self._live.start()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._token is not None:
            _INSIDE.reset(self._token)
            self._token = None
        if self._live is not None:
            self._live.stop()

    def _write(self, line: str) -> None:
        self._written = self.elapsed
        if line:
            print(line, file=self._stream, flush=True)


class StatusLine(Display):
    """Display of the present step of the work in one line; see `Display`."""

    transient = True

    def __init__(self, shown: bool | None = True, stream: TextIO | None = None) -> None:
        super().__init__(shown, stream)
        self._words = ""

    def __call__(self, words: str) -> None:
        """Show these words from now on."""
        self._words = words
        self.refresh()

    def line(self) -> str:
        """The present words."""
        return self._words

    def render(self) -> Any:
        """The present words with a spinner."""
        from rich.spinner import Spinner

        return Spinner("dots", self._visible(self.line()))


class Steps(StatusLine):
    """Display of a known number of steps. Ctrl-C raises `Stopped` at the next step; a second Ctrl-C interrupts at once."""

    def __init__(self, title: str, total: int, stream: TextIO | None = None, at_once: bool = False) -> None:
        super().__init__(True, stream)
        self._at_once, self._interrupts = at_once, Interrupts()
        self._title, self._total, self._done = title, total, 0

    def __enter__(self) -> Self:
        if not self._at_once:
            self._interrupts.__enter__()
        return super().__enter__()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        super().__exit__(kind, error, trace)
        self._interrupts.__exit__(kind, error, trace)

    def begin(self, what: str) -> None:
        """Begin the next step, described by `what`. Raises `Stopped` if Ctrl-C was pressed."""
        self.check()
        self._done += 1
        self(f"{self._title}: {what}, step {self._done} of {self._total}")

    def line(self) -> str:
        """The present step, its number and the elapsed time."""
        return f"{super().line()}, {minutes(self.elapsed)}"

    def check(self) -> None:
        """Raise `Stopped` if Ctrl-C was pressed."""
        self._interrupts.check()


@contextmanager
def working(time_limit: float | None, progress: bool | None, workers: Workers | None = None) -> Iterator[tuple[StatusLine, Interrupts]]:
    """A context of long work: its status line, its interrupts, and its processes. Ctrl-C and the time limit ask it to end, see
    `transcription.stopping`."""
    with StatusLine(progress) as status, Interrupts(time_limit) as interrupts, work_on_trajectories(), processes(workers):
        yield status, interrupts


def is_live(stream: TextIO) -> bool:
    """Whether a stream is a terminal, or the output of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return stream.isatty() or hasattr(shell, "kernel")


def minutes(seconds: float) -> str:
    """A duration such as 0:07, 12:30 or 2:00:05."""
    hours, rest = divmod(round(seconds), 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"
