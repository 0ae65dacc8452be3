"""The file format of a checkpoint: a first line with the version and a checksum, then an npz archive of arrays and one JSON document.

The first line is `MACS checkpoint 2: N bytes, sha256 H`; N and H are those of the archive that follows. So a file that was damaged is
refused before any of it is unpacked. Of a file that was forged, no array is allocated before its size is known to be that of its bytes.
Nothing in a file is pickled.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
import stat
import zipfile
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

VERSION = 6
FIRST_LINE = re.compile(rb"MACS checkpoint (\d{1,9}): (\d{1,18}) bytes, sha256 ([0-9a-f]{64})\n")
LONGEST_LINE = 200
LARGEST = 2**32
"""Bytes that the archive of a file may have."""
DOCUMENT = "document"
"""The member of the archive that is JSON, as an array of bytes."""


def to_bytes(document: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> bytes:
    """The content of a file with a document (what JSON knows, infinities and NaN included) and named arrays, none of objects."""
    buffer = io.BytesIO()
    members: dict[str, Any] = {DOCUMENT: np.frombuffer(json.dumps(document).encode(), dtype=np.uint8), **arrays}
    np.savez(buffer, **members)
    archive = buffer.getvalue()
    return f"MACS checkpoint {VERSION}: {len(archive)} bytes, sha256 {hashlib.sha256(archive).hexdigest()}\n".encode() + archive


def read(path: str | PathLike[str]) -> tuple[Any, dict[str, np.ndarray]]:
    """The document and the arrays of a file, checked against its checksum."""
    if not stat.S_ISREG(Path(path).stat().st_mode):
        raise ValueError("is no ordinary file")  # reading a device or a pipe may never end
    with Path(path).open("rb") as file:
        line = file.readline(LONGEST_LINE)
        head = FIRST_LINE.fullmatch(line)
        if head is None and line.startswith(b"MACS checkpoint"):
            raise ValueError("is damaged: its first line is not that of a checkpoint")
        if head is None:
            raise ValueError(f"is no checkpoint: {'it is a file of something else, or of an older MACS' if line else 'it is empty'}")
        version, size, checksum = int(head[1]), int(head[2]), head[3].decode()
        if version != VERSION:
            raise ValueError(f"is a checkpoint of version {version}; this MACS reads version {VERSION}")
        found = Path(path).stat().st_size - len(line)
        if found != size:
            raise ValueError(f"is damaged: it should have {size} bytes after its first line, but has {found}")
        if size > LARGEST:
            raise ValueError(f"is no valid checkpoint: it has {size} bytes, more than {LARGEST}")
        archive = file.read(size)
    if hashlib.sha256(archive).hexdigest() != checksum:
        raise ValueError("is damaged: its content does not match its checksum")
    return _from_archive(archive)


def _from_archive(archive: bytes) -> tuple[Any, dict[str, np.ndarray]]:
    arrays = {name.removesuffix(".npy"): _array(name, content) for name, content in _members(archive).items()}
    if DOCUMENT not in arrays:
        raise ValueError("is no valid checkpoint: it has no document")
    try:
        return json.loads(arrays.pop(DOCUMENT).tobytes()), arrays
    except (ValueError, RecursionError) as error:
        raise ValueError(f"is no valid checkpoint: its document is no JSON ({error})") from error


def _members(archive: bytes) -> dict[str, bytes]:
    """The members of a zip archive, which have to be stored as they are: then none is larger than the archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(archive)) as file:
            infos = file.infolist()
            stored = all(info.compress_type == zipfile.ZIP_STORED for info in infos)
            if not stored or sum(info.file_size for info in infos) > len(archive):
                raise ValueError("its members are compressed, or overlap")
            return {info.filename: file.read(info) for info in infos}
    except Exception as error:  # zipfile raises errors of many classes; whichever it is, the archive is not one that `to_bytes` wrote
        raise ValueError(f"is no valid checkpoint: its archive cannot be read ({error})") from error


def _array(name: str, content: bytes) -> np.ndarray:
    """An array of the content of an npy file. Only the header is parsed by numpy, which would allocate what the header asks for."""
    stream = io.BytesIO(content)
    try:
        np.lib.format.read_magic(stream)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
        start = stream.tell()
        if dtype.hasobject or not dtype.itemsize or math.prod(shape) * dtype.itemsize != len(content) - start:
            raise ValueError(f"its {len(content) - start} bytes are no array {shape} of {dtype}")
        return np.ndarray(shape, dtype, content, start, order="F" if fortran else "C").copy(order="K")
    except Exception as error:  # as above: the parser of numpy raises errors of many classes
        raise ValueError(f"is no valid checkpoint: {name.removesuffix('.npy')} is no array ({error})") from error
