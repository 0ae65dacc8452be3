"""Lock of a study's folder between processes, released by the operating system when its process ends."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """A context in which no other process has the lock on a file, which is made if it does not exist.

    Raises
    ------
    ValueError
        Another process has it; the message names the process.
    OSError
        The file cannot be made.
    """
    lock, owner = FileLock(path), path.with_name(f"{path.name}.owner")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        by = f", {owner.read_text(encoding='utf-8')}" if owner.exists() else ""
        raise ValueError(f"'{path.parent}' is being written by another process{by}") from None
    try:
        # In a file of its own, which can be read while the lock is taken. It is for the message alone, so a full disk is no error.
        with suppress(OSError):
            owner.write_text(f"{os.getpid()} on {socket.gethostname()}", encoding="utf-8")
        yield
    finally:
        lock.release()
