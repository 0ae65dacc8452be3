"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path
from uuid import uuid4


def check_target(path: str | PathLike[str]) -> None:
    """Raise, before any work, the OSError that writing `path` would end in: a missing or unwritable folder, a folder in its place."""
    target = Path(os.path.realpath(path))
    if target.is_symlink():
        raise OSError(f"cannot write '{path}': its symbolic links lead in a circle")
    if target.is_dir():
        raise IsADirectoryError(f"cannot write '{path}': it is a folder")
    if target.exists() and not target.is_file():
        raise OSError(f"cannot write '{path}': it is no ordinary file")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"cannot write '{path}': there is no folder '{target.parent}'")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"cannot write '{path}': the folder '{target.parent}' is not writable")


def write_whole(path: str | PathLike[str], content: bytes) -> None:
    """Replace a file by `content`, or raise OSError and leave everything as it was."""
    target = Path(path).resolve()
    temporary = target.with_name(f".{target.name[:60]}.{uuid4().hex}.part")
    try:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
    except OSError as error:
        raise OSError(error.errno, f"cannot write '{path}': {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)
