"""Pages of measured results in Markdown: a header with the command that made it and of what, and of a study its tables and some figures."""

from __future__ import annotations

import hashlib
import io
import os
import platform
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import date
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import macs
import problems
import transcription
from macs.fronts.provenance import versions
from macs.io.atomic import check_target, read_whole, write_whole
from macs.io.text import counted, duration

from ..batch.store import Store, StudySummary
from ..files import DATA_BYTES
from .published import with_count
from .tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CODE_DIGITS = 12
"""Of the digest of the code in a version."""
OPENS, CLOSES = "<!-- ", " -->"
"""Of a comment, which a page as it is shown does not have."""
NAMES = {"command": "made by", "digest": "digest", "version": "version", "date": "date"}
"""Word of each entry on the page."""


@dataclass(frozen=True)
class PageHeader:
    """The first lines of a page of measured results, a comment:

    <!-- made by: macs study report out/goddard-table3 --page docs/measured/goddard-table3.md digest: the SHA-256 of the files that state
    what is measured, see `digest` version: 0.1.0+c194b98fc0ea date: 2026-01-31 -->
    """

    command: str  # that makes the page
    digest: str  # of the study file, of the files of a bench, or of problems. The page is out of date once theirs is another.
    version: str  # of this package when the page was written, and the digest of its code, see `code`. Runs of a study may be of older code.
    date: str  # year-month-day

    def __post_init__(self) -> None:
        for name, word in NAMES.items():
            value = getattr(self, name)
            if not value.strip() or len(value.splitlines()) > 1 or ">" in value:
                raise ValueError(f"header of a page: '{word}' must be one line without '>', not {value!r}")

    @classmethod
    def now(cls, command: str, digest: str) -> PageHeader:
        """The header of a page that this command makes today, with the digest of what states it."""
        return cls(command, digest, version(), date.today().isoformat())

    @classmethod
    def read(cls, text: str) -> PageHeader:
        """The header of a page with this text. Raises ValueError if it begins with none."""
        lines = text.split(CLOSES, 1)[0].removeprefix(OPENS).splitlines() if text.startswith(OPENS) and CLOSES in text else []
        found = dict(line.split(": ", 1) for line in lines if ": " in line)
        if len(lines) != len(NAMES) or list(found) != list(NAMES.values()):
            raise ValueError(f"the page does not begin with a comment of {', '.join(NAMES.values())}")
        return cls(*(found[NAMES[one.name]] for one in fields(cls)))

    def __str__(self) -> str:
        return OPENS + "\n".join(f"{word}: {getattr(self, name)}" for name, word in NAMES.items()) + CLOSES


def digest(*files: str | PathLike[str], text: str = "") -> str:
    """The SHA-256, in hexadecimal digits, of a text and the content of files, one after the other. Raises OSError if one cannot be read."""
    found = hashlib.sha256(text.encode())
    for one in files:
        found.update(read_whole(Path(one), DATA_BYTES))
    return found.hexdigest()


def code() -> str:
    """The first 12 of a digest of the code that solves, of all floors but `runs`, and of the versions of the packages it uses."""
    files = [one for package in (problems, transcription, macs) for one in sorted(Path(package.__path__[0]).rglob("*.py"))]
    return digest(*files, text=f"{versions()}")[:CODE_DIGITS]


def version() -> str:
    """This package's version with the digest of its code, as a local version is written."""
    return f"{versions()['macs-trajectories']}+{code()}"


def standing(page: Path, digest_of: Callable[[str], str]) -> tuple[str, bool]:
    """The command of a page or what is wrong with it, and whether the page is as its command would make it now, by the digest.

    Results of other code than there is now are no fault, and are marked as such.
    """
    try:
        header = PageHeader.read(page.read_text(encoding="utf-8"))
        current = digest_of(header.command) == header.digest
    except (ValueError, OSError) as error:
        return str(error), False
    other = "" if header.version == version() else ", by other code"
    return f"{header.command}  ({header.date}{other}{'' if current else ', OUT OF DATE'})", current


def print_standing(pages: Iterable[Path], digest_of: Callable[[str], str]) -> bool:
    """Print a line for each page, see `standing`; returns whether all are as their commands would make them now."""
    found = {page.name: standing(page, digest_of) for page in sorted(pages)}
    for name, (words, _) in found.items():
        print(f"{name}: {words}")
    return all(good for _, good in found.values())


PICTURES = ("fronts", "hypervolume-over-charged-evaluations")
"""Ends of the names of the figures on a page."""


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
        different = [
            key for key, value in self._definition.items() if key not in ("cells", "objectives") and store.definition.get(key) != value
        ]
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
        folded = f"<details><summary>{one.caption or 'Table'}</summary>\n\n{text}\n</details>\n"
        self._parts.append(folded if len(one.rows) > 40 else text)

    def figure(self, name: str, figure: Figure) -> None:
        """Add a figure, if it is of those on pages."""
        if not name.endswith(PICTURES):
            return
        content = io.BytesIO()
        figure.savefig(content, format="png", dpi=100)
        file = f"{self.path.stem}-{re.sub(r'[^A-Za-z0-9-]+', '-', name)}.png"
        self._pictures[file] = content.getvalue()
        self._parts.append(f"![{name.replace('-', ' ')}]({file})\n")

    def save(self, summary: StudySummary, study: Mapping[str, Any]) -> list[Path]:
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
            *([f"{with_count(study['note'], study)}\n"] if study["note"] else []),
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
