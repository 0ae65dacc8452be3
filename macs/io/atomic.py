"""Files that are read within a limit, written whole or not at all, and sealed by a checksum at the end of their content.

The last 56 bytes of a sealed file are the mark, the length of the content before them (8 bytes, the lowest first) and the SHA-256 of
content and length. HDF5 and netCDF ignore what follows their own content, so sealed files open in other programs.
"""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from contextlib import suppress
from os import PathLike
from pathlib import Path
from uuid import uuid4


def read_whole(path: str | PathLike[str], limit: int) -> bytes:
    """The content of an ordinary file."""
    try:
        # Without O_NONBLOCK, opening a pipe would wait for its writer.
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0))) as file:
            found = os.fstat(file.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise OSError(errno.EINVAL, "it is no ordinary file")
            if found.st_size > limit:
                raise OSError(errno.EFBIG, f"it has {found.st_size} bytes, more than {limit}")
            return file.read(found.st_size)
    except ValueError as error:
        raise OSError(errno.EINVAL, str(error)) from error  # a name with a NUL character


def check_target(path: str | PathLike[str]) -> None:
    """Raise, before any work, the OSError that writing `path` would end in."""
    _target(path)


def write_whole(path: str | PathLike[str], content: bytes) -> None:
    """Replace a file by `content`, or raise OSError and leave everything as it was.

    A symbolic link stays, and the file that it leads to is replaced. A file that is replaced keeps its permissions, and its owner and group
    where the user may give files to them.
    """
    target, found = _target(path)
    temporary = target.with_name(f".{uuid4().hex}.part")
    try:
        with temporary.open("xb") as file:
            if found is not None:  # before there is anything in it that others might not read
                _made_alike(temporary, found)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
    except OSError as error:
        raise OSError(error.errno, f"cannot write '{path}': {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _made_alike(path: Path, other: os.stat_result) -> None:
    """Give a file owner, group and permissions of another."""
    if hasattr(os, "chown"):
        # Others than root may only give a file to a group of theirs.
        for owner in (other.st_uid, -1):
            with suppress(OSError):
                os.chown(path, owner, other.st_gid)
                break
    path.chmod(stat.S_IMODE(other.st_mode))  # last, as chown takes some of them away


def _target(path: str | PathLike[str]) -> tuple[Path, os.stat_result | None]:
    """The file that writing `path` replaces, and what it is; None if it does not exist yet."""
    found = None
    try:
        target = Path(os.path.realpath(path))
    except FileNotFoundError:
        raise FileNotFoundError(f"cannot write '{path}': the working folder is no longer there") from None
    except ValueError as error:
        raise OSError(errno.EINVAL, f"cannot write '{path}': {error}") from error  # a NUL character
    try:
        found = target.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:
        # A name that is too long or has a NUL character, or symbolic links in a circle.
        number = getattr(error, "errno", errno.EINVAL)
        circle = "its symbolic links lead in a circle" if number == errno.ELOOP else ""
        raise OSError(number, f"cannot write '{path}': {circle or getattr(error, 'strerror', None) or error}") from error
    if found is not None and stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(f"cannot write '{path}': it is a folder")
    if found is not None and not stat.S_ISREG(found.st_mode):
        raise OSError(f"cannot write '{path}': it is no ordinary file")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"cannot write '{path}': there is no folder '{target.parent}'")
    if found is not None and not os.access(target, os.W_OK):
        raise PermissionError(f"cannot write '{path}': the file is write-protected")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"cannot write '{path}': the folder '{target.parent}' is not writable")
    return target, found


MARK = b"\0MACS SHA-256\r\n\0"
SEAL = len(MARK) + 8 + 32
"""Bytes of a mark, a length and a digest."""


def sealed(content: bytes) -> bytes:
    """The content, with its seal."""
    length = len(content).to_bytes(8, "little")
    return b"".join([content, MARK, length, hashlib.sha256(content + length).digest()])


def unsealed(data: bytes) -> bytes | None:
    """The content without its seal; None if there is no mark in it."""
    if MARK not in data:
        return None
    content, seal = data[:-SEAL], data[-SEAL:]
    length = len(content).to_bytes(8, "little")
    if seal != MARK + length + hashlib.sha256(content + length).digest():
        raise ValueError("it is cut short or damaged: its content does not match its checksum")
    return content
