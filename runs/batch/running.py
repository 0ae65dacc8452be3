"""The runs that a study's folder lacks: submitted to workers, each stored as soon as it has ended."""

from __future__ import annotations

import queue
import traceback
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from pathlib import Path

from problems.checks import check_count
from problems.compiled import Objective

from ..execution.task import CRASHED, FINISHED, KILLED, MEMORY, TIMEOUT, Outcome, Task
from ..execution.workers import ExecutorWorkers, LocalWorkers
from .display import StudyDisplay
from .progress import ProgressFile
from .store import MISSING, UNREADABLE, Store, StoredRun

AGAIN = (MISSING, UNREADABLE, KILLED, TIMEOUT, MEMORY)
"""Statuses of runs that are made again. A run that ended with an exception would most likely end so again."""
REFRESH = 0.2
"""Seconds between two updates of the display."""


class WorkersLost(RuntimeError):  # noqa: N818 - an event outside the program, not a mistake in it
    """The executor was shut down or lost all its workers. Finished runs are kept; the same call again makes the rest."""


def check_workers(jobs: int, executor: Executor | None) -> None:
    """Raise ValueError unless these can make runs."""
    check_count("jobs", jobs, 1)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise ValueError(f"executor must be a concurrent.futures.Executor, not {executor!r}")


def execute(
    store: Store,
    count: int,
    solvers: Collection[str],
    task_of: Callable[[StoredRun, Path], Task],
    goals: Mapping[str, Sequence[Objective]],
    jobs: int,
    executor: Executor | None,
    retry: bool,
    progress: bool,
) -> None:
    """Make the runs that a study's folder lacks, `count` of each cell. However this ends, the workers are stopped, and runs finished by
    then are stored."""
    # The first run of every cell comes first: a study that is stopped early has results in all cells.
    every = sorted((run for run in store.runs(count) if run.cell.solver in solvers), key=lambda run: run.number)
    todo = [run for run in every if run.status in AGAIN or (retry and run.status == CRASHED)]
    if not todo:
        return
    workers: LocalWorkers | ExecutorWorkers = LocalWorkers(min(jobs, len(todo))) if executor is None else ExecutorWorkers(executor)
    runs: dict[Future[Outcome], StoredRun] = {}
    done: queue.SimpleQueue[Future[Outcome]] = queue.SimpleQueue()
    display = StudyDisplay(store.definition["name"], every, todo, shown=progress)
    with display, ProgressFile(store.path, goals, display.going) as told:

        def keep(run: StoredRun, outcome: Outcome) -> None:
            store.keep(run, outcome)
            display.ended(run, outcome)

        try:
            for run in todo:
                future = workers.submit(task_of(run, store.checkpoint_path(run)), display.reporter(run))
                runs[future] = run
                future.add_done_callback(done.put)
            while runs:
                display.refresh()
                told.refresh()
                try:
                    future = done.get(timeout=REFRESH)
                except queue.Empty:
                    continue
                keep(runs[future], _outcome(future, len(runs)))
                del runs[future]
        except OSError:
            raise
        except BaseException:
            workers.stop()
            while not done.empty():
                future = done.get()
                if not future.cancelled() and future.exception() is None and future.result().status == FINISHED:
                    keep(runs[future], future.result())
            raise
        finally:
            workers.stop()


def _outcome(future: Future[Outcome], left: int) -> Outcome:
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
