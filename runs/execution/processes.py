"""Processes for runs that may crash, hang or use up the memory: watched, ended and restarted. `python -m runs.execution.processes` is one.

In it, tasks come in on stdin, reports and outcomes go out on stdout. The output of a user's problem goes to stderr, and so does the
traceback of a crash or of a run that takes too long, which ends the process. It ends as soon as stdin is closed, too, also in the middle of
a run, and after a time without a task.
"""

from __future__ import annotations

import faulthandler
import logging
import os
import pickle
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from macs.io.console import Steps

from .task import CRASHED, KILLED, TIMEOUT, Report, RunOutcome, RunTask, perform

GRACE = 10.0
"""Seconds beyond its limit in which a run's process writes its traceback and ends itself; then it is killed."""
IDLE = 60.0
"""Seconds without a task after which a process for runs ends."""
SCHEDULER_WAIT = 5.0
"""Seconds to wait for the answer of a scheduler."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS")
"""All 1 in a process: more would round differently from machine to machine, and take the cores of other runs."""


def start(module: str, *arguments: str, **streams: Any) -> subprocess.Popen[Any]:
    """A process of a module's own main, which leads a group of its own."""
    own = str(Path(__file__).parents[2])  # first, whatever lies beside the user's script
    places = os.pathsep.join(place or str(Path.cwd()) for place in (own, *sys.path))
    env = {**os.environ, **dict.fromkeys(THREADS, "1"), "PYTHONPATH": places}
    return subprocess.Popen([sys.executable, "-m", module, *arguments], env=env, start_new_session=True, **streams)


def end(process: subprocess.Popen[Any]) -> None:
    """Kill a process and all that it started. A compiler that it may just be calling can have another group, and ends by itself."""
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


