"""Files of plain data: schemas, checked by msgspec; records, which have a checksum; and which code that files name may be loaded.

Errors are one line: the place, the value, what it must be, and the nearest known word.
"""

from __future__ import annotations

import json
import math
import re
import sys
import types
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints
from zlib import crc32

import msgspec
from msgspec import Meta

from macs.front import Front
from macs.io.atomic import read_whole
from problems.catalogue import is_catalogued
from problems.checks import unknown

DATA_BYTES = 2**28
"""Bytes that the file of a record or of a table may have: those of large studies have some 10^6."""

Number = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max, description="a finite number")]
Positive = Annotated[float, Meta(gt=0, le=sys.float_info.max, description="a positive number")]
Count = Annotated[int, Meta(ge=1, description="a whole number of at least 1")]
Natural = Annotated[int, Meta(ge=0, description="a whole number of at least 0")]
Text = Annotated[str, Meta(description="a text")]
Flag = Annotated[bool, Meta(description="true or false")]


class Section(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """A section of a file: its fields are the keys that it may have. Those without a default are required."""


def checked(value: Any, kind: Any, name: str = "it") -> Any:
    """Plain data converted to a type."""
    data = plain(value)
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise ValueError(_in_words(str(error), data, kind, name)) from None


def _in_words(error: str, data: Any, kind: Any, name: str) -> str:
    """One line for an error of msgspec, whose place is a path such as `$.paper[0].point`."""
    text, _, path = error.partition(" - at `$")
    place = ""
    for key, index in re.findall(r"\.(\w+)|\[(\d+|\.\.\.)\]", path):
        if index == "...":  # the entry of a mapping, whose key msgspec does not name
            break
        if index:
            place, kind, data = f"{place or name} {int(index) + 1}", get_args(_bare(kind))[0], data[int(index)]
        else:
            member, tags = _member(kind, data), _tags(kind)
            known = get_type_hints(member, include_extras=True) if isinstance(member, type) else {}
            place, kind, data = f"{place}: {key}" if place else key, known.get(key, Literal[tuple(tags)] if tags else Any), data.get(key)
    before, field = f"{place}: " if place else "", re.search(r"field `(.*)`$", text)
    if field and "unknown" in text:
        return f"{before}{unknown('key', field[1], _member(kind, data).__struct_fields__)}"
    if field:
        tags = {} if isinstance(_member(kind, data), type) else _tags(kind)
        return f"{before}{field[1]} {'must be one of ' if tags else 'is missing'}{', '.join(tags)}"
    if text.startswith(("Expected", "Invalid")):
        return f"{place or name} must be {_description(kind)}, not {repr(data)[:80]}"  # a long value is cut
    return f"{before}{text}"  # from a `__post_init__`, in words already


def _bare(kind: Any) -> Any:
    """A type without its annotation and without None."""
    if get_origin(kind) is Annotated:
        return _bare(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        members = [one for one in get_args(kind) if one is not type(None)]
        return _bare(members[0]) if len(members) == 1 else Union[tuple(members)]  # noqa: UP007 - of a list
    return kind


def _tags(kind: Any) -> dict[str, Any]:
    """{tag: section} of a union of tagged sections."""
    return {str(one.__struct_config__.tag): one for one in get_args(_bare(kind)) if hasattr(one, "__struct_config__")}


def _member(kind: Any, data: Any) -> Any:
    """The section that data is to be: of a union the one that its tag names, if it has one."""
    for tag, member in _tags(kind).items():
        if isinstance(data, Mapping) and data.get(member.__struct_config__.tag_field) == tag:
            return member
    return _bare(kind)


def _description(kind: Any) -> str:
    """What a value must be, in words."""
    stated = [one.description for one in get_args(kind)[1:] if isinstance(one, Meta) and one.description]
    if stated:
        return str(stated[0])
    if get_origin(kind) in (Union, types.UnionType) and type(None) in get_args(kind):
        return _description(get_args(kind)[0])
    bare = _bare(kind)
    if get_origin(bare) is Literal:
        return f"one of {', '.join(map(str, get_args(bare)))}"
    if hasattr(bare, "__struct_fields__"):
        return f"a table with {', '.join(bare.__struct_fields__)}"
    words = {str: "a text", int: "a whole number", float: "a number", bool: "true or false", list: "a list"}
    entries = f" whose entries are each {_description(get_args(bare)[1])}" if get_origin(bare) is dict else ""
    return words.get(get_origin(bare) or bare, f"a table{entries}")


def plain(data: Any) -> Any:
    """`data` as it comes back from JSON; what JSON does not know, as its `repr`."""

    def converted(one: Any) -> Any:
        return one.tolist() if hasattr(one, "tolist") else dict(one) if isinstance(one, Mapping) else repr(one)

    return json.loads(json.dumps(data, default=converted))


def check_known(kind: str, words: Iterable[Any], known: Collection[str]) -> None:
    """Raise ValueError that names the first of some words which is not known."""
    for word in words:
        if word not in known:
            raise ValueError(unknown(kind, word, known))


def is_number(value: Any) -> bool:
    """Whether a value is a number, and finite."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


@contextmanager
def errors_begin_with(where: str, anything: str = "") -> Iterator[None]:
    """A context in which the text of a ValueError begins with `where`. With `anything`, every other error becomes such a ValueError."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error
    except (Exception, SystemExit) as error:
        if not anything:
            raise
        raise ValueError(f"{where}: {anything}: {type(error).__name__}: {error}") from error


def to_record(content: Any, indent: int | None = None) -> bytes:
    """A record of plain data, as the bytes of a file; indented if it is made to be read by a person."""
    return json.dumps({"crc32": _checksum(content), "content": content}, indent=indent).encode() + b"\n"


def from_record(data: bytes) -> Any:
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


def read_record(path: Path) -> Any:
    """The content of the file of a record. Raises OSError if it cannot be read or is no ordinary file, ValueError if it is no record."""
    return from_record(read_whole(path, DATA_BYTES))


def _checksum(content: Any) -> int:
    return crc32(json.dumps(content).encode())


def check_trusted(address: str, trust: bool, where: str) -> None:
    """Raise ValueError if a file names an address that must not be loaded."""
    if ":" in address and not trust and not is_catalogued(address):
        raise ValueError(
            f"{where} names '{address}', which is not in the catalogue and runs code of its own when loaded: "
            "if you trust it, give --trust, or trust=True in Python"
        )


def load_front(path: str | PathLike[str], trust: bool) -> Front:
    """A saved front whose problem may be loaded from its address. Raises ValueError or FileNotFoundError as `Front.load`, and ValueError
    for an address that is not trusted."""
    front = Front.load(path, trust=trust)
    if front.source is not None and front.source.address:
        check_trusted(front.source.address, trust, f"'{path}'")
    return front
