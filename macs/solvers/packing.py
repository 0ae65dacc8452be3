"""Plain data and arrays of a solver's state, and the state rebuilt from them, by the annotations of its dataclasses.

`pack` makes a tree of what JSON knows, and collects the arrays by the path of their field, such as "state.archive.F". `unpack` is given the
class, and accepts only what the annotations allow: a field that is missing, unknown or of another type is an error. Nothing is pickled.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

ARRAY = "array"
"""Stands in a tree where the arrays have one of this path."""
DTYPES = "biufcU"
"""Kinds of arrays: bool, integers, floats, complex, str."""
BIT_GENERATORS = ("PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64")
POOL_SIZE = 4
"""Words in the pool of a SeedSequence, unless it was asked for another number."""
LAST = {"pos": 624, "buffer_pos": 4}
"""Largest positions in the buffers of MT19937 and Philox, which do not check them."""
SCALARS: dict[type, tuple[tuple[type, ...], tuple[type, ...]]] = {
    bool: ((bool,), (np.bool_,)),
    int: ((int,), (np.integer,)),
    float: ((float, int), (np.floating, np.integer)),
    str: ((str,), (np.str_,)),
}
"""Types that each annotation of a scalar accepts: of Python, and of numpy."""
CONTAINERS = (list, tuple, dict, Counter)
MAY_BE = (
    "numpy arrays of numbers, bool or str, int, float, bool, str, None, numpy.random.Generator, dataclasses of these, and lists, tuples "
    "and dicts (of str keys) of these, each annotated"
)


def pack(value: Any, annotation: Any, arrays: dict[str, np.ndarray], where: str) -> Any:
    """The tree of a value.

    Numbers are exact, infinities included, and a NaN remains one. Arrays are copied; the order of their axes in memory, on which sums
    depend, is kept. Generators keep the number of children they have spawned. Scalars of numpy become Python's. Two fields that are the
    same array or generator are packed twice, and come back as two.
    """
    kind = _kind(annotation, where)
    if value is None and kind.optional:
        return None
    _check(kind.accepts(value), value, annotation, where)
    if kind.type in SCALARS:
        return value.item() if isinstance(value, np.generic) else value
    if kind.type is np.ndarray:
        arrays[where] = np.array(value, order="K")
        return ARRAY
    if kind.type is np.random.Generator:
        return _pack_generator(value, where)
    if kind.is_dataclass:
        return {name: pack(getattr(value, name), hint, arrays, f"{where}.{name}") for name, hint in _hints(kind.type).items()}
    if isinstance(value, dict):
        _check(all(type(key) is str for key in value), value, annotation, where)
        return {key: pack(item, kind.items[0], arrays, f"{where}[{key!r}]") for key, item in value.items()}
    each = zip(value, kind.each(len(value), where), strict=True)
    return [pack(item, hint, arrays, f"{where}[{i}]") for i, (item, hint) in enumerate(each)]


def unpack(tree: Any, annotation: Any, arrays: dict[str, np.ndarray], where: str) -> Any:
    """The value whose tree and arrays `pack` made. Its arrays are taken out of `arrays`. `__init__` of a dataclass is not called."""
    kind = _kind(annotation, where)
    if tree is None and kind.optional:
        return None
    if kind.type in SCALARS:
        _check(kind.accepts(tree), tree, annotation, where)
        return tree
    if kind.type is np.ndarray:
        array = arrays.pop(where, None) if tree == ARRAY else tree
        _check(kind.accepts(array), array, annotation, where)
        return array
    if kind.type is np.random.Generator:
        return _unpack_generator(tree, where)
    if kind.type in (list, tuple):
        _check(isinstance(tree, list), tree, annotation, where)
        each = zip(tree, kind.each(len(tree), where), strict=True)
        return kind.type([unpack(item, hint, arrays, f"{where}[{i}]") for i, (item, hint) in enumerate(each)])
    _check(isinstance(tree, dict) and kind.type is not NoneType, tree, annotation, where)
    if not kind.is_dataclass:
        return kind.type({key: unpack(item, kind.items[0], arrays, f"{where}[{key!r}]") for key, item in tree.items()})
    hints = _hints(kind.type)
    for name in sorted(hints.keys() ^ tree.keys()):
        raise TypeError(f"{where}.{name} is {'missing' if name in hints else 'unknown'}")
    made = object.__new__(kind.type)
    for name, hint in hints.items():
        object.__setattr__(made, name, unpack(tree[name], hint, arrays, f"{where}.{name}"))
    return made


@dataclass(frozen=True)
class _Kind:
    """Type that an annotation asks for, whether None is allowed too, and the annotations of its items if it is a container."""

    type: Any
    optional: bool
    items: tuple[Any, ...]

    @property
    def is_dataclass(self) -> bool:
        return not (self.type in CONTAINERS or self.type in SCALARS or self.type in (np.ndarray, np.random.Generator))

    def accepts(self, value: Any) -> bool:
        if self.type in SCALARS:
            python, numpy = SCALARS[self.type]
            return type(value) in python or isinstance(value, numpy)
        return type(value) is self.type and (self.type is not np.ndarray or value.dtype.kind in DTYPES)

    def each(self, count: int, where: str) -> tuple[Any, ...]:
        """Annotations of the items of a list or a tuple of this length."""
        if self.type is list or self.items[1:] == (...,):
            return self.items[:1] * count
        if len(self.items) != count:
            raise TypeError(f"{where} has {count} items, {len(self.items)} expected")
        return self.items


def _kind(annotation: Any, where: str) -> _Kind:
    kind = _parsed(annotation)
    if kind is None:
        raise TypeError(f"{where} is annotated {_named(annotation)}, which cannot be kept: a state is made of {MAY_BE}")
    return kind


@lru_cache(maxsize=256)
def _parsed(annotation: Any) -> _Kind | None:
    options = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)
    left = [option for option in options if option is not NoneType]
    if len(left) != 1:
        return None if left else _Kind(NoneType, True, ())
    kind, items = get_origin(left[0]) or left[0], get_args(left[0])
    if kind in (dict, Counter):
        if items[:1] != (str,):
            return None
        items = items[1:] or (int,)
    simple = kind in (np.ndarray, np.random.Generator, *SCALARS) or (isinstance(kind, type) and is_dataclass(kind))
    return _Kind(kind, len(left) < len(options), items) if simple or (kind in CONTAINERS and items) else None


@lru_cache(maxsize=256)
def _hints(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind)}


def _named(annotation: Any) -> str:
    return annotation.__name__ if isinstance(annotation, type) and not get_args(annotation) else str(annotation)


def _check(fits: bool, value: Any, annotation: Any, where: str) -> None:
    if not fits:
        found = f"an array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
        raise TypeError(f"{where} is {found}, {_named(annotation)} expected")


def _pack_generator(generator: np.random.Generator, where: str) -> dict[str, Any]:
    bits, source = generator.bit_generator, generator.bit_generator.seed_seq
    if type(bits).__name__ not in BIT_GENERATORS or not isinstance(source, np.random.SeedSequence) or source.pool_size != POOL_SIZE:
        known = ", ".join(BIT_GENERATORS)
        raise TypeError(f"{where} draws from {type(bits).__name__}, which cannot be kept: only {known}, from a seed with the usual pool")
    return {"state": _lists(bits.state), "seeds": _lists(source.state)}


def _unpack_generator(tree: Any, where: str) -> np.random.Generator:
    try:
        kind = {name: getattr(np.random, name) for name in BIT_GENERATORS}[tree["state"]["bit_generator"]]
        if tree["seeds"]["pool_size"] != POOL_SIZE or tree["seeds"]["entropy"] is None:
            raise ValueError("its seeds are not those of a generator that was packed")
        bits = kind(np.random.SeedSequence(**tree["seeds"]))
        bits.state = _like(tree["state"], bits.state)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise TypeError(f"{where} is no generator: {error}") from error
    return np.random.Generator(bits)


def _lists(value: Any) -> Any:
    """The value with lists for arrays and tuples, and Python's scalars for numpy's."""
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_lists(item) for item in value] if isinstance(value, list | tuple) else value


def _like(value: Any, pattern: Any, name: str = "state") -> Any:
    """The value with arrays where the pattern has them. Raises if the two differ in more than numbers, or a number is out of range."""
    if isinstance(pattern, dict):
        return {key: _like(value[key], item, key) for key, item in pattern.items()}
    if isinstance(pattern, np.ndarray):
        return np.array(value, dtype=pattern.dtype).reshape(pattern.shape)
    if type(value) is not type(pattern):
        raise ValueError(f"{name} is {type(value).__name__}, {type(pattern).__name__} expected")
    if name in LAST and not 0 <= value <= LAST[name]:
        raise ValueError(f"{name} is {value}")
    return value
