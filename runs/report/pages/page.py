"""A report as a page in Markdown: its tables and some figures, and the command, versions, machine and date that made them."""

from __future__ import annotations

import io
import os
import platform
import re
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.fronts.provenance import versions
from macs.io.atomic import check_target, write_whole
from macs.io.text import counted, duration

from ...batch.store import Store, Summary
from ..page_header import PageHeader, digest
from ..tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = ("fronts", "hypervolume-over-charged-evaluations", "choices", "goal", "dispersions")
"""Ends, or beginnings, of the names of the figures on a page."""
LONG = 40
"""Rows from which on a table is folded."""
DOTS = 100
"""Dots per inch of a picture."""


class Page:
    """A page of a study, and its pictures beside it: NAME.md and NAME-FIGURE.png."""

    def __init__(self, path: str | PathLike[str], command: str, file: str | PathLike[str], definition: Mapping[str, Any]) -> None:
        self.path = Path(path)
        if self.path.suffix != ".md":
            raise ValueError(f"a page is a file .md, not '{path}'")
        check_target(self.path)
        self._header, self._definition = PageHeader.now(command, digest(file)), dict(definition)
        self._parts: list[str] = []
        self._pictures: dict[str, bytes] = {}

    def check(self, store: Store) -> None:
        """Raise ValueError unless a folder has all runs of the study as its file states it now."""
        store.check(self._definition)
        different = [key for key, value in self._definition.items() if key != "cells" and store.definition.get(key) != value]
        if different:
            raise ValueError(
                f"page: {', '.join(different)} of the study changed after its last run; `macs study run` again takes them over, "
                "and makes only runs that are missing"
            )
        left = [run for run in store.runs() if not run.finished]
        if left:
            raise ValueError(f"page: {counted(len(left), 'run')} of '{store.path}' not finished; a page has all of them")

    def heading(self, title: str, lines: Sequence[str]) -> None:
        """Begin a part."""
        self._parts += [f"## {title}\n", *(f"{line}\n" for line in lines)]

    def table(self, one: Table) -> None:
        """Add a table; a long one is folded."""
        text = one.markdown()
        long = len(one.rows) > LONG
        self._parts.append(f"<details><summary>{one.caption or 'Table'}</summary>\n\n{text}\n</details>\n" if long else text)

    def figure(self, name: str, figure: Figure) -> None:
        """Add a figure, if it is of those on pages."""
        if not any(name.endswith(one) or name.startswith(one) for one in PICTURES):
            return
        content = io.BytesIO()
        figure.savefig(content, format="png", dpi=DOTS)
        file = f"{self.path.stem}-{re.sub(r'[^A-Za-z0-9-]+', '-', name)}.png"
        self._pictures[file] = content.getvalue()
        self._parts.append(f"![{name.replace('-', ' ')}]({file})\n")

    def save(self, summary: Summary, study: Mapping[str, Any]) -> list[Path]:
        """Write the page and its pictures; returns their paths."""
        times = [run.wall_time for run in summary.runs]
        first = summary.runs[0].front.stats["versions"]
        what = ", ".join(f"{name} {number}" for name, number in (first or versions()).items() if name != "platform")
        made = (
            f"{counted(len(times), 'run')}, {duration(float(np.sum(times)))} together, {duration(float(np.median(times)))} in the median, "
            f"on {_machine()}. Seeds are spawned from {study['seed']}. Page made on {self._header.date} by `{self._header.command}`. "
            f"Versions: {what}."
        )
        texts = [
            str(self._header),
            f"\n# {study['name']}\n",
            f"{study['description']}\n",
            *([f"{study['note']}\n"] if study["note"] else []),
        ]
        text = "\n".join([*texts, f"{made}\n", *self._parts])
        folder = self.path.parent
        written = {self.path: text.encode(), **{folder / name: content for name, content in self._pictures.items()}}
        for path, content in written.items():
            write_whole(path, content)
        return list(written)


def _machine() -> str:
    """The machine in words: its processor, their number and its system."""
    name = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():  # on Linux alone
        names = [line.partition(":")[2].strip() for line in information.read_text().splitlines() if line.startswith("model name")]
        name = names[0] if names else name
    return f"{counted(os.cpu_count() or 1, 'processor')} ({name}), {platform.system()}"
