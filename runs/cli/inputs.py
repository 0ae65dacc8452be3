"""What several commands are given: problems, JSON files, files that are to be written."""

from __future__ import annotations

import json
import os
import traceback
from pathlib import Path
from typing import Any

import problems
from macs.io.atomic import check_target, read_whole

from .answers import WrongCall

PICTURES = ("png", "pdf", "svg", "eps", "jpg", "jpeg", "ps", "svgz", "tif", "tiff", "webp")
LARGEST = 2**20
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


def _place(error: BaseException, address: str) -> str:
    """The line of the user's file in which an error arose; "" if there is none."""
    path = os.path.realpath(address.rpartition(":")[0])
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if os.path.realpath(frame.filename) == path]
    return f" (line {lines[-1]} of {Path(path).name})" if lines else ""


def read_json(path: str) -> Any:
    """The content of a JSON file. Raises ValueError, in one line, if it cannot be read, is no JSON, or no ordinary file."""
    try:
        return json.loads(read_whole(path, LARGEST))
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
