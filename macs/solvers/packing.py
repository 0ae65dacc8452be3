"""What a solver knows, as plain data and back, by the annotations of its dataclasses; nothing is pickled, nothing that is read is run.

`pack` makes a tree of what JSON knows, and a list of arrays that the tree refers to by their number. `unpack` is given the class, and
accepts nothing but what its annotations say: what is missing, left over or of another kind is an error.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

ARRAYS = "biufcU"
"""Kinds of arrays: bool, integers, floats, complex, str."""
BIT_GENERATORS = ("PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64")
SCALARS: dict[type, tuple[tuple[type, ...], tuple[type, ...]]] = {
    bool: ((bool,), (np.bool_,)),
    int: ((int,), (np.integer,)),
    float: ((float, int), (np.floating, np.integer)),
    str: ((str,), (np.str_,)),
}
"""What may stand where an annotation says so: of Python, and of numpy."""
CONTAINERS = (list, tuple, dict, Counter)
MAY_BE = (
    "numpy arrays of numbers, bool or str, int, float, bool, str, None, numpy.random.Generator, dataclasses of these, and lists, tuples "
    "and dicts (of str keys) of these, each annotated"
)


def pack(value: Any, annotation: Any, arrays: list[np.ndarray], where: str = "") -> Any:
    """The tree of a value, by its annotation: a class, or what else an annotation may be.

    Numbers are exact, infinities included, and a NaN comes back as one. Arrays are copied with the order of their axes in memory, which
    sums depend on. Generators keep what they have spawned. Scalars of numpy come back as Python's. Nothing that changes may be there twice:
    two fields that are one array or one generator come back as two.

    Parameters
    ----------
    value, annotation
    arrays : list
        The value's arrays are appended to it.
    where : str
        What messages call the value.

    Raises
    ------
    TypeError
        If the value is not what its annotation says, or this is nothing that can be packed. The message names the field.
    """
    kind = _kind(annotation, where)
    if value is None and kind.optional:
        return None
    _check(kind.takes(value), value, annotation, where)
    if kind.wanted in SCALARS:
        return value.item() if isinstance(value, np.generic) else value
    if kind.wanted is np.ndarray:
        arrays.append(np.array(value, order="K"))
        return len(arrays) - 1
    if kind.wanted is np.random.Generator:
        return _pack_generator(value, where)
    if kind.is_dataclass:
        return {name: pack(getattr(value, name), hint, arrays, _at(where, name)) for name, hint in _hints(kind.wanted).items()}
    if isinstance(value, dict):
        _check(all(type(key) is str for key in value), value, annotation, where)
        return {key: pack(item, kind.items[0], arrays, f"{where}[{key!r}]") for key, item in value.items()}
    each = zip(value, kind.each(len(value), where), strict=True)
    return [pack(item, hint, arrays, f"{where}[{i}]") for i, (item, hint) in enumerate(each)]


def unpack(tree: Any, annotation: Any, arrays: list[np.ndarray], where: str = "") -> Any:
    """The value that `pack` made a tree and arrays of. A dataclass is rebuilt field by field, without a call of its `__init__`.

    Raises
    ------
    TypeError
        If the tree is not that of such a value. The message names the field.
    """
    kind = _kind(annotation, where)
    if tree is None and kind.optional:
        return None
    if kind.wanted in SCALARS:
        _check(kind.takes(tree), tree, annotation, where)
        return tree
    if kind.wanted is np.ndarray:
        _check(type(tree) is int and 0 <= tree < len(arrays) and arrays[tree].dtype.kind in ARRAYS, tree, annotation, where)
        return arrays[tree]
    if kind.wanted is np.random.Generator:
        return _unpack_generator(tree, where)
    if kind.wanted in (list, tuple):
        _check(isinstance(tree, list), tree, annotation, where)
        each = zip(tree, kind.each(len(tree), where), strict=True)
        return kind.wanted([unpack(item, hint, arrays, f"{where}[{i}]") for i, (item, hint) in enumerate(each)])
    _check(isinstance(tree, dict) and kind.wanted is not NoneType, tree, annotation, where)
    if not kind.is_dataclass:
        return kind.wanted({key: unpack(item, kind.items[0], arrays, f"{where}[{key!r}]") for key, item in tree.items()})
    hints = _hints(kind.wanted)
    for name in sorted(hints.keys() ^ tree.keys()):
        raise TypeError(f"{_at(where, name)} is {'missing' if name in hints else 'unknown'}")
    made = object.__new__(kind.wanted)
    for name, hint in hints.items():
        object.__setattr__(made, name, unpack(tree[name], hint, arrays, _at(where, name)))
    return made


@dataclass(frozen=True)
class _Kind:
    """What an annotation asks for: a class; whether None will do; what the items are, if it holds any."""

    wanted: Any
    optional: bool
    items: tuple[Any, ...]

    @property
    def is_dataclass(self) -> bool:
        return not (self.wanted in CONTAINERS or self.wanted in SCALARS or self.wanted in (np.ndarray, np.random.Generator))

    def takes(self, value: Any) -> bool:
        if self.wanted in SCALARS:
            python, numpy = SCALARS[self.wanted]
            return type(value) in python or isinstance(value, numpy)
        return type(value) is self.wanted and (self.wanted is not np.ndarray or value.dtype.kind in ARRAYS)

    def each(self, count: int, where: str) -> tuple[Any, ...]:
        """An annotation for each item of a list or a tuple."""
        if self.wanted is list or self.items[1:] == (...,):
            return self.items[:1] * count
        if len(self.items) != count:
            raise TypeError(f"{where} has {count} items, {len(self.items)} expected")
        return self.items


def _kind(annotation: Any, where: str) -> _Kind:
    kind = _understood(annotation)
    if kind is None:
        raise TypeError(f"{where or 'the state'} is annotated {_told(annotation)}, which cannot be kept: a state is made of {MAY_BE}")
    return kind


@lru_cache(maxsize=256)
def _understood(annotation: Any) -> _Kind | None:
    options = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)
    left = [option for option in options if option is not NoneType]
    if len(left) != 1:
        return None if left else _Kind(NoneType, True, ())
    wanted, items = get_origin(left[0]) or left[0], get_args(left[0])
    if wanted in (dict, Counter):
        if items[:1] != (str,):
            return None
        items = items[1:] or (int,)
    simple = wanted in (np.ndarray, np.random.Generator, *SCALARS) or (isinstance(wanted, type) and is_dataclass(wanted))
    return _Kind(wanted, len(left) < len(options), items) if simple or (wanted in CONTAINERS and items) else None


@lru_cache(maxsize=256)
def _hints(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind)}


def _at(where: str, name: str) -> str:
    return f"{where}.{name}" if where else name


def _told(annotation: Any) -> str:
    return annotation.__name__ if isinstance(annotation, type) and not get_args(annotation) else str(annotation)


def _check(fits: bool, value: Any, annotation: Any, where: str) -> None:
    if not fits:
        found = f"an array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
        raise TypeError(f"{where or 'the state'} is {found}, {_told(annotation)} expected")


def _pack_generator(generator: np.random.Generator, where: str) -> dict[str, Any]:
    bits, source = generator.bit_generator, generator.bit_generator.seed_seq
    if type(bits).__name__ not in BIT_GENERATORS or not isinstance(source, np.random.SeedSequence):
        raise TypeError(f"{where} draws from {type(bits).__name__}, which cannot be kept: only {', '.join(BIT_GENERATORS)}, from a seed")
    return {"state": _lists(bits.state), "seeds": _lists(source.state)}


def _unpack_generator(tree: Any, where: str) -> np.random.Generator:
    try:
        kind = {name: getattr(np.random, name) for name in BIT_GENERATORS}[tree["state"]["bit_generator"]]
        bits = kind(np.random.SeedSequence(**tree["seeds"]))
        bits.state = _like(tree["state"], bits.state)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise TypeError(f"{where} is no generator: {error}") from error
    return np.random.Generator(bits)


def _lists(value: Any) -> Any:
    """Arrays and tuples as lists, scalars of numpy as Python's."""
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_lists(item) for item in value] if isinstance(value, list | tuple) else value


def _like(value: Any, pattern: Any) -> Any:
    """`value` with arrays where `pattern` has them. Raises if they differ in more than numbers."""
    if isinstance(pattern, dict):
        return {key: _like(value[key], item) for key, item in pattern.items()}
    if isinstance(pattern, np.ndarray):
        return np.array(value, dtype=pattern.dtype).reshape(pattern.shape)
    if type(value) is not type(pattern):
        raise ValueError(f"{type(value).__name__} where {type(pattern).__name__} belongs")
    return value
