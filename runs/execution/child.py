"""A child process for runs that may crash, hang or use up the memory: it is watched, ended and restarted."""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from .task import KILLED, TIMEOUT, Outcome, Report, Task

GRACE = 10.0
"""Seconds beyond its limit in which a run's process writes its traceback and ends itself; then it is killed."""
LATE, TRACED = 1, b"Timeout ("
"""Exit code of a process that `faulthandler` ends, and how the traceback begins that it writes before."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS")
"""All 1 in the process: more would round differently from machine to machine, and take the cores of other runs."""
LAST_OUTPUT = 4000
"""Characters kept of the output of a process that died."""


class Child:
    """One process that makes runs one after the other; for one thread, but `close` may be called from any."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._closed = False
        self._lock = threading.Lock()

    def perform(self, task: Task, report: Report | None = None) -> Outcome:
        """The outcome of a run. If its process is killed from outside, the run is begun once more."""
        outcome = self._attempt(task, report)
        if outcome.status == KILLED and not self._closed:
            outcome = self._attempt(task, report)
        return outcome

    def close(self) -> None:
        """End the process now; no run can be made with it any more."""
        with self._lock:
            self._closed = True
        self._end()

    def _attempt(self, task: Task, report: Report | None) -> Outcome:
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

    def _begin(self, task: Task) -> bool:
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
        places = os.pathsep.join(place or str(Path.cwd()) for place in sys.path)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "runs.execution.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._words,
            env={**os.environ, **dict.fromkeys(THREADS, "1"), "PYTHONPATH": places},
            start_new_session=True,
        )
        threading.Thread(target=_listen, args=(self._process.stdout, self._inbox), daemon=True).start()

    def _late(self, task: Task, seconds: float) -> Outcome:
        """The outcome of a run that took too long. The process's own clock began a little before this one's."""
        assert task.time_limit is not None
        self._end()
        return Outcome(TIMEOUT, f"it took more than {task.time_limit:g} s", self._text(), wall_time=max(seconds, task.time_limit))

    def _ended(self, task: Task, seconds: float) -> Outcome:
        """The outcome of a run whose process ended before the run did."""
        if self._closed:
            return Outcome(KILLED, "the study was stopped", wall_time=seconds)
        code = self._reap()
        if code == LATE and task.time_limit is not None and TRACED in self._output():
            return self._late(task, seconds)
        reason = f"its process ended with exit code {code}"
        if code < 0:
            name = next((one.name for one in signal.Signals if one == -code), f"signal {-code}")
            reason = f"its process was killed by {name}{', perhaps for want of memory' if code == -signal.SIGKILL else ''}"
        return Outcome(KILLED, reason, self._text(), wall_time=seconds)

    def _reap(self) -> int:
        """The exit code of a process that has ended, or is about to."""
        process = self._process
        if process is not None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(timeout=5.0)
            self._end()
        return 0 if process is None or process.returncode is None else process.returncode

    def _end(self) -> None:
        """Kill the process and all that it started."""
        with self._lock:
            process, self._process = self._process, None
        if process is None:
            return
        if hasattr(os, "killpg"):
            # It leads a group of its own. A compiler that it may just be calling has another one, and ends by itself.
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError, ValueError):
                    pipe.close()

    def _text(self) -> str:
        """The last output of the process."""
        return self._output().decode(errors="replace")[-LAST_OUTPUT:].strip()

    def _output(self) -> bytes:
        """All that the process has written since its task began."""
        self._words.seek(0)
        return self._words.read()


def _listen(channel: Any, inbox: queue.SimpleQueue[Any]) -> None:
    """Pass on the messages of a process; None at its end."""
    try:
        while True:
            inbox.put(pickle.load(channel))
    except Exception:  # whatever a process's last, half word provokes: it is gone
        inbox.put(None)


_own = threading.local()


def perform_apart(task: Task) -> Outcome:
    """The outcome of a run in a child process, which the calling thread keeps for its next run: the function that executors call."""
    if not hasattr(_own, "child"):
        _own.child = Child()
    return _own.child.perform(task)
