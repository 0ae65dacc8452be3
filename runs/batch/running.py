"""Running a study: what its folder lacks is made, by whoever is there to make it, and kept as soon as it is there."""

from __future__ import annotations

import queue
import traceback
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

from problems.checks import check_count

from ..execution.crew import Crew, Hired, Local
from ..execution.task import CRASHED, FINISHED, KILLED, MEMORY, TIMEOUT, Outcome, Task
from .store import MISSING, UNREADABLE, Run, Store, Summary
from .watching import Watch

if TYPE_CHECKING:
    from ..study import Study

AGAIN = (MISSING, UNREADABLE, KILLED, TIMEOUT, MEMORY)
"""What is made when a study is called again. A run that ended with an exception would most likely end so again."""
LOOK = 0.2
"""Seconds between two looks at what is going on."""


class Deserted(RuntimeError):  # noqa: N818 - nobody's error but the executor's
    """Whoever did the work is gone. What is finished is kept; the same again goes on."""


def execute(
    study: Study,
    out: str | PathLike[str],
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    retry: bool = False,
    progress: bool = False,
) -> Summary:
    """Make the runs of a study that `out` lacks; see `Study.run`."""
    check_count("jobs", jobs, 1)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise ValueError(f"executor must be a concurrent.futures.Executor, not {executor!r}")
    with Store.claim(out, study.definition()) as store:
        # The first run of every cell comes first: a study that is stopped early has something to say on all of them.
        runs = sorted(store.runs(study.runs), key=lambda run: run.number)
        todo = [run for run in runs if run.status in AGAIN or (retry and run.status == CRASHED)]
        if todo:
            crew: Crew = Local(min(jobs, len(todo))) if executor is None else Hired(executor)
            with Watch(study.name, runs, todo, shown=progress) as watch:
                _make(study, store, crew, todo, watch)
        return store.summary(study.runs)


def _make(study: Study, store: Store, crew: Crew, todo: list[Run], watch: Watch) -> None:
    """Have runs made, and keep what comes of each. Whatever ends this, the crew is stopped, and what is finished by then is kept."""
    done: queue.SimpleQueue[tuple[Run, Any]] = queue.SimpleQueue()
    left = len(todo)
    try:
        for run in todo:
            future = crew.submit(_task(study, store, run), watch.reporter(run))
            future.add_done_callback(partial(_put, done, run))
        while left:
            watch.look()
            try:
                run, future = done.get(timeout=LOOK)
            except queue.Empty:
                continue
            left -= 1
            _keep(store, run, _outcome(future, left + 1), watch)
    except OSError:
        raise
    except BaseException:
        crew.stop()
        while not done.empty():
            run, future = done.get()
            if not future.cancelled() and future.exception() is None and future.result().status == FINISHED:
                _keep(store, run, future.result(), watch)
        raise
    finally:
        crew.stop()


def _put(done: queue.SimpleQueue[tuple[Run, Any]], run: Run, future: Any) -> None:
    done.put((run, future))


def _keep(store: Store, run: Run, outcome: Outcome, watch: Watch) -> None:
    store.keep(run.cell, run.number, outcome)
    watch.ended(run, outcome)


def _task(study: Study, store: Store, run: Run) -> Task:
    return Task(
        payload=study.payloads[run.cell.labels],
        evaluations=run.cell.evaluations,
        seed=run.seed,
        inner=study.inner_of(run.cell),
        tolerance=float(study.tolerance),
        time_limit=study.time_limit,
        start=study.sampling_of(run.cell),
        verify=study.verify,
        checkpoint=store.checkpoint_path(run.cell, run.number),
    )


def _outcome(future: Any, left: int) -> Outcome:
    """What a future holds; a worker that was lost with its run is an outcome, but not the loss of all."""
    try:
        return future.result()
    except (CancelledError, BrokenExecutor) as error:
        why = f": {error}" if str(error) else ""
        raise Deserted(
            f"whoever did the work is gone ({type(error).__name__}{why}); {left} runs are left, the same again goes on"
        ) from error
    except Exception as error:
        return Outcome(KILLED, f"its worker was lost: {type(error).__name__}: {error}", traceback.format_exc())
