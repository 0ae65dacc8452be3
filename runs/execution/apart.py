"""A module's own main in a process of its own, so that its memory is its own and its end can be forced."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress

from macs.io.console import Steps

from .child import THREADS

LATE, CRASHED = "TOO LATE", "CRASHED"
POLL = 0.1


def lines_apart(module: str, arguments: Sequence[str], limit: float, steps: Steps) -> tuple[list[str], str]:
    """The lines that `python -m module arguments` prints within `limit` seconds, and why they are not all: `LATE`, `CRASHED` or nothing.

    Why it crashed is printed on stderr.
    """
    places = os.pathsep.join(place or os.curdir for place in sys.path)
    began, ended = time.perf_counter(), ""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as words:
        process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdout=out,
            stderr=words,
            text=True,
            env={**os.environ, **dict.fromkeys(THREADS, "1"), "PYTHONPATH": places},
            start_new_session=True,
        )
        try:
            while not ended:
                try:
                    process.wait(timeout=POLL)
                    break
                except subprocess.TimeoutExpired:
                    steps.check()
                    ended = LATE if time.perf_counter() - began > limit else ""
        finally:
            # It leads a group of its own: also a compiler that it may just be calling ends.
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        out.seek(0)
        lines = out.read().splitlines()
        if not ended and process.returncode:
            ended = CRASHED
            words.seek(0)
            complaint = words.read().strip().splitlines()
            print(f"{' '.join(arguments)}: {complaint[-1] if complaint else process.returncode}", file=sys.stderr)
    return lines, ended
