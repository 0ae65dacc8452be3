"""Pages of measured results in Markdown: a header with the command that made it and of what, and of a study its tables and some figures."""

from __future__ import annotations

import hashlib
import io
import json
import os
import platform
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import date
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from macs.fronts.provenance import versions
from macs.io.atomic import check_target, read_whole, write_whole
from macs.io.text import counted, duration

from ..batch.code import SEVERAL, UNKNOWN, Code, changed, code_of_measures, digest_of_file, merged, rooms
from ..batch.store import Store, StudySummary
from ..files import DATA_BYTES
from .comparison_tables import medians_table, runs_table
from .published import with_count
from .tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .comparison import Comparison

OPENS, CLOSES = "<!-- ", " -->"
"""Of a comment, which a page as it is shown does not have."""
NAMES = {"command": "made by", "digest": "digest", "code": "code", "version": "version", "date": "date"}
"""Word of each entry on the page. A page need not have one of its code."""


@dataclass(frozen=True)
class PageHeader:
    """The first lines of a page of measured results, a comment:
    <!-- made by: macs study report out/goddard-table3 --page docs/measured/goddard-table3.md digest: the SHA-256 of what
    states it code: macs.search 0a1b2c3d, problems 4e5f6071 version: 0.1.0 date: 2026-01-31 -->
    """

    command: str  # that makes the page
    digest: str  # digest, code: The page is out of date once they are others. Of a study but its words, or of the code of a benchmark
    version: str  # of this package
    date: str  # year-month-day
    code: str = ""  # that made its results: the folders of modules that they depend on, each with a digest, see `batch.code`

    def __post_init__(self) -> None:
        for name, word in NAMES.items():
            value = getattr(self, name)
            if (not value.strip() and name != "code") or len(value.splitlines()) > 1 or ">" in value:
                raise ValueError(f"header of a page: '{word}' must be one line without '>', not {value!r}")

    @classmethod
    def now(cls, command: str, digest: str, code: Code) -> PageHeader:
        """The header of a page that this command makes today, with the digest of what states it and the code that made its results."""
        written = ", ".join(f"{room} {digest}" for room, digest in rooms(code).items())
        return cls(command, digest, versions()["macs-trajectories"], date.today().isoformat(), written)

    @classmethod
    def read(cls, text: str) -> PageHeader:
        """The header of a page with this text. Raises ValueError if it begins with none."""
        lines = text.split(CLOSES, 1)[0].removeprefix(OPENS).splitlines() if text.startswith(OPENS) and CLOSES in text else []
        found = dict(line.split(": ", 1) for line in lines if ": " in line)
        if len(lines) != len(found) or list(found) != [word for word in NAMES.values() if word in found or word != NAMES["code"]]:
            raise ValueError(f"the page does not begin with a comment of {', '.join(NAMES.values())}")
        return cls(*(found.get(NAMES[one.name], "") for one in fields(cls)))

    def __str__(self) -> str:
        found = {word: getattr(self, name) for name, word in NAMES.items()}
        return OPENS + "\n".join(f"{word}: {value}" for word, value in found.items() if value) + CLOSES

    def different(self, digest: str, code: Code) -> list[str]:
        """What is another now than when the page was made: what states it, and folders of code."""
        old = dict(one.split(" ") for one in self.code.split(", ")) if self.code else {}
        return [
            *(["what states it"] if digest != self.digest else []),
            *(changed(old, rooms(code)) if old else ["unknown code"] * bool(code)),
        ]


def digest(text: str) -> str:
    """The SHA-256 of a text, in hexadecimal digits."""
    return hashlib.sha256(text.encode()).hexdigest()


def digest_of_bench(files: Iterable[Path]) -> str:
    """The digest of the code of files."""
    return digest(" ".join(map(digest_of_file, files)))


def digest_of_study(file: str | PathLike[str]) -> str:
    """The digest of a study file without its words, which change no number. Raises OSError or ValueError if it cannot be read."""
    stated = tomllib.loads(read_whole(Path(file), DATA_BYTES).decode())
    for section in (stated, *stated.get("paper", [])):
        for word in ("description", "note", "source", "differs"):
            section.pop(word, None)
    stated["pictures"] = sorted(stated.get("pictures", {}))
    return digest(json.dumps(stated, sort_keys=True, default=str))


Now = Callable[[str], tuple[str, Code]]
"""The digest of what states a page and the code that it depends on, as they are now, from its command; ValueError if there is no such."""


def standing(page: Path, now: Now) -> tuple[str, bool]:
    """The command of a page or what is wrong with it, and whether the page is as its command would make it now."""
    try:
        header = PageHeader.read(page.read_text(encoding="utf-8"))
        different = header.different(*now(header.command))
    except (ValueError, OSError) as error:
        return str(error), False
    return f"{header.command}  ({header.date}{', OUT OF DATE: ' if different else ''}{', '.join(different)})", not different


def print_standing(pages: Iterable[Path], now: Now) -> bool:
    """Print a line for each page, see `standing`; returns whether all are as their commands would make them now."""
    found = {page.name: standing(page, now) for page in sorted(pages)}
    for name, (words, _) in found.items():
        print(f"{name}: {words}")
    return all(good for _, good in found.values())


PICTURES = {"fronts": "", "hypervolume-over-charged-evaluations": ""}
"""Figures of a page by the ends of their names, and the words below each, unless its study states them."""


