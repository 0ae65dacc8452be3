"""A process that makes one run after the other, `python -m runs.execution.worker`: tasks come in on stdin, reports and outcomes go out on
stdout.

The output of a user's problem goes to stderr, and so does the traceback of a crash or of a run that takes too long, which ends the process.
It ends as soon as stdin is closed, too, also in the middle of a run, and after a time without a task.
"""

from __future__ import annotations

import faulthandler
import os
import pickle
import queue
import sys
import threading
from typing import Any

# Imported before the first run begins, so that the time of a run does not include it.
import h5py  # noqa: F401

import macs.fronts.files  # noqa: F401

from .task import perform

PATIENCE = 60.0
"""Seconds without a task after which it ends."""


def main() -> None:
    """Make runs until stdin is closed or no task has come for `PATIENCE` seconds."""
    channel = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    faulthandler.enable()
    tasks: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(os.fdopen(os.dup(0), "rb"), tasks), daemon=True).start()
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)

    def send(*words: Any) -> None:
        pickle.dump(words, channel)
        channel.flush()

    while True:
        try:
            task = tasks.get(timeout=PATIENCE)
        except queue.Empty:
            return
        if task.time_limit is not None:
            faulthandler.dump_traceback_later(task.time_limit, exit=True)
        send("began")
        outcome = perform(task, lambda evaluations, elapsed: send("report", evaluations, elapsed))
        faulthandler.cancel_dump_traceback_later()
        send("outcome", outcome)


def _listen(channel: Any, tasks: queue.SimpleQueue[Any]) -> None:
    """Pass tasks on; end the process when stdin is closed, which means that the sender has ended."""
    try:
        while True:
            tasks.put(pickle.load(channel))
    except (EOFError, OSError):
        os._exit(0)


if __name__ == "__main__":
    # Ctrl-C is for the parent process.
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        main()
    except BrokenPipeError:
        os._exit(0)
    sys.exit(0)
