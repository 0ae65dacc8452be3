"""One front's file, or a folder of fronts, as it is seen while files are written."""

from __future__ import annotations

import hashlib
from os import PathLike
from pathlib import Path
from typing import Any

from macs.front import Front

from ..points import about, columns, goals_data
from ..report import read_front
from .source import Resource, Source, Stamp, View, stamp_of

SUFFIX = ".nc"


class FrontsSource(Source):
    """One front, or all fronts of a folder, compared where they are of the same problem."""

    def __init__(self, path: str | PathLike[str]) -> None:
        self._path, self.title = Path(path), Path(path).resolve().name
        self._single = not self._path.is_dir()
        self._known: dict[Path, tuple[Stamp | None, Front]] = {}
        if self._single:
            read_front(self._path)
        elif not self._files():
            raise ValueError(f"'{path}' contains neither a study (study.json) nor a front (*{SUFFIX})")
        super().__init__()

    def look(self) -> View:
        """See `Source`."""
        known: dict[Path, tuple[Stamp | None, Front]] = {}
        unreadable = []
        for path in self._files():
            stamp = stamp_of(path)
            before = self._known.get(path)
            try:
                known[path] = before if before is not None and before[0] == stamp else (stamp, read_front(path))
            except (ValueError, OSError) as error:
                if self._single:
                    raise
                unreadable.append(f"{path.name} cannot be read now: {' '.join(str(error).split())}")
        self._known = known
        groups: dict[Any, dict[Path, Front]] = {}
        for path, (_, front) in known.items():
            name = front.source.name if front.source is not None else "black box"
            groups.setdefault((name, tuple(front.goals)), {})[path] = front
        shown = [self._comparison(name, own) for (name, _), own in groups.items()]
        title = shown[0]["name"] if self._single else self.title
        data = {"title": title, "kind": "front" if self._single else "fronts", "comparisons": shown, "unreadable": unreadable}
        return View({}, {"data": Resource.of(data)}, {_block(path): front for path, (_, front) in known.items()})

    def _files(self) -> list[Path]:
        if self._single:
            return [self._path]
        return sorted(path for path in self._path.iterdir() if path.suffix == SUFFIX and not path.name.startswith("."))

    def _comparison(self, name: str, fronts: dict[Path, Front]) -> dict[str, Any]:
        """As `front_page` has it; of a folder with the names of the files in place of solvers."""
        goals = next(iter(fronts.values())).goals
        labels = {path: (str(front.solver.get("name", "")) or "points") if self._single else path.stem for path, front in fronts.items()}
        runs = [
            {
                "solver": labels[path],
                "number": 1,
                "block": _block(path),
                "version": str(self._known[path][0]),
                "points": columns(front),
                "about": about(front),
            }
            for path, front in fronts.items()
        ]
        ids = f"{name}, {', '.join(goal.name for goal in goals)}"
        return {"id": ids, "name": name, "goals": goals_data(goals), "solvers": list(labels.values()), "runs": runs}


def _block(path: Path) -> str:
    """The name of a front in addresses: of letters that say nothing of its path."""
    return hashlib.sha256(path.name.encode()).hexdigest()[:16]
