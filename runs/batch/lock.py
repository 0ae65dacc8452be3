"""One process at a time: a lock on a file, which its owner's death releases, however it comes."""

from __future__ import annotations

import errno
import logging
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

log = logging.getLogger(__name__)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock on a file, made if it is not there.

    Where neither the platform nor the file system knows locks, nothing is held, and the log says so.

    Raises
    ------
    ValueError
        If another process holds it; the message says which.
    OSError
        If the file cannot be made.
    """
    with path.open("a+", encoding="utf-8") as file:
        try:
            _lock(file.fileno())
        except BlockingIOError:
            file.seek(0)
            who = file.read(200).strip()
            raise ValueError(f"'{path.parent}' is being written by another process{f', {who}' if who else ''}") from None
        except OSError as error:
            if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL):
                raise
            log.warning("'%s' cannot be locked (%s): let no other process run this study", path.parent, error)
        # Only for people; a full disk is no reason not to go on.
        with suppress(OSError):
            file.truncate(0)
            file.write(f"{os.getpid()} on {socket.gethostname()}\n")
            file.flush()
        yield


def _lock(descriptor: int) -> None:
    """Take the lock or raise BlockingIOError. On a platform without fcntl, Windows' own."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        try:
            # Far beyond what is written there, which others may then read.
            os.lseek(descriptor, 1 << 20, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except PermissionError as error:
            raise BlockingIOError(*error.args) from error
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