class Child:
    """One process that makes runs one after the other; for one thread, but `close` may be called from any."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._closed = False
        self._lock = threading.Lock()

    def perform(self, task: RunTask, report: Report | None = None) -> RunOutcome:
        """The outcome of a run. If its process is killed from outside, the run is begun once more."""
        outcome = self._attempt(task, report)
        return self._attempt(task, report) if outcome.status == KILLED and not self._closed else outcome

    def _attempt(self, task: RunTask, report: Report | None) -> RunOutcome:
        if not self._begin(task):
            return self._ended(task, 0.0)
        began = time.perf_counter()
        while True:
            left = None if task.time_limit is None else max(0.0, began + task.time_limit + GRACE - time.perf_counter())
            try:
                message = self._inbox.get(timeout=left)
            except queue.Empty:
                return self._late(task, time.perf_counter() - began)
            if message is None:
                return self._ended(task, time.perf_counter() - began)
            if message[0] == "outcome":
                return message[1]
            if message[0] == "report" and report is not None:
                report(*message[1:])

    def close(self) -> None:
        """End the process now; no run can be made with it any more."""
        with self._lock:
            self._closed = True
        self._end()

    def _begin(self, task: RunTask) -> bool:
        """Send a task to the process, which is replaced if it has ended, as after a long time without tasks."""
        for _ in range(2):
            with self._lock:
                if self._closed:
                    return False
                if self._process is None:
                    self._start()
                process = self._process
            assert process is not None and process.stdin is not None
            self._words.truncate(0)
            try:
                pickle.dump(task, process.stdin)
                process.stdin.flush()
                if self._inbox.get() is not None:
                    return True
            except OSError:
                pass
            self._reap()
        return False

    def _start(self) -> None:
        self._words = tempfile.TemporaryFile("a+b")  # noqa: SIM115 - as long as the process
        self._inbox = queue.SimpleQueue()
        self._process = start("runs.execution.processes", stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._words)
        threading.Thread(target=receive, args=(self._process.stdout, self._inbox.put, None), daemon=True).start()

    def _late(self, task: RunTask, seconds: float) -> RunOutcome:
        """The outcome of a run that took too long. The process's own clock began a little before this one's."""
        assert task.time_limit is not None
        self._end()
        return RunOutcome(TIMEOUT, f"it took more than {task.time_limit:g} s", self._text(), wall_time=max(seconds, task.time_limit))

    def _ended(self, task: RunTask, seconds: float) -> RunOutcome:
        """The outcome of a run whose process ended before the run did."""
        if self._closed:
            return RunOutcome(KILLED, "the study was stopped", wall_time=seconds)
        code = self._reap()
        # `faulthandler` ends a process that takes too long with exit code 1, after its traceback.
        if code == 1 and task.time_limit is not None and b"Timeout (" in self._output():
            return self._late(task, seconds)
        reason = f"its process ended with exit code {code}"
        if code < 0:
            name = next((one.name for one in signal.Signals if one == -code), f"signal {-code}")
            reason = f"its process was killed by {name}{', perhaps for want of memory' if code == -signal.SIGKILL else ''}"
        return RunOutcome(KILLED, reason, self._text(), wall_time=seconds)

    def _reap(self) -> int:
        """The exit code of a process that has ended, or is about to."""
        process = self._process
        if process is not None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(timeout=5.0)
            self._end()
        return 0 if process is None or process.returncode is None else process.returncode

    def _end(self) -> None:
        with self._lock:
            process, self._process = self._process, None
        if process is None:
            return
        end(process)
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError, ValueError):
                    pipe.close()

    def _text(self) -> str:
        """The last output of the process."""
        return self._output().decode(errors="replace")[-4000:].strip()

    def _output(self) -> bytes:
        """All that the process has written since its task began."""
        self._words.seek(0)
        return self._words.read()


def receive(channel: Any, put: Callable[[Any], None], last: Any) -> None:
    """Pass on what comes through a pipe, and `last` at its end, whatever the last, half word of a process provokes."""
    with suppress(Exception):
        while True:
            put(pickle.load(channel))
    put(last)


_own = threading.local()


def perform_apart(task: RunTask, report: Report | None = None) -> RunOutcome:
    """The outcome of a run in a child process, which the calling thread keeps for its next run: the function that executors call."""
    if not hasattr(_own, "child"):
        _own.child = Child()
    if report is not None:
        report(0, 0.0)
    return _own.child.perform(task, report)


class LocalWorkers(ThreadPoolExecutor):
    """An executor of threads, each with one process of this machine for its runs; `stop` ends all work now."""

    def __init__(self, jobs: int) -> None:
        super().__init__(jobs, thread_name_prefix="run", initializer=self._begin)
        self._children: list[Child] = []

    def _begin(self) -> None:
        _own.child = Child()
        self._children.append(_own.child)

    def stop(self) -> None:
        """End all work now."""
        self.shutdown(wait=False, cancel_futures=True)
        for child in self._children:
            child.close()
        self.shutdown()


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
        client = Client(address, timeout=SCHEDULER_WAIT, set_as_default=False)
    except (OSError, TimeoutError) as error:
        raise ValueError(f"no Dask scheduler answers at {address} within {SCHEDULER_WAIT:g} s") from error
    except ValueError as error:
        raise ValueError(f"'{address}' is no address of a Dask scheduler, such as tcp://10.0.0.1:8786: {error}") from error
    try:
        yield client.get_executor(pure=False)
    finally:
        client.close(timeout=SCHEDULER_WAIT)


def lines_apart(module: str, arguments: Sequence[str], limit: float, steps: Steps) -> tuple[list[str], str]:
    """The lines that `python -m module arguments` prints within `limit` seconds, and why they are not all: `TIMEOUT`, `CRASHED` or nothing.

    Why it crashed is printed on stderr.
    """
    began, ended = time.perf_counter(), ""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as words:
        process = start(module, *arguments, stdout=out, stderr=words, text=True)
        try:
            while not ended:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(timeout=0.1)
                    break
                steps.check()
                ended = TIMEOUT if time.perf_counter() - began > limit else ""
        finally:
            end(process)
        out.seek(0)
        lines = out.read().splitlines()
        if not ended and process.returncode:
            ended = CRASHED
            words.seek(0)
            complaint = words.read().strip().splitlines()
            print(f"{' '.join(arguments)}: {complaint[-1] if complaint else process.returncode}", file=sys.stderr)
    return lines, ended


def main() -> None:
    """Make runs until stdin is closed or no task has come for a while."""
    # Imported before the first run begins, so that the time of a run does not include it.
    import h5py  # noqa: F401

    import macs.fronts.files  # noqa: F401

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent process
    channel = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    faulthandler.enable()
    tasks: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def put(task: RunTask | None) -> None:
        if task is None:  # stdin is closed: the sender has ended
            os._exit(0)
        tasks.put(task)

    threading.Thread(target=receive, args=(os.fdopen(os.dup(0), "rb"), put, None), daemon=True).start()
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)

    def send(*words: Any) -> None:
        pickle.dump(words, channel)
        channel.flush()

    while True:
        try:
            task = tasks.get(timeout=IDLE)
        except queue.Empty:
            return
        if task.time_limit is not None:
            faulthandler.dump_traceback_later(task.time_limit, exit=True)
        send("began")
        outcome = perform(task, lambda evaluations, elapsed: send("report", evaluations, elapsed))
        faulthandler.cancel_dump_traceback_later()
        send("outcome", outcome)


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:
        os._exit(0)
    sys.exit(0)
