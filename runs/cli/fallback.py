"""The front of a search is saved elsewhere if it cannot be saved where it was to be: nothing else has the result."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from macs.front import Front


def saved(front: Front, out: Path) -> tuple[Path | None, str]:
    """Save a front: where it is, and why that is not `out`, in one line.

    The disk may be full by now, or the folder gone or read-only. The next places are a new folder in the temporary folder, in the working
    folder and at home.
    """
    try:
        front.save(out)
        return out, ""
    except OSError as error:
        trouble = error.strerror or str(error)
    tried = []
    for folder in _others():
        new = ""
        try:
            # A folder of its own: in a shared one, no other user can have put a link there that the front would be written through.
            new = tempfile.mkdtemp(prefix="macs-", dir=folder)
            front.save(Path(new) / out.name)
            return Path(new) / out.name, trouble
        except OSError:
            tried.append(f"'{folder}'")
            if new:
                shutil.rmtree(new, ignore_errors=True)
    return None, f"{trouble}; nor can it be saved in {', '.join(tried) or 'any other folder'}: only its table is left"


def _others() -> Iterator[str]:
    """Folders that may be on other disks, each once."""
    known = set()
    for find in (tempfile.gettempdir, os.getcwd, Path.home):
        with suppress(OSError, RuntimeError):  # no usable temporary folder, no home, or a working folder that is gone
            folder = os.path.realpath(find())
            if folder not in known:
                known.add(folder)
                yield folder
