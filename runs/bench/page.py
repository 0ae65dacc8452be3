"""The report of a benchmark as a page of measured results, and the files that state what it measures."""

from __future__ import annotations

import importlib
import shlex
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from macs.io.atomic import write_whole

from ..report.page_header import PageHeader, digest

PLACES = {"front": "fronts", "generation": "scale.generation"} | dict.fromkeys(("many", "uf", "zdt", "constrained"), "functions")
"""Modules that are not called as the benchmark."""
SHARED = ("cases", "measured")
"""Modules that several benchmarks have in common."""


def sources(kind: str) -> list[Path]:
    """The files of a benchmark's own module or folder, and those it shares, in a fixed order. The search itself is none of them: what is
    measured is stated here, and a page's version and date say of which search.

    Raises ValueError if there is no such benchmark.
    """
    try:
        found = importlib.import_module(f"{__package__}.{PLACES.get(kind, kind)}")
    except ModuleNotFoundError:
        raise ValueError(f"there is no benchmark '{kind}'") from None
    own = Path(found.__file__ or "")
    files = sorted(own.parent.glob("*.py")) if own.name == "__init__.py" else [own]
    return files + [Path(__file__).with_name(f"{name}.py") for name in SHARED]


@dataclass(frozen=True)
class Effort:
    """How much is measured, as options of the command."""

    quick: bool = False
    # Number of seeds, for the benchmarks that have them: 1, 2, ..., or on plain functions spawned as those of studies.
    seeds: int | None = None
    jobs: int = 1  # runs that are made at the same time, on plain functions
    keep: str | None = None  # folder of the runs on plain functions: those that are in it are not made again
    solvers: tuple[str, ...] = ()  # those that are compared on plain functions; all if there are none

    @property
    def words(self) -> list[str]:
        """The options that decide what is measured, but for defaults."""
        counts = {"--seeds": self.seeds, "--jobs": self.jobs if self.jobs > 1 else None}
        return [
            *(["--quick"] if self.quick else []),
            *(word for name, count in counts.items() if count for word in (name, str(count))),
            *(["--solvers", *self.solvers] if self.solvers else []),
        ]


def header_of(kind: str, effort: Effort, path: str | PathLike[str]) -> PageHeader:
    """The header of the page of a benchmark at a path. Raises ValueError if it cannot be written into a comment."""
    return PageHeader.now(shlex.join(["macs", "bench", kind, *effort.words, "--page", str(path)]), digest(*sources(kind)))


def write_page(path: str | PathLike[str], kind: str, header: PageHeader, report: str) -> None:
    """Write a Markdown page: the header, the command, and the report as it is printed."""
    text = f"{header}\n\n# `macs bench {kind}`\n\nMade by `{header.command}`.\n\n```text\n{report.rstrip()}\n```\n"
    write_whole(path, text.encode())
