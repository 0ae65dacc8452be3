"""A dialogue as one JSON file, whole or not at all.

What a reader wants is at the top: the present choice in numbers. `history` says what was asked for, as plain data of preferences, and what
was chosen, by the number of the point. `points` has those of the front, and then those that were found, as the content of a front's file
(netCDF-4 with a checksum) in base 64. Values and degrees are for readers: they are computed again. No code that a file names is run.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import msgspec

from ..fronts import files
from ..fronts.points import Points
from ..io.atomic import read_whole, write_whole

FORMAT, FILE_VERSION = "macs dialogue", 1
MOST_BYTES = 2 * files.LARGEST_FRONT
"""Bytes that a file may have."""


class ChoiceRecord(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """A choice: the number of its point, and what readers want to know of it."""

    point: int
    objectives: dict[str, float] = {}
    degrees: dict[str, float | None] = {}
    values: list[float | None] = []
    verified: bool | None = None
    message: str = ""


class TurnRecord(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """A turn."""

    asked: str
    preference: dict[str, Any]
    choice: ChoiceRecord | None
    alternatives: list[ChoiceRecord]


class DialogueRecord(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """The keys of a file, in their order."""

    format: str
    version: int
    choice: ChoiceRecord | None
    units: dict[str, str]
    senses: dict[str, str]
    ranges: dict[str, dict[str, float]]
    seed: int
    solves: bool
    transcription: dict[str, Any] | None
    history: list[TurnRecord]
    front: int
    points: str


def write(record: DialogueRecord, path: str | PathLike[str]) -> None:
    """Write a file, whole or not at all."""
    # Infinity, and what is no number, is null.
    write_whole(path, msgspec.json.format(msgspec.json.encode(record), indent=1) + b"\n")


def packed(points: Points) -> str:
    """Points as text."""
    return base64.b64encode(files.to_bytes(points)).decode()


def read(path: str | PathLike[str]) -> tuple[DialogueRecord, Points]:
    """The record of a file, and its points. Raises what `Dialogue.load` says."""
    try:
        content = read_whole(path, MOST_BYTES)
    except FileNotFoundError:
        raise FileNotFoundError(f"there is no file '{path}'") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from error
    with readable(path):
        return _read(content)


@contextmanager
def readable(path: str | PathLike[str]) -> Iterator[None]:
    """A context in which errors say in one line that a file is no dialogue."""
    try:
        yield
    except (ValueError, RecursionError) as error:
        words = "it is nested too deeply" if isinstance(error, RecursionError) else " ".join(str(error).split())
        raise ValueError(f"{path} does not hold a dialogue that can be read: {words}") from None


def is_dialogue(path: str | PathLike[str]) -> bool:
    """Whether a file begins as one of a dialogue does, and not as that of a front."""
    with Path(path).open("rb") as file:
        return file.read(1) == b"{"


def _read(content: bytes) -> tuple[DialogueRecord, Points]:
    try:
        data = json.loads(content)
    except ValueError:
        raise ValueError("it is not JSON") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise ValueError("it is a file of something else")
    if isinstance(data.get("version"), int) and data["version"] > FILE_VERSION:
        raise ValueError(f"its format is version {data['version']}, this MACS reads up to version {FILE_VERSION}: update MACS")
    record = msgspec.convert(data, DialogueRecord)
    try:
        points = files.from_bytes(base64.b64decode(record.points, validate=True))
    except binascii.Error:
        raise ValueError("its points are damaged") from None
    except Exception as error:
        # HDF5 raises errors of many classes for damaged content.
        raise ValueError(f"its points are damaged: {error}") from None
    if set(record.ranges) != {"best", "worst"}:
        raise ValueError("its ranges must have 'best' and 'worst'")
    if not 0 < record.front <= len(points):
        raise ValueError(f"it has {len(points)} points, and cannot have {record.front} of a front")
    return record, points
