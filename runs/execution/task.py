"""One run in any process: from a task to its outcome, both plain data; samples of its archive on the way, and its memory."""

from __future__ import annotations

import logging
import math
import os
import pickle
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from macs.fronts.verified import accuracy
from macs.io.atomic import write_whole
from macs.search.rounds import PLANNED_EVALUATIONS
from macs.solvers.checkpoint import Unreadable, keeps
from problems import load

from ..files import checked, read_record, to_record

if TYPE_CHECKING:
    from macs.front import Front
    from macs.solvers.solver import Solver
    from transcription import Smooth

log = logging.getLogger(__name__)

FINISHED, CRASHED, TIMEOUT, MEMORY, KILLED = "finished", "crashed", "timeout", "out of memory", "killed"

Payload = tuple[bytes, bytes]
FinalStates = Mapping[str, Mapping[str, np.ndarray]]
"""{phase: {state: its final values (n,)}} of the n trajectories of a front."""


class SimulationRecord(TypedDict, total=False):
    """The "ends" of simulated trajectories: `FinalStates` as plain data. Empty if they were not simulated."""

    ends: dict[str, dict[str, list[float]]]


@dataclass(frozen=True)
class Addressed:
    """A problem that a process loads from its address, see `problems.load`. The study has loaded it from there before."""

    address: str
    data: Mapping[str, Any]


@dataclass(frozen=True)
class RunTask:
    """A run to be made: `payload` is its problem and transcription (None for a vector problem), pickled, and its solver, pickled.

    `checkpoint` is the file of its state while it lasts, used if its process can write to that folder, as on this machine or on a cluster
    with one file system.
    """

    payload: Payload = field(repr=False)
    evaluations: int | None
    seed: int
    inner: str
    tolerance: float
    time_limit: float | None
    start: Smooth | str | None = None
    verify: float | None = None
    checkpoint: Path | None = None


@dataclass(frozen=True)
class RunOutcome:
    """The outcome of a run."""

    status: str  # "finished", "crashed" (by an exception), "timeout", "out of memory" or "killed"
    message: str = ""  # message, traceback: The reason why it is not finished, in one line and in full
    traceback: str = field(default="", repr=False)
    front: bytes = field(default=b"", repr=False)  # the content of its front's file, if it is finished
    wall_time: float = 0.0  # seconds until its end
    # "evaluations", "inner_iterations", "gradient_solves", "elapsed" and "F" at each sample: numbers, and the archive's objectives, all
    # minimised. The last sample is the front itself.
    history: Mapping[str, Any] = field(default_factory=dict, repr=False)
    # The final states of the points if they were simulated.
    simulated: SimulationRecord = field(default_factory=SimulationRecord, repr=False)


def perform(task: RunTask, report: Report | None = None) -> RunOutcome:
    """The outcome of a run, made in this process from its checkpoint or its beginning. An exception is an outcome."""
    began = time.perf_counter()
    try:
        problem, scheme = _unpacked(task.payload[0])
        solver = pickle.loads(task.payload[1])
        front, samples = _solved(task, solver, problem, scheme, report)
        from macs.fronts.files import to_bytes
        from macs.solvers.run import ENDED

        # Gradient tools that came to their end name no reason for it.
        if (stopped := front.stats.get("stopped", ENDED[0])) not in ENDED:
            return RunOutcome(KILLED, f"it was stopped: {stopped}", wall_time=time.perf_counter() - began)
        content = to_bytes(front)
        samples.add(front.stats, front.stats["wall_time"], front.F)
        # The front alone knows the time before the run was resumed.
        seconds = max(time.perf_counter() - began, front.stats["wall_time"])
        found = _simulated(task, front)
        return RunOutcome(FINISHED, front.message, front=content, wall_time=seconds, history=samples.columns, simulated=found)
    except Exception as error:
        status, why = (MEMORY, str(error)) if is_memory_error(error) else (CRASHED, f"{type(error).__name__}: {error}")
        return RunOutcome(status, " ".join(why.split()), traceback.format_exc(), wall_time=time.perf_counter() - began)


def samples_path(checkpoint: Path) -> Path:
    """Where a run's samples are kept, beside its checkpoint."""
    return checkpoint.with_suffix(".samples")


def _solved(task: RunTask, solver: Solver, problem: Any, scheme: Any, report: Report | None) -> tuple[Front, ArchiveSamples]:
    """The front of a run and its samples. With a checkpoint that cannot be used, the run begins again."""
    kept = task.checkpoint if task.checkpoint and os.access(task.checkpoint.parent, os.W_OK | os.X_OK) and keeps(solver) else None
    while True:
        samples = ArchiveSamples(task.evaluations, report, samples_path(kept) if kept else None)
        try:
            front = solver.solve(
                problem,
                scheme,
                evaluations=task.evaluations,
                seed=task.seed,
                inner=None if scheme is None else task.inner,
                tolerance=task.tolerance,
                start=task.start,
                verify=task.verify,
                callback=samples.note,
                checkpoint=kept,
            )
        except Unreadable as error:
            assert kept is not None
            log.warning("%s: the run begins again", error)
            kept.unlink()
        else:
            return front, samples


def _simulated(task: RunTask, front: Front) -> SimulationRecord:
    """The final states of the points as simulated, if the task asks for it. Empty if that fails: the report tries again, and a run is not
    lost by it."""
    if task.verify is None or not front.dynamic or not front.was_simulated.all():
        return {}
    try:
        return record(front, task.verify)
    except Exception:
        log.warning("the points of a front could not be simulated; the report tries again", exc_info=True)
        return {}


