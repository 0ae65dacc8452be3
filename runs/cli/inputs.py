"""What several commands are given: problems, files that are to be written."""

from __future__ import annotations

import traceback
from pathlib import Path
from typing import Any

import problems
from macs.io.atomic import check_target

from .answers import WrongCall

PICTURES = ("png", "pdf", "svg", "eps", "jpg", "jpeg", "ps", "svgz", "tif", "tiff", "webp")


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
    path = Path(address.rpartition(":")[0]).resolve()
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename).resolve() == path]
    return f" (line {lines[-1]} of {path.name})" if lines else ""


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
