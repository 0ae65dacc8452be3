"""The state of a running search, and its display on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from ..io.console import EVERY, minutes
from ..io.text import counted

if TYPE_CHECKING:
    from ..front import Front


@dataclass(frozen=True)
class Progress:
    """How a search stands.

    Attributes
    ----------
    evaluations, budget : int
    elapsed : float
        Seconds.
    archive : int
        Points in the archive.
    ideal : mapping
        The best value of each objective in the archive, by name, in the user's senses; empty as long as nothing feasible was found.
    failures : mapping
        Evaluations that did not converge, by status.
    F : array (archive, m)
        Objectives of the points in the archive, all minimised; costs nothing, unlike `front`.
    inner_iterations, gradient_solves : int
    """

    evaluations: int
    budget: int
    elapsed: float
    archive: int
    ideal: Mapping[str, float]
    failures: Mapping[str, int]
    make_front: Callable[[], Front] = field(repr=False)
    F: np.ndarray = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    inner_iterations: int = 0
    gradient_solves: int = 0

    @property
    def front(self) -> Front:
        """The front found so far; made when it is asked for."""
        return self.make_front()


class Display(AbstractContextManager["Display"]):
    """Shows the `Progress` it is updated with, until it is left.

    Parameters
    ----------
    title : str
        What is being searched.
    stream : text stream, optional
        stderr by default.
    """

    def __init__(self, title: str = "", stream: TextIO | None = None) -> None:
        self._title = title
        self._stream = stream or sys.stderr
        self._live: Any = None
        self._last: Progress | None = None
        self._written: Progress | None = None

    def __enter__(self) -> Display:
        if self._stream.isatty():
            from rich.console import Console
            from rich.live import Live

            self._live = Live(console=Console(file=self._stream), refresh_per_second=8, get_renderable=self._render)
            self._live.start()
        return self

    def __call__(self, progress: Progress) -> None:
        """As `update`."""
        self.update(progress)

    def update(self, progress: Progress) -> None:
        """Take note of how the search stands; cheap enough for every batch."""
        self._last = progress
        if self._live is None and (self._written is None or progress.elapsed - self._written.elapsed >= EVERY):
            self._write()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._live is not None:
            self._live.stop()
        elif self._last is not self._written:
            self._write()

    def _write(self) -> None:
        self._written = self._last
        if self._last is not None:
            words = [self._title, count(self._last), clock(self._last), *found(self._last)]
            print(", ".join(word for word in words if word), file=self._stream, flush=True)

    def _render(self) -> Any:
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        if self._last is None:
            return Text(f"{self._title}: beginning")
        line = Table.grid(padding=(0, 2), expand=False)
        bar = ProgressBar(total=self._last.budget, completed=self._last.evaluations, width=30)
        line.add_row(Text(self._title, style="bold"), bar, Text(count(self._last)), Text(clock(self._last), style="dim"))
        return Group(line, Text(", ".join(found(self._last)), overflow="ellipsis", no_wrap=True))


def count(progress: Progress) -> str:
    """Evaluations and budget: 1 200 / 10 000 evaluations."""
    return f"{progress.evaluations:,} / {counted(progress.budget, 'evaluation')}".replace(",", " ")


def clock(progress: Progress) -> str:
    """Elapsed and remaining time, the latter by the pace so far: 0:12, 1:03 left."""
    if not 0 < progress.evaluations < progress.budget:
        return minutes(progress.elapsed)
    left = progress.elapsed * (progress.budget - progress.evaluations) / progress.evaluations
    return f"{minutes(progress.elapsed)}, {minutes(left)} left"


def found(progress: Progress) -> list[str]:
    """The archive, its best value of each objective, and what did not converge."""
    words = [f"archive {progress.archive}", *(f"{name} {value:.6g}" for name, value in progress.ideal.items())]
    if not progress.archive:
        words = ["nothing feasible yet"]
    failures = [f"{number:,} {status}".replace(",", " ") for status, number in progress.failures.items() if number]
    return [*words, *failures]
