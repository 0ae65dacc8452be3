"""Who makes the runs: processes of this machine, or an executor's workers. Both answer with futures of outcomes."""

from __future__ import annotations

import logging
import queue
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Protocol

from .child import Child, perform_apart
from .task import Outcome, Report, Task


class Crew(Protocol):
    """What `executing` needs."""

    def submit(self, task: Task, report: Report) -> Future[Outcome]:
        """Have a run made; `report` is called with its progress, where that can be known."""

    def stop(self) -> None:
        """End all work, now, as far as that is possible."""


class Local:
    """So many processes at a time on this machine, each with a thread that watches it."""

    def __init__(self, jobs: int) -> None:
        self._children = [Child() for _ in range(jobs)]
        self._idle: queue.SimpleQueue[Child] = queue.SimpleQueue()
        for child in self._children:
            self._idle.put(child)
        self._threads = ThreadPoolExecutor(jobs, thread_name_prefix="run")

    def submit(self, task: Task, report: Report) -> Future[Outcome]:
        """See `Crew`."""
        return self._threads.submit(self._perform, task, report)

    def stop(self) -> None:
        """See `Crew`."""
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


class Hired:
    """An executor's workers, wherever they are; each thread of theirs keeps a process of its own for runs."""

    def __init__(self, executor: Executor) -> None:
        self._submit: Callable[..., Any] = executor.submit
        self._futures: list[Any] = []

    def submit(self, task: Task, report: Report) -> Future[Outcome]:
        """See `Crew`; there is no word from them before the end."""
        future = self._submit(perform_apart, task)
        self._futures.append(future)
        return future

    def stop(self) -> None:
        """Take back what has not begun; the executor is not ours to shut down, and what it is at, it ends."""
        for future in self._futures:
            future.cancel()


PATIENCE = 5.0
"""Seconds in which a scheduler has to answer."""


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The workers of the Dask scheduler at `address`, as long as this is entered.

    Raises
    ------
    ValueError
        Dask is not installed, the address makes no sense, or nobody answers there.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ValueError(f"--dask needs Dask, which is not installed ({error}): pip install 'macs-trajectories[dask]'") from None
    # It would tell at length, on several channels, what is told here in one line.
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
