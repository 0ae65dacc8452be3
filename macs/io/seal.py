"""A checksum at the end of a file's content: which files are whole, and as they were written.

The last 56 bytes of a sealed file are the mark, the length of the content before them (8 bytes, the lowest first) and the SHA-256 of
content and length. HDF5 and netCDF ignore what follows their own content, so sealed files open in other programs.
"""

from __future__ import annotations

import hashlib

MARK = b"\0MACS SHA-256\r\n\0"
LENGTH, DIGEST = 8, 32
SIZE = len(MARK) + LENGTH + DIGEST


def sealed(content: bytes) -> bytes:
    """The content, with its seal."""
    length = len(content).to_bytes(LENGTH, "little")
    return b"".join([content, MARK, length, hashlib.sha256(content + length).digest()])


def unsealed(data: bytes) -> bytes | None:
    """The content without its seal; None if there is no mark in it.

    Raises
    ------
    ValueError
        If there is a mark, but content, length or checksum are not those that were written.
    """
    if MARK not in data:
        return None
    content, seal = data[:-SIZE], data[-SIZE:]
    length = len(content).to_bytes(LENGTH, "little")
    if seal != MARK + length + hashlib.sha256(content + length).digest():
        raise ValueError("it is cut short or damaged: its content does not match its checksum")
    return content
