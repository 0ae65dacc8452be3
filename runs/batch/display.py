"""Display of a study's progress on stderr: a live table of the current runs on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from types import TracebackType
from typing import Any, TextIO

from macs.io.console import EVERY, minutes

from ..execution.task import FINISHED, Outcome
from .store import StoredRun, reason

SHOWN = 20
"""Most runs in the table."""


class StudyDisplay(AbstractContextManager["StudyDisplay"]):
    """The progress of a study, if it is shown: its current runs, and how many are left.

    Parameters
    ----------
    title : str
    runs, todo : sequences of StoredRun
        All there are to be, and those to be made now.
    shown : bool
    stream : text stream, optional
        stderr by default.
    """

    def __init__(self, title: str, runs: Sequence[StoredRun], todo: Sequence[StoredRun], shown: bool, stream: TextIO | None = None) -> None:
        self._title, self._total, self._shown, self._stream = title, len(runs), shown, stream or sys.stderr
        self._finished, self._failed = sum(run.finished for run in runs), len(runs) - len(todo) - sum(run.finished for run in runs)
        self._work = sum(run.cell.evaluations for run in todo)
        self._done = 0
        self._going: dict[tuple[str, int], tuple[StoredRun, int, float]] = {}
        self._began, self._written = time.perf_counter(), -float("inf")
        self._live: Any = None

    def __enter__(self) -> StudyDisplay:
        if self._shown and self._stream.isatty():
            from rich.console import Console
            from rich.live import Live

            self._live = Live(console=Console(file=self._stream), refresh_per_second=4, get_renderable=self._table)
            self._live.start()
        elif self._shown:
            self._write(f"{self._title}: {self._standing()}")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._live is not None:
            self._live.stop()

    def reporter(self, run: StoredRun) -> Callable[[int, float], None]:
        """The function that a run calls, from any thread, with evaluations and seconds."""
        key = run.cell.folder, run.number

        def report(evaluations: int, elapsed: float) -> None:
            self._going[key] = run, evaluations, elapsed

        return report

    def ended(self, run: StoredRun, outcome: Outcome) -> None:
        """A run is kept."""
        self._going.pop((run.cell.folder, run.number), None)
        self._done += run.cell.evaluations
        self._finished += outcome.status == FINISHED
        self._failed += outcome.status != FINISHED
        if outcome.status != FINISHED:
            self._say(f"{self._title}: run {run.number} of {run.cell.name} {reason(outcome.status, outcome.message)}")

    def refresh(self) -> None:
        """Time to write a line, perhaps."""
        if self._shown and self._live is None and time.perf_counter() - self._written >= EVERY:
            self._write(f"{self._title}: {self._standing()}")

    def _say(self, line: str) -> None:
        if self._live is not None:
            self._live.console.print(line, markup=False, highlight=False)
        elif self._shown:
            self._write(line)

    def _write(self, line: str) -> None:
        self._written = time.perf_counter()
        print(line, file=self._stream, flush=True)

    def _standing(self) -> str:
        """12 of 30 finished, 1 failed, 17 left; 0:41, 1:02 to go."""
        elapsed, going = time.perf_counter() - self._began, list(self._going.values())
        done = self._done + sum(evaluations for _, evaluations, _ in going)
        left = self._total - self._finished - self._failed
        ahead = f", {minutes(elapsed * (self._work - done) / done)} to go" if left and done else ""
        failed = f", {self._failed} failed" if self._failed else ""
        return f"{self._finished} of {self._total} finished{failed}, {left} left; {minutes(elapsed)}{ahead}"

    def _table(self) -> Any:
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        rows = Table.grid(padding=(0, 2), expand=False)
        going = sorted(self._going.values(), key=lambda one: (one[0].number, one[0].cell.name))
        for run, evaluations, elapsed in going[:SHOWN]:
            budget = run.cell.evaluations
            bar = ProgressBar(total=budget, completed=evaluations, width=20)
            count = Text(f"{evaluations:,} / {budget:,} evaluations".replace(",", " "))
            rows.add_row(Text(run.cell.name), Text(f"run {run.number}"), bar, count, Text(minutes(elapsed), style="dim"))
        return Group(Text(f"{self._title}: {self._standing()}", style="bold"), rows)