class Page:
    """A page of a study, and its pictures beside it: NAME.md and NAME-FIGURE.png."""

    def __init__(self, path: str | PathLike[str], command: str, file: str | PathLike[str], definition: Mapping[str, Any]) -> None:
        self.path = Path(path)
        if self.path.suffix != ".md":
            raise ValueError(f"a page is a file .md, not '{path}'")
        check_target(self.path)
        self._command, self._digest, self._definition = command, digest_of_study(file), dict(definition)
        self._first: list[str] = []
        self._parts: list[str] = []
        self._folded: list[str] = []
        self._data = b""
        self._words, self._unused = definition["pictures"] or PICTURES, set(definition["pictures"])
        self._pictures: dict[str, bytes] = {}

    def check(self, store: Store) -> None:
        """Raise ValueError unless a folder has all runs of the study as its file states it now."""
        store.check(self._definition)
        others = {key: value for key, value in self._definition.items() if key not in ("cells", "objectives", "pictures")}
        different = [key for key, value in others.items() if store.definition.get(key) != value]
        if different:
            raise ValueError(
                f"page: {', '.join(different)} of the study changed after its last run; `macs study run` again takes them over, "
                "and makes only runs that are missing"
            )
        left = [run for run in store.runs() if not run.finished]
        if left:
            raise ValueError(f"page: {counted(len(left), 'run')} of '{store.path}' not finished; a page has all of them")

    def measured(self, found: Sequence[Comparison]) -> None:
        """Add the medians of all runs to what comes first; the data beside the page are a row for each run."""
        runs = runs_table(found)
        self._data = runs.csv().encode()
        self._first.append(medians_table(runs).markdown())

    def heading(self, title: str, lines: Sequence[str]) -> None:
        """Begin a part; what is folded stands below the figures of the one before."""
        self._parts += [*self._folded, f"## {title}\n", *(f"{line}\n" for line in lines)]
        self._folded.clear()

    def table(self, one: Table, first: bool = False) -> None:
        """Add a table, to what comes first or where it is; there a long one is folded."""
        text, folded = one.markdown(), len(one.rows) > 12 and not first
        place = self._first if first else self._folded if folded else self._parts
        place.append(f"<details><summary>{one.caption or 'Table'}</summary>\n\n{text}\n</details>\n" if folded else text)

    def figure(self, name: str, figure: Figure) -> None:
        """Add a figure and the words of the longest end of its name, if it is of those on the page."""
        from PIL import Image

        end = max((one for one in self._words if f"-{name}".endswith(f"-{one}")), key=len, default=None)
        if end is None:
            return
        drawn, content = io.BytesIO(), io.BytesIO()
        self._unused.discard(end)
        figure.savefig(drawn, format="png", dpi=120)  # enough for one as wide as the page
        Image.open(drawn).convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE).save(content, format="png", optimize=True)
        file = f"{self.path.stem}-{re.sub(r'[^A-Za-z0-9-]+', '-', name)}.png"
        self._pictures[file] = content.getvalue()
        self._parts += [f"![{name.replace('-', ' ')}]({file})\n", *([f"{self._words[end]}\n"] if self._words[end] else [])]

    def save(self, summary: StudySummary, study: Mapping[str, Any]) -> list[Path]:
        """Write the page and its pictures; returns their paths. Raises ValueError if its report has no picture that the study states."""
        if self._unused:
            raise ValueError(f"page: the report has no figure whose name ends with {', '.join(sorted(self._unused))}")
        times = [run.wall_time for run in summary.runs]
        of_processor = sum(run.history["cpu"][-1] for run in summary.runs if run.history.get("cpu"))
        code = merged(run.code for run in summary.runs)
        header = PageHeader.now(self._command, self._digest, {**code, **code_of_measures()})
        first = summary.runs[0].front.stats["versions"]
        what = ", ".join(f"{name} {number}" for name, number in (first or versions()).items() if name != "platform")
        made = (
            f"{counted(len(times), 'run')}, {duration(float(np.sum(times)))} together, {duration(float(np.median(times)))} in the median, "
            f"{duration(of_processor)} of a processor, on {_machine()}. Seeds are spawned from {study['seed']}. "
            f"Page made on {header.date} by `{header.command}`. "
            f"Versions: {what}.{_of_several(code)}"
        )
        texts = [
            str(header),
            f"\n# {study['name']}\n",
            f"{study['description']}\n",
            *([f"{with_count(study['note'], study)}\n"] if study["note"] else []),
        ]
        text = "\n".join([*texts, *self._first, f"{made} Data of all runs: [CSV]({self.path.stem}.csv).\n", *self._parts, *self._folded])
        folder = self.path.parent
        written = {self.path: text.encode(), **{folder / name: content for name, content in self._pictures.items()}}
        written[self.path.with_suffix(".csv")] = self._data
        for path, content in written.items():
            write_whole(path, content)
        return list(written)


def _of_several(code: Code) -> str:
    """A sentence on runs by more than one code, which may not be known; empty if there are none."""
    names = ", ".join(module for module, digest in code.items() if SEVERAL in digest or module == UNKNOWN)
    return f" **Runs are by more than one code**, which differs in {names}." if names else ""


def _machine() -> str:
    """The machine in words: its processor, their number and its system."""
    information = Path("/proc/cpuinfo")  # on Linux alone
    lines = information.read_text().splitlines() if information.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")] or [platform.processor()]
    return f"{counted(os.cpu_count() or 1, 'processor')} ({names[0] or platform.machine()}), {platform.system()}"
