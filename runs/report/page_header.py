"""Header of a page of measured results: the command that made it, and of what content, version and date."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from datetime import date
from os import PathLike
from pathlib import Path

import macs
import problems
import transcription
from macs.fronts.provenance import versions
from macs.io.atomic import read_whole

DIGITS = 12
"""Of the digest of the code."""
LARGEST = 2**24
"""Bytes that a file may have of which a digest is made."""
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
        found.update(read_whole(Path(one), LARGEST))
    return found.hexdigest()


def code() -> str:
    """The first `DIGITS` of a digest of the code that solves, of all floors but `runs`, and of the versions of the packages it uses."""
    files = [one for package in (problems, transcription, macs) for one in sorted(Path(package.__path__[0]).rglob("*.py"))]
    return digest(*files, text=f"{versions()}")[:DIGITS]


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
