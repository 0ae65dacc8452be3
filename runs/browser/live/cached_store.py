"""A study's folder whose runs are read again only once their files have changed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...batch.cells import Cell
from ...batch.store import Store, StoredRun
from .source import Stamp, stamp_of


class CachedStore(Store):
    """As `Store`; the same run is the same object as long as its front and its record are the same files."""

    def __init__(self, path: Path, definition: Mapping[str, Any], trust: bool = False) -> None:
        super().__init__(path, definition, trust)
        self.stamps: dict[tuple[str, int], tuple[Stamp | None, Stamp | None]] = {}
        self._runs: dict[tuple[str, int], StoredRun] = {}
        self._definition_stamp = stamp_of(path / "study.json")

    @property
    def is_current(self) -> bool:
        """Whether the definition of the study has not been written again, as for more runs."""
        return self._definition_stamp == stamp_of(self.path / "study.json")

    def run(self, cell: Cell, number: int) -> StoredRun:
        """One run."""
        key, front = (cell.folder, number), self.path / cell.folder / f"{number:04d}.nc"
        # Taken before the files are read: what changes meanwhile is read again.
        stamps = stamp_of(front), stamp_of(front.with_suffix(".json"))
        if self.stamps.get(key) != stamps or key not in self._runs:
            self._runs[key] = super().run(cell, number)
            self.stamps[key] = stamps
        return self._runs[key]
