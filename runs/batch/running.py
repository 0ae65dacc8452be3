"""The runs that a study's folder lacks: submitted to workers, each stored as soon as it has ended."""

from __future__ import annotations

import queue
import traceback
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from problems.checks import check_count

from ..execution.task import CRASHED, FINISHED, KILLED, MEMORY, TIMEOUT, Outcome, Task
from ..execution.workers import ExecutorWorkers, LocalWorkers, Workers
from .display import StudyDisplay
from .store import MISSING, UNREADABLE, Store, StoredRun, Summary

AGAIN = (MISSING, UNREADABLE, KILLED, TIMEOUT, MEMORY)
"""Statuses of runs that are made again. A run that ended with an exception would most likely end so again."""
REFRESH = 0.2
"""Seconds between two updates of the display."""


class WorkersLost(RuntimeError):  # noqa: N818 - an event outside the program, not a mistake in it
    """The executor was shut down or lost all its workers. Finished runs are kept; the same call again makes the rest."""


def execute(
    out: str | PathLike[str],
    definition: Mapping[str, Any],
    runs: int,
    task_of: Callable[[StoredRun, Path], Task],
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    retry: bool = False,
    progress: bool = False,
) -> Summary:
    """Make the runs of a study that `out` lacks.

    Parameters
    ----------
    out, jobs, executor, retry, progress
        As for `Study.run`.
    definition : mapping
        The study as plain data, see `Study.definition`.
    runs : int
        Of each cell.
    task_of : callable
        (run, path of its checkpoint) -> the task that makes it.
    """
    check_count("jobs", jobs, 1)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise ValueError(f"executor must be a concurrent.futures.Executor, not {executor!r}")
    with Store.claim(out, definition) as store:
        # The first run of every cell comes first: a study that is stopped early has results in all cells.
        every = sorted(store.runs(runs), key=lambda run: run.number)
        todo = [run for run in every if run.status in AGAIN or (retry and run.status == CRASHED)]
        if todo:
            workers: Workers = LocalWorkers(min(jobs, len(todo))) if executor is None else ExecutorWorkers(executor)
            with StudyDisplay(definition["name"], every, todo, shown=progress) as display:
                _make(store, workers, todo, task_of, display)
        return store.summary(runs)


def _make(store: Store, workers: Workers, todo: list[StoredRun], task_of: Callable[[StoredRun, Path], Task], display: StudyDisplay) -> None:
    """Submit runs and store each outcome. However this ends, the workers are stopped, and runs finished by then are stored."""
    done: queue.SimpleQueue[tuple[StoredRun, Any]] = queue.SimpleQueue()
    left = len(todo)
    try:
        for run in todo:
            future = workers.submit(task_of(run, store.checkpoint_path(run.cell, run.number)), display.reporter(run))
            future.add_done_callback(partial(_put, done, run))
        while left:
            display.refresh()
            try:
                run, future = done.get(timeout=REFRESH)
            except queue.Empty:
                continue
            left -= 1
            _keep(store, run, _outcome(future, left + 1), display)
    except OSError:
        raise
    except BaseException:
        workers.stop()
        while not done.empty():
            run, future = done.get()
            if not future.cancelled() and future.exception() is None and future.result().status == FINISHED:
                _keep(store, run, future.result(), display)
        raise
    finally:
        workers.stop()


def _put(done: queue.SimpleQueue[tuple[StoredRun, Any]], run: StoredRun, future: Any) -> None:
    done.put((run, future))


def _keep(store: Store, run: StoredRun, outcome: Outcome, display: StudyDisplay) -> None:
    store.keep(run.cell, run.number, outcome)
    display.ended(run, outcome)


def _outcome(future: Any, left: int) -> Outcome:
    """The result of a future. One lost worker is an outcome of its run; `WorkersLost` if the executor itself is gone."""
    try:
        return future.result()
    except (CancelledError, BrokenExecutor) as error:
        why = f": {error}" if str(error) else ""
        raise WorkersLost(
            f"the workers are gone ({type(error).__name__}{why}); {left} runs are left; the same command continues with them"
        ) from error
    except Exception as error:
        return Outcome(KILLED, f"its worker was lost: {type(error).__name__}: {error}", traceback.format_exc())
