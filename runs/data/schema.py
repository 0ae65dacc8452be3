"""Schemas of plain data, checked by msgspec. Errors are one line: the place, the value, what it must be, and the nearest known word."""

from __future__ import annotations

import json
import math
import re
import sys
import types
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta

from problems.checks import unknown

LARGEST = sys.float_info.max
Number = Annotated[float, Meta(ge=-LARGEST, le=LARGEST, description="a finite number")]
Positive = Annotated[float, Meta(gt=0, le=LARGEST, description="a positive number")]
Count = Annotated[int, Meta(ge=1, description="a whole number of at least 1")]
Natural = Annotated[int, Meta(ge=0, description="a whole number of at least 0")]
Text = Annotated[str, Meta(description="a text")]
Flag = Annotated[bool, Meta(description="true or false")]


class Section(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """A section of a file: its fields are the keys that it may have. Those without a default are required."""


def checked(value: Any, kind: Any, name: str = "it") -> Any:
    """Plain data converted to a type.

    Parameters
    ----------
    value : plain data
        Numbers of numpy and arrays count as numbers and lists.
    kind : type
        A `Section`, one of the annotated types of this module, or any other type that msgspec converts to.
    name : str
        Of the value, for messages about the value as a whole.

    Raises
    ------
    ValueError
        The value does not fit; one line that names the key.
    """
    data = plain(value)
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        text, _, path = str(error).partition(" - at `$")
        raise ValueError(_in_words(text, path.rstrip("`"), data, value, kind, name)) from None


def _in_words(text: str, path: str, data: Any, value: Any, kind: Any, name: str) -> str:
    """One line for an error of msgspec at a path such as `.paper[0].point`."""
    steps = [key or int(index) for key, index in re.findall(r"\.(\w+)|\[(\d+)\]", path)]
    *_, last = [("", kind, data), *_along(steps, kind, data)]
    place, kind, data = last
    known, field = _keys(kind, data), re.search(r"`(\w.*)`$", text)
    before = f"{place}: " if place else ""
    if text.startswith("Object contains unknown field") and field:
        return f"{before}{unknown('key', field[1], known)}"
    if text.startswith("Object missing required field") and field:
        tags = _tags(kind)
        return (
            f"{before}{field[1]} must be one of {', '.join(tags)}" if field[1] not in known and tags else f"{before}{field[1]} is missing"
        )
    if not text.startswith(("Expected", "Invalid")):  # from a `__post_init__`, in words already
        return f"{before}{text}"
    whole, _, key = place.rpartition(": ")
    shown = data if steps else value
    return f"{whole}{': ' if whole else ''}{key or name} must be {_description(kind)}, not {shown!r}"


def _along(steps: Sequence[str | int], kind: Any, data: Any) -> Iterator[tuple[str, Any, Any]]:
    """Place in words, type and value after each step of a path."""
    place = ""
    for step in steps:
        if isinstance(step, int):
            place, kind, data = f"{place} {step + 1}", (get_args(_bare(kind)) or (Any,))[0], data[step]
        else:
            member = _member(kind, data)
            known = get_type_hints(member, include_extras=True) if isinstance(member, type) else {}
            kind = known.get(step, Literal[tuple(_tags(kind))] if _tags(kind) else Any)
            place, data = f"{place}: {step}" if place else step, data.get(step)
        yield place, kind, data


def _bare(kind: Any) -> Any:
    """A type without its annotation and without None."""
    if get_origin(kind) is Annotated:
        return _bare(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        left = [one for one in get_args(kind) if one is not type(None)]
        return _bare(left[0]) if len(left) == 1 else Union[tuple(left)]  # noqa: UP007 - of a tuple
    return kind


def _tags(kind: Any) -> dict[str, Any]:
    """{tag: table} of a union of tagged tables."""
    members = [one for one in get_args(_bare(kind)) if isinstance(one, type) and issubclass(one, msgspec.Struct)]
    return {str(one.__struct_config__.tag): one for one in members}


def _member(kind: Any, data: Any) -> Any:
    """The table that data is to be, of a union the one that its tag names."""
    for tag, member in _tags(kind).items():
        if isinstance(data, Mapping) and data.get(member.__struct_config__.tag_field) == tag:
            return member
    return _bare(kind)


def _keys(kind: Any, data: Any) -> tuple[str, ...]:
    member = _member(kind, data)
    return getattr(member, "__struct_fields__", ())


def _description(kind: Any) -> str:
    """What a value must be, in words."""
    stated = [one.description for one in get_args(kind)[1:] if isinstance(one, Meta) and one.description]
    if stated:
        return str(stated[0])
    if get_origin(kind) in (Union, types.UnionType) and type(None) in get_args(kind):
        return _description(next(one for one in get_args(kind) if one is not type(None)))
    bare = _bare(kind)
    if get_origin(bare) is Literal:
        return f"one of {', '.join(map(str, get_args(bare)))}"
    if get_origin(bare) is list:
        return "a list"
    keys = _keys(bare, None)
    return f"a table with {', '.join(keys)}" if keys else "a table"


def plain(data: Any) -> Any:
    """`data` as it comes back from JSON; what JSON does not know, as its `repr`."""

    def converted(one: Any) -> Any:
        return one.tolist() if hasattr(one, "tolist") else dict(one) if isinstance(one, Mapping) else repr(one)

    return json.loads(json.dumps(data, default=converted))


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
