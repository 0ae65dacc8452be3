"""`macs report`: the page of a front's file or a study's folder, written to a file."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from macs.front import Front
from macs.io.atomic import check_target, write_whole

from ..batch.store import Store
from .front_page import front_page
from .page import plotly
from .study_page import study_page


def write_page(source: str | PathLike[str], out: str | PathLike[str], *, trust: bool = False, progress: bool = False) -> Path:
    """Write the page of a front or a study to one file, whole."""
    plotly()
    check_target(out)
    content = study_page(Store.open(source, trust), progress) if Path(source).is_dir() else front_page(read_front(source))
    write_whole(out, content)
    return Path(out)


def read_front(path: str | PathLike[str]) -> Front:
    """A front from a file, as data: its problem is not loaded. Raises ValueError if there is none."""
    try:
        return Front.load(path)
    except FileNotFoundError:
        raise ValueError(f"there is no file or folder '{path}'") from None
