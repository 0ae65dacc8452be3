"""A study's folder as it is seen while the study runs: the state of its runs, their points, and those of runs that have not ended."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from macs.front import Front
from problems.compiled import Objective

from ...batch.progress import Progress, read_progress
from ...batch.store import MISSING, StoredRun, Summary
from ...execution.samples import History
from ...execution.task import samples_path
from ...files import checked, read_record
from ...report.comparison import compared
from ..points import goals_data
from ..report import read_front
from ..study_page import failures_data, run_data
from .cached_store import CachedStore
from .measuring import Measuring
from .source import Resource, Source, Stamp, View, stamp_of

Key = tuple[str, int]
"""The folder of a cell, and the number of a run."""
STATES = ("finished", "running", "waiting", "failed")


@dataclass(frozen=True)
class Known:
    """A finished run as the page has it."""

    run: StoredRun
    front: Front
    data: msgspec.Raw


@dataclass(frozen=True)
class Sampled:
    """The last sample of a run that has not ended."""

    stamp: Stamp | None
    evaluations: int
    elapsed: float
    F: np.ndarray


class StudySource(Source):
    """A study's folder."""

    def __init__(self, folder: str | PathLike[str], trust: bool = False) -> None:
        self._store = CachedStore.open(folder, trust)
        self.title = str(self._store.definition["name"])
        self._known: dict[Key, Known] = {}
        self._sampled: dict[Key, Sampled] = {}
        self._goals: dict[str, list[dict[str, Any]]] = {}
        self._data: tuple[Any, Resource] | None = None
        self._measuring = Measuring()
        super().__init__()

    def resources(self) -> Mapping[str, Resource]:
        """The points, those of runs that have not ended, and the comparison of solvers."""
        return {**super().resources(), "measures": self._measuring.resource}

    def look(self) -> View:
        """See `Source`."""
        if not self._store.is_current:
            self._store = CachedStore.open(self._store.path, self._store.trust)
        store = self._store
        self.say("reading the state of the runs")
        summary, progress = store.summary(), read_progress(store.path)
        unreadable = self._read_fronts(summary)
        self._sampled = self._read_samples(summary, progress)
        if progress is not None:
            self._goals |= {label: [msgspec.to_builtins(goal) for goal in goals] for label, goals in progress.goals.items()}
        groups = compared(store)
        key = [*store.stamps.items()], unreadable, sorted(self._goals)
        if self._data is None or self._data[0] != key:
            self._data = key, Resource.of(self._data_of(summary, groups, unreadable))
        self._measuring.want(store, key, busy=progress is not None)
        resources = {"data": self._data[1], "going": Resource.of(self._going_data(groups))}
        status = status_data(summary, progress, self._sampled)
        return View(status, resources, {self._block(known.run): known.front for known in self._known.values()})

    def _read_fronts(self, summary: Summary) -> list[str]:
        """Read the fronts that are new; returns why others cannot be read now."""
        unreadable: list[str] = []
        here: set[Key] = set()
        for run in summary.runs:
            key = key_of(run)
            if not run.finished or ((known := self._known.get(key)) and known.run is run):
                here |= {key} if run.finished else set()
                continue
            try:
                front = _front_of(run)
            except (ValueError, OSError) as error:
                unreadable.append(f"Run {run.number} of {run.cell.name} cannot be read now: {' '.join(str(error).split())}")
                continue
            here.add(key)
            data = run_data(run, front, self._block(run)) | {"version": str(self._store.stamps[key])}
            self._known[key] = Known(run, front, msgspec.Raw(msgspec.json.encode(data)))
            self.say(f"reading runs: {len(here)} of {summary.finished}")
        self._known = {key: known for key, known in self._known.items() if key in here}
        return unreadable

    def _read_samples(self, summary: Summary, progress: Progress | None) -> dict[Key, Sampled]:
        """The runs that are being made, each with its last sample if it has one."""
        if progress is None:
            return {}
        told = {(one.folder, one.number): one for one in progress.going}
        found: dict[Key, Sampled] = {}
        for run in summary.runs:
            key, path = key_of(run), samples_path(run.path.with_suffix(".checkpoint"))
            stamp = None if run.finished else stamp_of(path)
            # On the workers of an executor only the samples show that a run is being made.
            if key not in told and (stamp is None or stamp.time < progress.began):
                continue
            before = self._sampled.get(key)
            last = before if before is not None and before.stamp == stamp else _last_sample(path, stamp)
            if key in told:
                last = replace(last, evaluations=told[key].evaluations, elapsed=told[key].elapsed)
            found[key] = last
        return found

    def _block(self, run: StoredRun) -> str:
        """The name of a run in addresses and in the page: the same as long as the study has the same cells."""
        return f"{self._store.cells.index(run.cell)}-{run.number}"

    def _data_of(self, summary: Summary, groups: Groups, unreadable: Sequence[str]) -> dict[str, Any]:
        """As `study_page` has it, but for the comparison of solvers."""
        shown = []
        for (problem, transcription), solvers in groups.items():
            runs = [known for ones in solvers.values() for run in ones if (known := self._known.get(key_of(run)))]
            if not runs and problem not in self._goals:
                continue
            goals = goals_data(runs[0].front.goals) if runs else self._goals[problem]
            source = runs[0].front.source if runs else None
            name = source.name if source is not None and ".py:" in problem else problem
            one = {"id": f"{problem}, {transcription}", "name": f"{name}, {transcription}", "goals": goals, "solvers": list(solvers)}
            shown.append({**one, "runs": [known.data for known in runs]})
        return {"title": summary.name, "kind": "study", "comparisons": shown, "failures": failures_data(summary), "unreadable": unreadable}

    def _going_data(self, groups: Groups) -> dict[str, Any]:
        """{comparison: points so far, of each run that is being made}, objectives as columns in the user's senses."""
        found: dict[str, Any] = {}
        for (problem, transcription), solvers in groups.items():
            runs = [run for ones in solvers.values() for run in ones]
            known = next((one.front.goals for run in runs if (one := self._known.get(key_of(run)))), None)
            goals = goals_data(known) if known else self._goals.get(problem, [])
            signs = np.array([Objective(**goal).sign for goal in goals])
            own = []
            for run in runs:
                sampled = self._sampled.get(key_of(run))
                if sampled is None or sampled.F.ndim != 2 or sampled.F.shape[1] != len(signs):
                    continue
                own.append({"solver": run.cell.solver, "number": run.number, "objectives": (sampled.F * signs).T.tolist()})
            found[f"{problem}, {transcription}"] = own
        return found


