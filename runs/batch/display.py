"""Display of a study's progress on stderr: a live table of the current runs on a terminal, plain lines elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Self, TextIO

from macs.io.console import Display, minutes

from ..execution.task import FINISHED, Outcome
from .progress import Going
from .store import StoredRun, reason

SHOWN = 20
"""Most runs in the table."""


class StudyDisplay(Display):
    """The progress of a study, if it is shown: its current runs, and how many are left."""

    def __init__(self, title: str, runs: Sequence[StoredRun], todo: Sequence[StoredRun], shown: bool, stream: TextIO | None = None) -> None:
        super().__init__(shown, stream)
        self._title, self._total = title, len(runs)
        self._finished = sum(run.finished for run in runs)
        self._failed = len(runs) - len(todo) - self._finished
        self._work, self._done = sum(run.cell.planned for run in todo), 0
        self._going: dict[tuple[str, int], tuple[StoredRun, int, float]] = {}

    def __enter__(self) -> Self:
        super().__enter__()
        self.refresh()
        return self

    def reporter(self, run: StoredRun) -> Callable[[int, float], None]:
        """The function that a run calls, from any thread, with evaluations and seconds."""

        def report(evaluations: int, elapsed: float) -> None:
            self._going[run.cell.folder, run.number] = run, evaluations, elapsed

        return report

    def ended(self, run: StoredRun, outcome: Outcome) -> None:
        """A run is kept."""
        self._going.pop((run.cell.folder, run.number), None)
        self._done += run.cell.planned
        if outcome.status == FINISHED:
            self._finished += 1
        else:
            self._failed += 1
            self.say(f"{self._title}: run {run.number} of {run.cell.name} {reason(outcome.status, outcome.message)}")

    def going(self) -> tuple[list[Going], float | None]:
        """The runs that are being made, and the seconds that the rest takes if it goes on like this; None if that is not known yet."""
        now = [Going(run.cell.folder, run.number, evaluations, elapsed) for run, evaluations, elapsed in list(self._going.values())]
        done = self._done + sum(one.evaluations for one in now)
        return now, self.elapsed * (self._work - done) / done if 0 < done < self._work else None

    def line(self) -> str:
        """glides: 12 of 30 finished, 1 failed, 17 left; 0:41, 1:02 to go."""
        _, seconds = self.going()
        left = self._total - self._finished - self._failed
        ahead = f", {minutes(seconds)} to go" if left and seconds is not None else ""
        failed = f", {self._failed} failed" if self._failed else ""
        return f"{self._title}: {self._finished} of {self._total} finished{failed}, {left} left; {minutes(self.elapsed)}{ahead}"

    def render(self) -> Any:
        """The same above a table of the current runs."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        rows = Table.grid(padding=(0, 2), expand=False)
        going = sorted(self._going.values(), key=lambda one: (one[0].number, one[0].cell.name))
        for run, evaluations, elapsed in going[:SHOWN]:
            budget = run.cell.evaluations
            bar = ProgressBar(total=budget, completed=evaluations, width=20)
            of = "" if budget is None else f" / {budget:,}"
            count = Text(f"{evaluations:,}{of} evaluations".replace(",", " "))
            rows.add_row(Text(run.cell.name), Text(f"run {run.number}"), bar, count, Text(minutes(elapsed), style="dim"))
        return Group(Text(self.line(), style="bold"), rows)
