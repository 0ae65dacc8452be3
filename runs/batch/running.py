"""The runs that a study's folder lacks: submitted to workers, each stored as soon as it has ended; and how that proceeds, shown on a
terminal and told to other processes by a file."""

from __future__ import annotations

import logging
import queue
import time
import traceback
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

import msgspec

from macs.io.atomic import write_whole
from macs.io.console import Display, minutes
from problems.checks import check_count

from ..execution.processes import LocalWorkers, perform_apart
from ..execution.task import CRASHED, FINISHED, KILLED, MEMORY, TIMEOUT, RunOutcome, RunTask
from ..files import checked, read_record, to_record
from .cells import Cell
from .code import UNKNOWN, Code, changed, digest_of_code
from .store import MISSING, UNREADABLE, Store, StoredRun, reason

log = logging.getLogger(__name__)
AGAIN = (MISSING, UNREADABLE, KILLED, TIMEOUT, MEMORY)
"""Statuses of runs that are made again. A run that ended with an exception would most likely end so again."""
PROGRESS_FILE = ".progress"
"""Its name, in the study's folder."""
STALE = 20.0
"""Seconds without a write after which the process that wrote it is taken to be gone; it writes every second."""


class WorkersLost(RuntimeError):  # noqa: N818 - an event outside the program, not a mistake in it
    """The executor was shut down or lost all its workers. Finished runs are kept; the same call again makes the rest."""


class RunProgress(msgspec.Struct):
    """A run that is being made: its cell's folder, its number, its evaluations and seconds so far."""

    folder: str
    number: int
    evaluations: int
    elapsed: float


class ProgressRecord(msgspec.Struct):
    """How a study proceeds."""

    began: float  # when this call of the study began, in seconds since 1970
    elapsed: float  # seconds since then
    left: float | None  # seconds that the rest takes, if it goes on like this; None if that is not known yet
    going: list[RunProgress]  # the runs that are being made; runs on the workers of an executor are not known


def read_progress(folder: Path) -> ProgressRecord | None:
    """How the study in a folder proceeds; None if no process makes it now. Of a process that was killed the file stays, and gets old."""
    path = folder / PROGRESS_FILE
    try:
        if abs(time.time() - path.stat().st_mtime) > STALE:
            return None
        return checked(read_record(path), ProgressRecord)
    except (OSError, ValueError):  # it is for the eye alone: without it, no run is known to be going on
        return None