Groups = Mapping[tuple[str, str], Mapping[str, Sequence[StoredRun]]]


def key_of(run: StoredRun) -> Key:
    """What names a run in the study's folder."""
    return run.cell.folder, run.number


def _front_of(run: StoredRun) -> Front:
    """The front of a run as data: where its problem is not trusted, it cannot be simulated, but shown."""
    try:
        return run.front
    except ValueError:
        return read_front(run.path)


def _last_sample(path: Path, stamp: Stamp | None) -> Sampled:
    """The last sample in a file; one without points if there is none that can be read."""
    nothing = Sampled(stamp, 0, 0.0, np.empty((0, 0)))
    if stamp is None:
        return nothing
    try:
        columns = checked(read_record(path), History)
        return Sampled(stamp, columns["evaluations"][-1], columns["elapsed"][-1], np.array(columns["F"][-1], dtype=float))
    except (OSError, ValueError, LookupError):
        return nothing  # it is replaced, or deleted as the run has ended: the next look shows


def status_data(summary: Summary, progress: Progress | None, going: Mapping[Key, Sampled]) -> dict[str, Any]:
    """How many runs of each cell there are in which state, and the runs that are being made."""
    cells = []
    for cell, runs in summary.cells.items():
        states = Counter(_state(run, going) for run in runs)
        times = [run.wall_time for run in runs if run.finished and run.wall_time]
        time = float(np.median(times)) if times else None
        cells.append({"labels": list(cell.labels), "runs": len(runs), **{state: states[state] for state in STATES}, "time": time})
    made = [
        {
            "name": f"{run.cell.name}, run {run.number}",
            "evaluations": going[key_of(run)].evaluations,
            "budget": run.cell.evaluations,
            "elapsed": going[key_of(run)].elapsed,
        }
        for run in sorted(summary.runs, key=lambda run: (run.number, run.cell.name))
        if key_of(run) in going
    ]
    return {
        "total": len(summary.runs),
        **{state: sum(cell[state] for cell in cells) for state in STATES},
        "alive": progress is not None,
        "elapsed": None if progress is None else progress.elapsed,
        "left": None if progress is None else progress.left,
        "cells": cells,
        "going": made,
    }


def _state(run: StoredRun, going: Mapping[Key, Sampled]) -> str:
    if run.finished:
        return "finished"
    if key_of(run) in going:
        return "running"
    return "waiting" if run.status == MISSING else "failed"
