"""Workers that make runs: processes of this machine, or those of an executor. Both return futures of outcomes."""

from __future__ import annotations

import logging
import queue
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from .child import Child, perform_apart
from .task import Outcome, Report, Task


class LocalWorkers:
    """`jobs` processes on this machine, each with a thread that watches it."""

    def __init__(self, jobs: int) -> None:
        self._children = [Child() for _ in range(jobs)]
        self._idle: queue.SimpleQueue[Child] = queue.SimpleQueue()
        for child in self._children:
            self._idle.put(child)
        self._threads = ThreadPoolExecutor(jobs, thread_name_prefix="run")

    def submit(self, task: Task, report: Report) -> Future[Outcome]:
        """The outcome of a run, in the future; `report` is called with its progress."""
        return self._threads.submit(self._perform, task, report)

    def stop(self) -> None:
        """End all work now."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for child in self._children:
            child.close()
        self._threads.shutdown()

    def _perform(self, task: Task, report: Report) -> Outcome:
        child = self._idle.get()
        try:
            report(0, 0.0)
            return child.perform(task, report)
        finally:
            self._idle.put(child)


class ExecutorWorkers:
    """The workers of an executor. Each of their threads keeps one process for runs."""

    def __init__(self, executor: Executor) -> None:
        self._submit: Callable[..., Any] = executor.submit
        self._futures: list[Any] = []

    def submit(self, task: Task, report: Report) -> Future[Outcome]:
        """The outcome of a run, in the future; `report` is not called."""
        future = self._submit(perform_apart, task)
        self._futures.append(future)
        return future

    def stop(self) -> None:
        """Cancel the runs that have not begun. The executor belongs to the caller: it is not shut down, and ends the runs it has begun."""
        for future in self._futures:
            future.cancel()


PATIENCE = 5.0
"""Seconds to wait for the answer of a scheduler."""


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The executor of a Dask cluster, open within the context."""
    try:
        from distributed import Client
    except ImportError as error:
        raise ValueError(f"--dask needs Dask, which is not installed ({error}): pip install 'macs-trajectories[dask]'") from None
    # Its own log repeats the error at length; one line is enough.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise ValueError(f"no Dask scheduler answers at {address} within {PATIENCE:g} s") from error
    except ValueError as error:
        raise ValueError(f"'{address}' is no address of a Dask scheduler, such as tcp://10.0.0.1:8786: {error}") from error
    try:
        yield client.get_executor(pure=False)
    finally:
        client.close(timeout=PATIENCE)
