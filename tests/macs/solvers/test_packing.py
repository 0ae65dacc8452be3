"""A solver's state as data and back, through a file: to the last bit, or an error that names the field."""

import json
import struct
from collections import Counter
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Optional

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from macs.solvers.packing import BIT_GENERATORS, check_kept, decode, encode


@dataclass
class Leaf:
    array: np.ndarray
    number: float
    whole: int
    flag: bool
    word: str
    maybe: np.ndarray | None = None


@dataclass(frozen=True)
class Tree:
    leaf: Leaf
    leaves: list[Leaf]
    pair: tuple[int, np.ndarray]
    many: tuple[float, ...]
    table: dict[str, Leaf | None]
    tally: Counter[str]
    rng: np.random.Generator
    nothing: None = None
    old: Optional[int] = None  # noqa: UP045 - the older way of writing it
    lists: list[list[str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        object.__setattr__(self, "made", True)


def generator(name: str, seed: int, draws: int) -> np.random.Generator:
    rng = np.random.Generator(getattr(np.random, name)(seed))
    rng.random(draws)
    rng.integers(0, 9, draws, dtype=np.uint32)  # may leave half a word behind
    rng.spawn(draws % 3)
    return rng


DTYPES = [float, np.float32, ">f8", int, np.uint8, bool, complex]
words = st.text(st.characters(codec="utf-8"), max_size=5)
whole = st.integers(-(2**63), 2**64 - 1)
arrays = st.one_of(
    hnp.arrays(st.sampled_from(DTYPES), hnp.array_shapes(min_dims=0, max_dims=2, min_side=0)),
    hnp.arrays("<U3", hnp.array_shapes(min_dims=1, max_dims=2, min_side=0), elements=st.text("aé\n ", max_size=3)),
).flatmap(lambda array: st.sampled_from([array, np.asfortranarray(array), array.T]))
numbers = st.floats() | st.sampled_from([0.0, -0.0, np.nan, np.inf, -np.inf, 5e-324])
leaves = st.builds(Leaf, arrays, numbers, whole, st.booleans(), words, st.none() | arrays)
generators = st.builds(generator, st.sampled_from(BIT_GENERATORS), st.integers(0, 2**70), st.integers(0, 700))
trees = st.builds(
    Tree,
    leaf=leaves,
    leaves=st.lists(leaves, max_size=2),
    pair=st.tuples(whole, arrays),
    many=st.lists(numbers, max_size=3).map(tuple),
    table=st.dictionaries(words, st.none() | leaves, max_size=2),
    tally=st.dictionaries(words, whole, max_size=3).map(Counter),
    rng=generators,
    old=st.none() | whole,
    lists=st.lists(st.lists(words, max_size=2), max_size=2),
)


def assert_same(one: Any, two: Any) -> None:
    assert type(one) is type(two)
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (two.dtype, two.shape) and one.tobytes() == two.tobytes()
        assert (one.flags.c_contiguous, one.flags.f_contiguous) == (two.flags.c_contiguous, two.flags.f_contiguous)
    elif isinstance(one, np.random.Generator):
        assert_same(one.bit_generator.state, two.bit_generator.state)
        assert [child.random() for child in one.spawn(2)] == [child.random() for child in two.spawn(2)]
        assert one.random(3).tolist() == two.random(3).tolist()
        assert one.integers(0, 9, 5, dtype=np.uint32).tolist() == two.integers(0, 9, 5, dtype=np.uint32).tolist()
    elif is_dataclass(one):
        for name in (f.name for f in fields(one)):
            assert_same(getattr(one, name), getattr(two, name))
    elif isinstance(one, dict):
        assert list(one) == list(two)
        for key in one:
            assert_same(one[key], two[key])
    elif isinstance(one, list | tuple):
        assert len(one) == len(two)
        for pair in zip(one, two, strict=True):
            assert_same(*pair)
    elif isinstance(one, float):
        assert struct.pack("d", one) == struct.pack("d", two) or (one != one and two != two)  # a scalar keeps no payload of its NaN
    else:
        assert one == two


def through_bytes(value: Any, kind: Any) -> Any:
    return decode(encode(value), kind)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(trees)
@example(
    Tree(
        Leaf(np.zeros(()), struct.unpack("d", b"\x01" + b"\0" * 5 + b"\xf8\x7f")[0], 0, False, ""),
        [],
        (1, np.zeros(0)),
        (),
        {},
        Counter(),
        generator("PCG64", 0, 0),
    )
)
def test_what_is_packed_comes_back_to_the_bit(tree: Tree) -> None:
    assert_same(through_bytes(tree, Tree), tree)


def test_one_array_in_two_fields_comes_back_as_two() -> None:
    array = np.zeros(2)
    leaf = through_bytes(Leaf(array, 1.0, 1, True, "a", array), Leaf)
    leaf.array[:] = 1
    assert leaf.maybe is not None and not leaf.maybe.any()
    leaf = Leaf(np.zeros(1), np.float64(0.1), np.int64(3), np.bool_(True), np.str_("a"))  # type: ignore[arg-type]
    assert_same(through_bytes(leaf, Leaf), Leaf(np.zeros(1), 0.1, 3, True, "a"))


@dataclass
class Loose:
    what: Any


class Own(np.random.PCG64):
    pass


LEAF: dict[str, Any] = {"array": np.zeros(2), "number": 1.0, "whole": 1, "flag": True, "word": "a"}


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (Leaf(**LEAF | {"array": [1.0]}), "no array: .* at `[$].array`"),
        (Leaf(**LEAF | {"array": np.array([{}])}), "ndarray cannot be kept"),
        (Leaf(**LEAF | {"array": np.ma.zeros(2)}), "MaskedArray cannot be kept"),
        (Leaf(**LEAF | {"whole": 1.5}), "Expected `int`, got `float` - at `[$].whole`"),
        (Leaf(**LEAF | {"whole": True}), "Expected `int`, got `bool`"),
        (Leaf(**LEAF | {"flag": 1}), "Expected `bool`, got `int`"),
        (Leaf(**LEAF | {"word": None}), "Expected `str`, got `(null|None)`"),
        (Loose(np.random.Generator(Own(1))), "a generator draws from Own; only PCG64"),
        (Loose(object()), "object cannot be kept"),
    ],
)
def test_what_is_no_state_is_refused(value: Any, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        check_kept(value, encode(value), type(value))


@pytest.mark.parametrize("text", ["", "3", "{}", '{"state": {"bit_generator": "RandomState"}}', "[" * 100_000])
def test_what_is_no_generator_is_refused(text: str) -> None:
    with pytest.raises(TypeError, match="no generator"):
        decode(encode(text), np.random.Generator)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("PCG64", lambda tree: tree["seeds"].update(pool_size=10**12)),  # would fill the memory
        ("PCG64", lambda tree: tree["seeds"].update(entropy=None)),  # would be drawn anew
        ("PCG64", lambda tree: tree["seeds"].update(n_children_spawned=-1)),
        ("PCG64", lambda tree: tree["state"]["state"].update(inc="one")),
        ("MT19937", lambda tree: tree["state"]["state"].update(pos=625)),  # would be read past its end
        ("MT19937", lambda tree: tree["state"]["state"].update(key=[1, 2])),
        ("Philox", lambda tree: tree["state"].update(buffer_pos=-1)),
    ],
)
def test_a_forged_generator_is_refused(name: str, change: Any) -> None:
    tree = json.loads(decode(encode(generator(name, 1, 3)), str))
    change(tree)
    with pytest.raises(TypeError, match="no generator"):
        decode(encode(json.dumps(tree)), np.random.Generator)
