"""What several commands are given: problems, JSON files, files that are to be written; a front is saved elsewhere if it cannot be saved
where it was to be, since nothing else has the result of its search."""

from __future__ import annotations

import json
import os
import re
import tempfile
import tomllib
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import problems
from macs.front import Front
from macs.fronts.provenance import ProblemSource
from macs.io.atomic import check_target, read_whole
from macs.solvers.start import STARTS
from problems.checks import unknown

from .answers import WrongCall, wrong_call_on_value_error

PICTURES = ("png", "pdf", "svg", "eps", "jpg", "jpeg", "ps", "svgz", "tif", "tiff", "webp")
WORD = re.compile(r"[A-Za-z_][\w./-]*")
"""A value that is text without quotes."""
PREFERENCE_BYTES = 2**20
"""Bytes that a JSON file of a preference may have."""


def load_problem(address: str, **data: Any) -> Any:
    """A problem by name or address; an error in the user's own file is one line."""
    try:
        problem = problems.load(address, **data)
        problem.compile()
    except ValueError as error:
        raise WrongCall(str(error)) from error
    except (Exception, SystemExit) as error:
        raise WrongCall(f"problem '{address}' does not load: {type(error).__name__}: {error}{_place(error, address)}") from error
    return problem


def problem_of(source: ProblemSource | None, address: str) -> Any:
    """The problem that the user names for a front or a dialogue: with the data of its own, if it is from a function of the same name."""
    same = source is not None and source.address.rpartition(":")[2] == address.rpartition(":")[2]
    return load_problem(address, **(dict(source.data) if source is not None and same else {}))


def read_data(words: Sequence[str]) -> dict[str, Any]:
    """Data of a problem: of each NAME=VALUE the name, and the value as in a TOML file, where words need no quotes."""
    found: dict[str, Any] = {}
    for word in words:
        name, equals, text = (part.strip() for part in word.partition("="))
        if not (equals and name.isidentifier() and text):
            raise WrongCall(f"--data {word}: write NAME=VALUE")
        if name in found:
            raise WrongCall(f"--data {word}: {name} is given twice")
        try:
            values = tomllib.loads(f"value = {text}")
        except tomllib.TOMLDecodeError:
            values = {"value": text} if WORD.fullmatch(text) else {}
        if list(values) != ["value"] or not isinstance(values["value"], int | float | str | list):
            raise WrongCall(f"--data {word}: the value is no number, text, true, false or list of these, as TOML writes them")
        found[name] = values["value"]
    return found


def find_start(word: str | None) -> Any:
    """First candidates: one of `STARTS`, or the points of a front's file."""
    if word is None or word in STARTS:
        return word
    if not Path(word).exists():
        raise WrongCall(f"{unknown('start', word, STARTS)}, or the file of a front")
    with wrong_call_on_value_error():
        return Front.load(word)


def _place(error: BaseException, address: str) -> str:
    """The line of the user's file in which an error arose; "" if there is none."""
    path = os.path.realpath(address.rpartition(":")[0])
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if os.path.realpath(frame.filename) == path]
    return f" (line {lines[-1]} of {Path(path).name})" if lines else ""


def read_json(path: str) -> Any:
    """The content of a JSON file. Raises ValueError, in one line, if it cannot be read, is no JSON, or no ordinary file."""
    try:
        return json.loads(read_whole(path, PREFERENCE_BYTES))
    except FileNotFoundError:
        raise ValueError(f"there is no file '{path}'") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError):
        raise ValueError(f"{path} is not JSON") from None


def same_file(first: str | Path, second: str | Path) -> bool:
    """Whether two paths lead to the same file, which need not exist. Links in a circle lead to themselves."""
    return os.path.realpath(first) == os.path.realpath(second)


def check_is_front(path: Path, option: str = "--out ") -> None:
    """Raise `WrongCall` if a file exists that is no front: it would be overwritten."""
    if not path.is_file() or not path.stat().st_size:
        return
    with path.open("rb") as file:
        known = file.read(4) == b"\x89HDF"
    if not known:
        raise WrongCall(f"{option}{path} would overwrite a file that is no front")


def check_picture(path: str | None) -> None:
    """Refuse a picture that could not be written, before any work."""
    if path:
        check_target(path)
        suffix = Path(path).suffix.lower().lstrip(".")
        if suffix not in PICTURES:
            raise WrongCall(f"cannot draw '{path}': a picture is one of .{', .'.join(PICTURES[:5])}")


def saved(front: Front, out: Path) -> tuple[Path | None, str]:
    """Save a front: where it is, and why that is not `out`, in one line: the disk may be full by now, or the folder gone or read-only. It
    then is in a new folder where temporary files are."""
    try:
        front.save(out)
        return out, ""
    except OSError as error:
        trouble = error.strerror or str(error)
    try:
        # A folder of its own: in a shared one, no other user can have put a link there that the front would be written through.
        place = Path(tempfile.mkdtemp(prefix="macs-")) / out.name
        front.save(place)
        return place, trouble
    except OSError as error:
        return None, f"{trouble}; nor can it be saved among temporary files ({error.strerror or error}): only its table is left"
