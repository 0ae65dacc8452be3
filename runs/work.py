"""One run, in whatever process: a task goes in, an outcome comes out, both plain data."""

from __future__ import annotations

import pickle
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from transcription import Smooth

FINISHED, CRASHED, TIMEOUT, MEMORY, KILLED = "finished", "crashed", "timeout", "out of memory", "killed"
SAMPLES = 30
"""At how many evaluation counts, at most and evenly spaced, the archive is noted, besides the end."""
EVERY = 0.25
"""Seconds between reports."""

Payload = tuple[bytes, bytes]
Report = Callable[[int, float], Any]
"""Called now and then with evaluations and seconds spent so far."""


@dataclass(frozen=True)
class Task:
    """A run to be made: `payload` is its problem and transcription, pickled, and its solver, pickled."""

    payload: Payload = field(repr=False)
    evaluations: int
    seed: int
    inner: str
    tolerance: float
    time_limit: float | None
    start: Smooth | None = None


@dataclass(frozen=True)
class Outcome:
    """What came of a run.

    Attributes
    ----------
    status : str
        "finished", "crashed" (by an exception), "timeout", "out of memory" or "killed".
    message, traceback : str
        Why it is not finished, in a line and in full.
    front : bytes
        The content of its front's file, if it is finished.
    wall_time : float
        Seconds, as far as it came.
    history : dict
        "evaluations", "inner_iterations", "gradient_solves", "elapsed" and "F" at each sample: numbers, and the archive's objectives, all
        minimised. The last sample is the front itself.
    """

    status: str
    message: str = ""
    traceback: str = field(default="", repr=False)
    front: bytes = field(default=b"", repr=False)
    wall_time: float = 0.0
    history: dict[str, list[Any]] = field(default_factory=dict, repr=False)


def perform(task: Task, report: Report | None = None) -> Outcome:
    """Make a run here and now. An exception is an outcome."""
    began = time.perf_counter()
    history = _History(task.evaluations, report)
    try:
        problem, scheme = _unpacked(task.payload[0])
        solver = pickle.loads(task.payload[1])
        front = solver.solve(
            problem,
            scheme,
            evaluations=task.evaluations,
            seed=task.seed,
            inner=task.inner,
            tolerance=task.tolerance,
            start=task.start,
            callback=history.note,
        )
        from macs.running import ENDED
        from macs.storage import to_bytes

        if front.stats["stopped"] not in ENDED:
            return Outcome(KILLED, f"it was stopped: {front.stats['stopped']}", wall_time=time.perf_counter() - began)
        content = to_bytes(front)
        history.add(front.stats, front.stats["wall_time"], front.F)
        return Outcome(FINISHED, front.message, front=content, wall_time=time.perf_counter() - began, history=history.columns)
    except Exception as error:
        status, why = (MEMORY, str(error)) if isinstance(error, MemoryError) else (CRASHED, f"{type(error).__name__}: {error}")
        return Outcome(status, " ".join(why.split()), traceback.format_exc(), wall_time=time.perf_counter() - began)


@lru_cache(maxsize=8)
def _unpacked(payload: bytes) -> tuple[Any, Any]:
    """Problem and transcription; the runs that one process makes of them share an NLP, and all that is compiled of it."""
    problem, scheme = pickle.loads(payload)
    nlp = scheme.transcribe(problem)
    # It hides the method in this one value, which nobody else has.
    object.__setattr__(scheme, "transcribe", lambda _: nlp)
    return problem, scheme


class _History:
    """Notes the archive at some counts, and reports now and then; costs next to nothing."""

    def __init__(self, budget: int, report: Report | None) -> None:
        self.columns: dict[str, list[Any]] = {key: [] for key in ("evaluations", "inner_iterations", "gradient_solves", "elapsed", "F")}
        self._step, self._next, self._report, self._told = max(1, budget // SAMPLES), 0, report, 0.0

    def note(self, progress: Any) -> None:
        if progress.evaluations >= self._next:
            self._next = (progress.evaluations // self._step + 1) * self._step
            self.add(vars(progress), progress.elapsed, progress.F)
        if self._report is not None and progress.elapsed - self._told >= EVERY:
            self._told = progress.elapsed
            self._report(progress.evaluations, progress.elapsed)

    def add(self, counts: Any, elapsed: float, F: Any) -> None:
        for key in ("evaluations", "inner_iterations", "gradient_solves"):
            self.columns[key].append(int(counts[key]))
        self.columns["elapsed"].append(float(elapsed))
        self.columns["F"].append(F.tolist())
