"""Samples of a run: its archive at some counts, stored beside its checkpoint so that a resumed run has its whole history."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypedDict

from macs.io.atomic import write_whole
from macs.search.rounds import PLANNED

from ..files import checked, read_record, to_record

COUNTS = ("evaluations", "inner_iterations", "gradient_solves", "work", "gradient_work")
NUMBER = 30
"""Largest number of samples, evenly spaced in evaluations, besides the one at the end."""
EVERY = 0.25
"""Seconds between reports."""

log = logging.getLogger(__name__)

Report = Callable[[int, float], Any]
"""Called at intervals with the evaluations and seconds so far."""


class History(TypedDict, total=False):
    """How a run converged, by columns with an entry for each sample; empty if it is not known.

    Keys are its costs so far, "elapsed" seconds, and "F": the objectives (k, m) of its archive, all minimised.
    """

    evaluations: list[int]
    inner_iterations: list[int]
    gradient_solves: list[int]
    work: list[int]
    gradient_work: list[int]
    elapsed: list[float]
    F: list[list[list[float]]]


class Samples:
    """Samples of the archive at some counts, and reports of the progress at intervals."""

    def __init__(self, budget: int | None, report: Report | None = None, path: Path | None = None) -> None:
        self._step, self._next, self._report, self._told, self._path = max(1, (budget or PLANNED) // NUMBER), 0, report, 0.0, path
        self.columns: dict[str, list[Any]] = {key: [] for key in History.__annotations__}
        self._before, self._behind = _read(path), False

    def note(self, progress: Any) -> None:
        """To be called after every iteration."""
        self._take_up(progress.evaluations)
        if progress.evaluations >= self._next:
            self._next = (progress.evaluations // self._step + 1) * self._step
            self.add(vars(progress), progress.elapsed, progress.F)
            self._behind = self._path is not None
        if self._behind:
            self._write()
        if self._report is not None and progress.elapsed - self._told >= EVERY:
            self._told = progress.elapsed
            self._report(progress.evaluations, progress.elapsed)

    def add(self, counts: Any, elapsed: float, F: Any) -> None:
        """Add a sample."""
        self._take_up(counts["evaluations"] + 1)
        for key in COUNTS:
            self.columns[key].append(int(counts.get(key, 0)))
        self.columns["elapsed"].append(float(elapsed))
        self.columns["F"].append(F.tolist())

    def _take_up(self, evaluations: int) -> None:
        """Take over, at the first call, the stored samples before this count."""
        if self._before is None:
            return
        count = sum(before < evaluations for before in self._before["evaluations"])
        self.columns, self._before = {key: self._before[key][:count] for key in self.columns}, None
        if count:
            self._next = (self.columns["evaluations"][-1] // self._step + 1) * self._step

    def _write(self) -> None:
        assert self._path is not None
        try:
            write_whole(self._path, to_record(self.columns))
            self._behind = False
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
