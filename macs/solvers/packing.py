"""Serialisation of a solver's state to bytes and back, by the annotations of its dataclasses.

The bytes are MessagePack. Arrays are stored as type, shape and content, generators as the state of their bits and seeds. Data that do not
fit the annotations raise an error that names the field. Nothing is pickled.

Dataclasses of a state give the shapes of its arrays in `SHAPES`: array -> its dimensions, after which its kind may follow, "int", "bool" or
"str"; floats by default. A dimension is "m", "d" or "D" (objectives, free variables, entries of a full vector: the same everywhere in a
state), twice one of them ("2m"), a number, the name of a field that is a dataclass (its length), or any other word, which is one number in
the dataclass. `INDICES` says which integers are rows of which array; -1 is none.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from operator import attrgetter
from typing import Any, Literal, get_args, get_origin

import msgspec
import numpy as np

ARRAY_KINDS = "biufcU"
"""Kinds of arrays that can be kept: bool, integers, floats, complex, str."""
BIT_GENERATORS = ("PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64")
SEED_POOL = 4
"""Words in the pool of a SeedSequence, unless it was asked for another number."""
LAST_POSITION = {"pos": 624, "buffer_pos": 4}
"""Largest positions in the buffers of MT19937 and Philox, which do not check them."""
COMMON_SIZES = ("m", "d", "D")
"""Dimensions that are the same everywhere in a state."""
SHAPE_KINDS = {"int": "i", "bool": "b", "str": "U"}


def encode(value: Any) -> bytes:
    """The bytes of a value: numbers are exact, and arrays keep their memory order, on which the rounding of sums depends."""
    return msgspec.msgpack.encode(value, enc_hook=_plain)


def decode(content: bytes, kind: Any) -> Any:
    """The value of a type whose bytes `encode` made. Raises TypeError that names what does not fit."""
    try:
        return msgspec.msgpack.decode(content, type=kind, dec_hook=_rebuilt)
    except (msgspec.DecodeError, RecursionError, TypeError) as error:
        raise TypeError(str(error)) from error


def check_kept(state: Any, content: bytes, kind: type) -> None:
    """Raise TypeError unless the bytes of a state give the same state again: its annotations must be right."""
    if type(state) is not kind or encode(decode(content, kind)) != content:
        raise TypeError(f"the annotations of {kind.__name__} do not say all that its fields are")


def _plain(value: Any) -> Any:
    """A value that MessagePack does not know, in types that it knows."""
    if type(value) is np.ndarray and value.dtype.kind in ARRAY_KINDS:
        order: Literal["F", "C"] = "F" if not value.flags.c_contiguous and value.strides == tuple(sorted(value.strides)) else "C"
        return {"dtype": value.dtype.str, "shape": value.shape, "order": order, "content": value.tobytes(order)}
    if isinstance(value, np.bool_ | np.integer | np.floating | np.str_):
        return value.item()
    if isinstance(value, np.random.Generator):
        bits = value.bit_generator
        source = bits.seed_seq
        if type(bits).__name__ not in BIT_GENERATORS or not isinstance(source, np.random.SeedSequence) or source.pool_size != SEED_POOL:
            known = ", ".join(BIT_GENERATORS)
            raise TypeError(f"a generator draws from {type(bits).__name__}; only {known} can be kept, from a seed with the usual pool")
        return json.dumps({"state": bits.state, "seeds": source.state}, default=lambda array: array.tolist())
    raise TypeError(f"{type(value).__name__} cannot be kept in a checkpoint")


def _rebuilt(kind: Any, value: Any) -> Any:
    """The value of a type that MessagePack does not know."""
    if kind is np.ndarray:
        return _array(value)
    if kind is np.random.Generator:
        return _generator(value)
    origin = get_origin(kind) or kind
    if isinstance(origin, type) and issubclass(origin, dict):
        items = get_args(kind)[1:] or (int,)
        return origin(msgspec.convert(value, dict[str, items[0]], dec_hook=_rebuilt))  # type: ignore[valid-type]
    raise TypeError(f"{kind} cannot be kept in a checkpoint")


def _array(value: Any) -> np.ndarray:
    """An array on existing bytes: the shape stated in a file allocates no memory."""
    try:
        dtype, shape, order, content = np.dtype(value["dtype"]), tuple(value["shape"]), value["order"], value["content"]
        if dtype.kind not in ARRAY_KINDS or not dtype.itemsize or math.prod(shape) * dtype.itemsize != len(content):
            raise ValueError(f"{len(content)} bytes are no array {shape} of {dtype}")
        return np.ndarray(shape, dtype, content, order=order).copy(order="K")
    except Exception as error:  # numpy raises errors of many classes for what is no type, shape or order
        raise TypeError(f"no array: {error}") from error


def _generator(value: Any) -> np.random.Generator:
    try:
        tree = json.loads(value)
        if tree["seeds"]["pool_size"] != SEED_POOL or tree["seeds"]["entropy"] is None:
            raise ValueError("its seeds are not those of a generator that was kept")
        kind = {name: getattr(np.random, name) for name in BIT_GENERATORS}[tree["state"]["bit_generator"]]
        bits = kind(np.random.SeedSequence(**tree["seeds"]))
        bits.state = _like(tree["state"], bits.state)
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise TypeError(f"no generator: {error}") from error
    return np.random.Generator(bits)


def _like(value: Any, pattern: Any, name: str = "state") -> Any:
    """The value with arrays where the pattern has them. Raises if the two differ in more than numbers, or a number is out of range."""
    if isinstance(pattern, dict):
        return {key: _like(value[key], item, key) for key, item in pattern.items()}
    if isinstance(pattern, np.ndarray):
        return np.array(value, dtype=pattern.dtype).reshape(pattern.shape)
    if type(value) is not type(pattern):
        raise ValueError(f"{name} is {type(value).__name__}, {type(pattern).__name__} expected")
    if name in LAST_POSITION and not 0 <= value <= LAST_POSITION[name]:
        raise ValueError(f"{name} is {value}")
    return value


def check_shapes(state: Any, sizes: dict[str, int], where: str = "state", shapes: Mapping[str, str] | None = None) -> None:
    """Raise TypeError that names the array unless all arrays of a state fit `SHAPES`, or `shapes`. `sizes` are the known ones of
    `COMMON_SIZES`."""
    own: dict[str, int] = {}
    for name, words in (getattr(state, "SHAPES", {}) if shapes is None else shapes).items():
        if (array := getattr(state, name)) is not None:
            _check_shape(array, words.split(), f"{where}.{name}", state, sizes, own)
    for path, rows in getattr(state, "INDICES", {}).items():
        index, count = attrgetter(path)(state), len(getattr(state, rows))
        if len(index) and not -1 <= index.min() <= index.max() < count:
            raise TypeError(f"{where}.{path} has numbers outside of the {count} rows of {where}.{rows}")
    for field in fields(state):
        value = getattr(state, field.name)
        if is_dataclass(value):
            check_shapes(value, sizes, f"{where}.{field.name}")


def _check_shape(array: np.ndarray, words: list[str], where: str, state: Any, sizes: dict[str, int], own: dict[str, int]) -> None:
    kind = SHAPE_KINDS.get(words[-1], "f")
    names = words[:-1] if words[-1] in SHAPE_KINDS else words
    if array.dtype.kind != kind or (kind == "f" and array.dtype != float) or array.ndim != len(names):
        expected = f"{words[-1] if words[-1] in SHAPE_KINDS else 'float64'} with {len(names)}"
        raise TypeError(f"{where} is an array of {array.dtype} with {array.ndim} dimensions; {expected} expected")
    for axis, (name, count) in enumerate(zip(names, array.shape, strict=True)):
        single, times = name.removeprefix("2"), 2 if name[:1] == "2" and name != "2" else 1
        if name.isdecimal():
            expected_count = int(name)
        elif is_dataclass(getattr(state, name, None)):
            expected_count = len(getattr(state, name))
        else:
            expected_count = times * (sizes if single in COMMON_SIZES else own).setdefault(single, count // times)
        if count != expected_count:
            raise TypeError(f"{where} has {count} {('rows', 'columns')[axis]}, {expected_count} expected")
