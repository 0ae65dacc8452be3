"""One run in any process: from a task to its outcome, both plain data."""

from __future__ import annotations

import logging
import os
import pickle
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from macs.fronts.verified import accuracy
from macs.solvers.checkpoint import Unreadable, keeps
from problems import load

from .memory import is_memory_error
from .samples import Report, Samples

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
class Task:
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
class Outcome:
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


def perform(task: Task, report: Report | None = None) -> Outcome:
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
            return Outcome(KILLED, f"it was stopped: {stopped}", wall_time=time.perf_counter() - began)
        content = to_bytes(front)
        samples.add(front.stats, front.stats["wall_time"], front.F)
        # The front alone knows the time before the run was resumed.
        seconds = max(time.perf_counter() - began, front.stats["wall_time"])
        found = _simulated(task, front)
        return Outcome(FINISHED, front.message, front=content, wall_time=seconds, history=samples.columns, simulated=found)
    except Exception as error:
        status, why = (MEMORY, str(error)) if is_memory_error(error) else (CRASHED, f"{type(error).__name__}: {error}")
        return Outcome(status, " ".join(why.split()), traceback.format_exc(), wall_time=time.perf_counter() - began)


def samples_path(checkpoint: Path) -> Path:
    """Where a run's samples are kept, beside its checkpoint."""
    return checkpoint.with_suffix(".samples")


def _solved(task: Task, solver: Solver, problem: Any, scheme: Any, report: Report | None) -> tuple[Front, Samples]:
    """The front of a run and its samples. With a checkpoint that cannot be used, the run begins again."""
    kept = task.checkpoint if task.checkpoint and os.access(task.checkpoint.parent, os.W_OK | os.X_OK) and keeps(solver) else None
    while True:
        samples = Samples(task.evaluations, report, samples_path(kept) if kept else None)
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


def _simulated(task: Task, front: Front) -> SimulationRecord:
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
