"""Records: JSON with a checksum over its content, so that a damaged file is never read as other numbers."""

from __future__ import annotations

import json
from typing import Any
from zlib import crc32


def to_bytes(content: Any, indent: int | None = None) -> bytes:
    """A record of plain data, as the bytes of a file; indented if it is made to be read by a person."""
    return json.dumps({"crc32": _checksum(content), "content": content}, indent=indent).encode() + b"\n"


def from_bytes(data: bytes) -> Any:
    """The content of a record. Raises ValueError if it is damaged, or no record."""
    try:
        record = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"it is not JSON ({error})") from error
    if not isinstance(record, dict) or record.keys() != {"crc32", "content"}:
        raise ValueError("it has no checksum: another version of MACS wrote it, or it is damaged")
    if record["crc32"] != _checksum(record["content"]):
        raise ValueError("its content does not match its checksum")
    return record["content"]


def _checksum(content: Any) -> int:
    return crc32(json.dumps(content).encode())