def record(front: Front, tolerance: float) -> SimulationRecord:
    """The final states of a front's points when they are simulated as finely as to verify them within a tolerance."""
    rtol, atol = accuracy(tolerance)
    final = final_states(front.simulate(rtol=rtol, atol=atol))
    return {"ends": {phase: {name: values.tolist() for name, values in states.items()} for phase, states in final.items()}}


def final_states(front: Front) -> FinalStates:
    """The final states of each phase of a front's n trajectories; empty where a point has none."""
    trajectories = [point.trajectory for point in front if point.trajectory is not None]
    if not trajectories or len(trajectories) < len(front):
        return {}
    return {
        name: {
            v.name: np.array([trajectory[name].edge_states[-1, k] for trajectory in trajectories])
            for k, v in enumerate(phase.state_variables)
        }
        for name, phase in trajectories[0].items()
    }


@lru_cache(maxsize=8)
def _unpacked(payload: bytes) -> tuple[Any, Any]:
    """Problem and transcription: the runs that one process makes of them share the NLP that is kept with the problem."""
    problem, scheme = pickle.loads(payload)
    return (load(problem.address, **problem.data).compile() if isinstance(problem, Addressed) else problem), scheme


# Samples

COUNTS = ("evaluations", "inner_iterations", "gradient_solves", "work", "charge")
Report = Callable[[int, float], Any]
"""Called at intervals with the evaluations and seconds so far."""


class History(TypedDict, total=False):
    """How a run converged, by columns with an entry for each sample; empty if it is not known.

    Keys are its costs so far, "elapsed" seconds, "cpu" of the processor, and "F": the objectives (k, m) of its archive, all minimised.
    """

    evaluations: list[int]
    inner_iterations: list[int]
    gradient_solves: list[int]
    work: list[int]
    charge: list[int]
    elapsed: list[float]
    cpu: list[float]
    F: list[list[list[float]]]


class ArchiveSamples:
    """About thirty samples of the archive, evenly spaced in evaluations, and reports of the progress at intervals; stored beside the
    checkpoint, so that a resumed run has its whole history."""

    def __init__(self, budget: int | None, report: Report | None = None, path: Path | None = None) -> None:
        self._step = max(1, (budget or PLANNED_EVALUATIONS) // 30)
        self._next, self._report, self._told, self._path = 0, report, 0.0, path
        self.columns: dict[str, list[Any]] = {key: [] for key in History.__annotations__}
        self._began = time.process_time()  # less what a run that is resumed had taken before
        self._before, self._unsaved = _read(path), False

    def note(self, progress: Any) -> None:
        """To be called after every iteration."""
        self._resume(progress.evaluations)
        if progress.evaluations >= self._next:
            self._next = (progress.evaluations // self._step + 1) * self._step
            self.add(vars(progress), progress.elapsed, progress.F)
            self._unsaved = self._path is not None
        if self._unsaved:
            self._write()
        if self._report is not None and progress.elapsed - self._told >= 0.25:  # seconds
            self._told = progress.elapsed
            self._report(progress.evaluations, progress.elapsed)

    def add(self, counts: Any, elapsed: float, F: Any) -> None:
        """Add a sample."""
        self._resume(counts["evaluations"] + 1)
        for key in COUNTS:
            self.columns[key].append(int(counts.get(key, 0)))
        self.columns["elapsed"].append(float(elapsed))
        self.columns["cpu"].append(time.process_time() - self._began)
        self.columns["F"].append(F.tolist())

    def _resume(self, evaluations: int) -> None:
        """At the first call, begin with the stored samples before this count."""
        if self._before is None:
            return
        count = sum(before < evaluations for before in self._before["evaluations"])
        self.columns, self._before = {key: self._before[key][:count] for key in self.columns}, None
        if count:
            self._began -= self.columns["cpu"][-1]
            self._next = (self.columns["evaluations"][-1] // self._step + 1) * self._step

    def _write(self) -> None:
        assert self._path is not None
        try:
            write_whole(self._path, to_record(self.columns))
            self._unsaved = False
        except OSError as error:  # as for a checkpoint: the run goes on, and the next write may succeed
            log.warning("%s", error)


def _read(path: Path | None) -> dict[str, list[Any]] | None:
    """The columns in a file; None if there is none, or it is damaged: then the history begins where the run is resumed."""
    if path is None or not path.exists():
        return None
    try:
        columns = checked(read_record(path), History)
        if columns.keys() != History.__annotations__.keys():
            raise ValueError(f"it has {', '.join(columns)}")
    except (OSError, ValueError) as error:
        log.warning("'%s' is damaged, so the history of its run is not complete: %s", path, error)
        return None
    return columns


# Memory


def is_memory_error(error: BaseException) -> bool:
    """Whether an error says that memory could not be allocated. CasADi's do so as RuntimeErrors, whose text ends with what C++ says."""
    return isinstance(error, MemoryError) or (isinstance(error, RuntimeError) and "bad_alloc" in str(error))


def memory_message(error: BaseException) -> str:
    """One line on such an error: what was asked for, where it is known, what the process had, and what takes less."""
    peak = peak_memory()
    had = "" if math.isnan(peak) else f"; the process had {peak:.0f} MB"
    asked = " ".join(str(error).split())
    return f"out of memory{f': {asked}' if asked else ''}{had}; a coarser transcription, or fewer at a time, takes less"


def peak_memory() -> float:
    """Most memory that this process has had, MB; no number where the system does not say."""
    status = Path("/proc/self/status")
    # On Linux, what `getrusage` says of a process is at least what the one that started it had.
    for line in status.read_text().splitlines() if status.exists() else ():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) / 2**10
    try:
        import resource
    except ImportError:  # only Unix has it
        return math.nan
    # Kilobytes, but bytes on a Mac.
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
