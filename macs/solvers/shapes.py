"""Whether the arrays of a state have the shapes that its dataclasses state: a checkpoint that was forged is refused before it is used.

A dataclass says so in `SHAPES`: array -> its dimensions, after which its kind may follow, "int", "bool" or "str"; floats by default. A
dimension is "m", "d" or "D" (objectives, free variables, entries of a full vector: the same everywhere in a state), twice one of them
("2m"), a number, the name of a field that is a dataclass (its length), or any other word, which is one number in the dataclass. `INDICES`
says which whole numbers are rows of which array; -1 is none.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from operator import attrgetter
from typing import Any

import numpy as np

COMMON = ("m", "d", "D")
"""Dimensions that are the same everywhere in a state."""
KINDS = {"int": "i", "bool": "b", "str": "U"}


def check_shapes(state: Any, sizes: dict[str, int], where: str = "state") -> None:
    """Raise TypeError that names the array unless all arrays of a state are as its dataclasses say. `sizes` are those known of `COMMON`."""
    own: dict[str, int] = {}
    for name, words in getattr(state, "SHAPES", {}).items():
        if (array := getattr(state, name)) is not None:
            _check(array, words.split(), f"{where}.{name}", state, sizes, own)
    for path, rows in getattr(state, "INDICES", {}).items():
        index, count = attrgetter(path)(state), len(getattr(state, rows))
        if len(index) and not -1 <= index.min() <= index.max() < count:
            raise TypeError(f"{where}.{path} has numbers outside of the {count} rows of {where}.{rows}")
    for field in fields(state):
        value = getattr(state, field.name)
        if is_dataclass(value):
            check_shapes(value, sizes, f"{where}.{field.name}")


def _check(array: np.ndarray, words: list[str], where: str, state: Any, sizes: dict[str, int], own: dict[str, int]) -> None:
    kind = KINDS.get(words[-1], "f")
    names = words[:-1] if words[-1] in KINDS else words
    if array.dtype.kind != kind or (kind == "f" and array.dtype != float) or array.ndim != len(names):
        expected = f"{words[-1] if words[-1] in KINDS else 'float64'} with {len(names)}"
        raise TypeError(f"{where} is an array of {array.dtype} with {array.ndim} dimensions; {expected} expected")
    for axis, (name, count) in enumerate(zip(names, array.shape, strict=True)):
        single, times = name.removeprefix("2"), 2 if name[:1] == "2" and name != "2" else 1
        if name.isdecimal():
            expected_count = int(name)
        elif is_dataclass(getattr(state, name, None)):
            expected_count = len(getattr(state, name))
        else:
            expected_count = times * (sizes if single in COMMON else own).setdefault(single, count // times)
        if count != expected_count:
            raise TypeError(f"{where} has {count} {('rows', 'columns')[axis]}, {expected_count} expected")