class StudyDisplay(Display):
    """Its current runs and how many are left: a live table on a terminal, plain lines elsewhere, if it is shown; and a file in the study's
    folder, rewritten every second and deleted at the end, for other processes that show it. A write of it that fails is no error."""

    def __init__(
        self,
        title: str,
        runs: Sequence[StoredRun],
        todo: Sequence[StoredRun],
        shown: bool,
        stream: TextIO | None = None,
        folder: Path | None = None,
    ) -> None:
        super().__init__(shown, stream)
        self._title, self._total = title, len(runs)
        self._finished = sum(run.finished for run in runs)
        self._failed = len(runs) - len(todo) - self._finished
        self._work, self._done = sum(run.cell.planned for run in todo), 0
        self._going: dict[tuple[str, int], tuple[StoredRun, int, float]] = {}
        self._path, self._start, self._saved = folder and folder / PROGRESS_FILE, time.time(), -float("inf")

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        super().__exit__(kind, error, trace)
        if self._path:
            with suppress(OSError):
                self._path.unlink(missing_ok=True)

    def refresh(self) -> None:
        """Show how it stands, and write it to the file, if the last time is long enough ago."""
        super().refresh()
        if self._path and self.elapsed - self._saved >= 1.0:
            self._saved = self.elapsed
            going, left = self.going()
            record = ProgressRecord(self._start, self.elapsed, left, going)
            with suppress(OSError):
                write_whole(self._path, to_record(msgspec.to_builtins(record)))

    def reporter(self, run: StoredRun) -> Callable[[int, float], None]:
        """The function that a run calls, from any thread, with evaluations and seconds."""

        def report(evaluations: int, elapsed: float) -> None:
            self._going[run.cell.folder, run.number] = run, evaluations, elapsed

        return report

    def ended(self, run: StoredRun, outcome: RunOutcome) -> None:
        """A run is stored."""
        self._going.pop((run.cell.folder, run.number), None)
        self._done += run.cell.planned
        if outcome.status == FINISHED:
            self._finished += 1
        else:
            self._failed += 1
            self.say(f"{self._title}: run {run.number} of {run.cell.name} {reason(outcome)}")

    def going(self) -> tuple[list[RunProgress], float | None]:
        """The runs that are being made, and the seconds that the rest takes if it goes on like this; None if that is not known yet."""
        now = [RunProgress(run.cell.folder, run.number, evaluations, elapsed) for run, evaluations, elapsed in list(self._going.values())]
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
        """The same above a table of at most twenty current runs."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        rows = Table.grid(padding=(0, 2), expand=False)
        going = sorted(self._going.values(), key=lambda one: (one[0].number, one[0].cell.name))
        for run, evaluations, elapsed in going[:20]:
            budget = run.cell.evaluations
            bar = ProgressBar(total=budget, completed=evaluations, width=20)
            of = "" if budget is None else f" / {budget:,}"
            count = Text(f"{evaluations:,}{of} evaluations".replace(",", " "))
            rows.add_row(Text(run.cell.name), Text(f"run {run.number}"), bar, count, Text(minutes(elapsed), style="dim"))
        return Group(Text(self.line(), style="bold"), rows)


def check_workers(jobs: int, executor: Executor | None) -> None:
    """Raise ValueError unless these can make runs."""
    check_count("jobs", jobs, 1)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise ValueError(f"executor must be a concurrent.futures.Executor, not {executor!r}")


def execute(
    store: Store,
    count: int,
    solvers: Collection[str],
    task_of: Callable[[StoredRun, Path], RunTask],
    code_of: Callable[[Cell], Code],
    jobs: int,
    executor: Executor | None,
    retry: bool,
    fresh: bool,
    progress: bool,
) -> None:
    """Make the runs that a study's folder lacks, `count` of each cell; if `fresh`, those by other code, too. However this ends, the
    workers are stopped, and runs finished by then are stored."""
    # The first run of every cell comes first: a study that is stopped early has results in all cells.
    every = sorted((run for run in store.runs(count) if run.cell.solver in solvers), key=lambda run: run.number)
    older = [run for run in every if run.finished and run.code != code_of(run.cell)]
    if older and fresh:
        every = [replace(run, status=MISSING) if run in older else run for run in every]
    elif older:
        names = {name for run in older for name in (changed(run.code, code_of(run.cell)) if run.code else [UNKNOWN])}
        what = store.path, len(older), len(every), ", ".join(sorted(names)[:5])
        log.warning("%s: %d of %d runs are by other code (%s, ...); they stay: `--fresh`, fresh=True, makes them again", *what)
    todo = [run for run in every if run.status in AGAIN or (retry and run.status == CRASHED)]
    if not todo:
        return
    workers = LocalWorkers(min(jobs, len(todo))) if executor is None else executor
    runs: dict[Future[RunOutcome], StoredRun] = {}
    done: queue.SimpleQueue[Future[RunOutcome]] = queue.SimpleQueue()
    with StudyDisplay(store.definition["name"], every, todo, progress, folder=store.path) as display:

        def keep(run: StoredRun, outcome: RunOutcome) -> None:
            store.keep(run, outcome, code_of(run.cell))
            display.ended(run, outcome)

        def stop() -> None:
            if isinstance(workers, LocalWorkers):
                workers.stop()
            for future in runs:  # an executor belongs to the caller: it ends the runs it has begun
                future.cancel()

        try:
            for run in todo:
                told = [display.reporter(run)] if executor is None else []  # workers elsewhere cannot call it
                future = workers.submit(perform_apart, task_of(run, store.checkpoint_path(run, digest_of_code(code_of(run.cell)))), *told)
                runs[future] = run
                future.add_done_callback(done.put)
            while runs:
                display.refresh()
                try:
                    future = done.get(timeout=0.2)
                except queue.Empty:
                    continue
                keep(runs[future], _outcome(future, len(runs)))
                del runs[future]
        except OSError:
            raise
        except BaseException:
            stop()
            while not done.empty():
                future = done.get()
                if not future.cancelled() and future.exception() is None and future.result().status == FINISHED:
                    keep(runs[future], future.result())
            raise
        finally:
            stop()


def _outcome(future: Future[RunOutcome], left: int) -> RunOutcome:
    """The result of a future. One lost worker is an outcome of its run; `WorkersLost` if the executor itself is gone."""
    try:
        return future.result()
    except (CancelledError, BrokenExecutor) as error:
        why = f": {error}" if str(error) else ""
        raise WorkersLost(
            f"the workers are gone ({type(error).__name__}{why}); {left} runs are left; the same command continues with them"
        ) from error
    except Exception as error:
        return RunOutcome(KILLED, f"its worker was lost: {type(error).__name__}: {error}", traceback.format_exc())
