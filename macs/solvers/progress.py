"""The state of a running search, and its display on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, TextIO

import numpy as np

from ..front import Front
from ..io.console import Display, minutes
from ..io.text import counted


@dataclass(frozen=True, repr=False)
class Progress:
    """State of a running search.

    Attributes
    ----------
    evaluations : int
        So far.
    budget : int or None
        Largest number of evaluations; None for a search that goes on until it is done.
    elapsed : float
        Seconds.
    archive : int
        Number of points in the archive.
    ideal : mapping
        Best value of each objective in the archive, by name, in the user's units and senses; empty as long as no point is feasible.
    failures : mapping
        Number of evaluations and gradient solves that did not converge, by status.
    F : array (archive, m)
        Objectives of the points in the archive, all minimised; available at no cost, unlike `front`.
    inner_iterations, gradient_solves, work, charge : int
        See `Counts`.

    Examples
    --------
    >>> from macs import MACS
    >>> from problems import load
    >>> seen = []
    >>> front = MACS().solve(load("four_bar_truss"), evaluations=100, seed=1, callback=lambda progress: seen.append(progress.evaluations))
    >>> seen[-1] <= 100
    True
    """

    evaluations: int
    budget: int | None
    elapsed: float
    archive: int
    ideal: Mapping[str, float]
    failures: Mapping[str, int]
    make_front: Callable[[], Front]
    F: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    inner_iterations: int = 0
    gradient_solves: int = 0
    work: int = 0
    charge: int = 0

    @property
    def front(self) -> Front:
        """The front found so far; it is made at each access, which takes some time."""
        return self.make_front()

    def __repr__(self) -> str:
        return f"<Progress: {', '.join([count(self), clock(self), *found(self)])}>"


class SearchDisplay(Display):
    """Display of the `Progress` of a search; see `Display`."""

    def __init__(self, shown: bool | None = True, stream: TextIO | None = None) -> None:
        super().__init__(shown, stream)
        self._last: Progress | None = None
        self._shown_last: Progress | None = None

    @property
    def elapsed(self) -> float:
        """Seconds of the search, including earlier processes."""
        return self._last.elapsed if self._last else 0.0

    def update(self, progress: Progress) -> None:
        """Show this state of the search from now on; fast enough for every batch."""
        self._last = progress
        self.refresh()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        super().__exit__(kind, error, trace)
        if self._due and self._live is None and self._last is not self._shown_last:
            self._write(self.line())

    def line(self) -> str:
        """Counts, time, archive and failures in one line."""
        return ", ".join([count(self._last), clock(self._last), *found(self._last)]) if self._last else ""

    def render(self) -> Any:
        """The state of the search with a bar."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        if self._last is None:
            return Text("beginning")
        line = Table.grid(padding=(0, 2), expand=False)
        bar = ProgressBar(total=self._last.budget, completed=self._last.evaluations, width=30)
        line.add_row(bar, Text(count(self._last)), Text(clock(self._last), style="dim"))
        return Group(line, Text(", ".join(found(self._last)), overflow="ellipsis", no_wrap=True))

    def _write(self, line: str) -> None:
        self._shown_last = self._last
        super()._write(line)


def count(progress: Progress) -> str:
    """Evaluations and budget, such as 1 200 / 10 000 evaluations; 1 200 evaluations without a budget."""
    if progress.budget is None:
        return counted(progress.evaluations, "evaluation")
    return f"{progress.evaluations:,} / {counted(progress.budget, 'evaluation')}".replace(",", " ")


def clock(progress: Progress) -> str:
    """Elapsed time, evaluations a second and estimated remaining time, such as 0:12, 410 a second, 1:03 left."""
    if progress.budget is None or not 0 < progress.evaluations < progress.budget or not progress.elapsed:
        return minutes(progress.elapsed)
    each = progress.elapsed / progress.evaluations
    return f"{minutes(progress.elapsed)}, {1.0 / each:.3g} a second, {minutes(each * (progress.budget - progress.evaluations))} left"


def found(progress: Progress) -> list[str]:
    """Gradient solves, size of the archive, its best value of each objective, and the number of failures by status."""
    words = [f"archive {progress.archive}", *(f"{name} {value:.6g}" for name, value in progress.ideal.items())]
    if not progress.archive:
        words = ["no feasible point yet"]
    # They go on after the last evaluation.
    solves = [counted(progress.gradient_solves, "gradient solve")] if progress.gradient_solves else []
    failures = [f"{number:,} {status}".replace(",", " ") for status, number in progress.failures.items() if number]
    return [*solves, *words, *failures]
