"""A solver's state as data and back, through a file: to the last bit, or an error that names the field."""

from __future__ import annotations

import json
import struct
from collections import Counter
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Optional

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from macs.solvers import checkpoint
from macs.solvers.packing import BIT_GENERATORS, pack, unpack


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
words = st.text(st.characters(exclude_categories=()), max_size=5)
arrays = st.one_of(
    hnp.arrays(st.sampled_from(DTYPES), hnp.array_shapes(min_dims=0, max_dims=3, min_side=0)),
    hnp.arrays("<U3", hnp.array_shapes(min_dims=1, max_dims=2, min_side=0), elements=st.text("aé\n ", max_size=3)),
).flatmap(lambda array: st.sampled_from([array, np.asfortranarray(array), array.T]))
numbers = st.floats() | st.sampled_from([0.0, -0.0, np.nan, np.inf, -np.inf, 5e-324])
leaves = st.builds(Leaf, arrays, numbers, st.integers(), st.booleans(), words, st.none() | arrays)
generators = st.builds(generator, st.sampled_from(BIT_GENERATORS), st.integers(0, 2**70), st.integers(0, 700))
trees = st.builds(
    Tree,
    leaf=leaves,
    leaves=st.lists(leaves, max_size=2),
    pair=st.tuples(st.integers(), arrays),
    many=st.lists(numbers, max_size=3).map(tuple),
    table=st.dictionaries(words, st.none() | leaves, max_size=2),
    tally=st.dictionaries(words, st.integers(), max_size=3).map(Counter),
    rng=generators,
    old=st.none() | st.integers(),
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


def through_file(value: Any, kind: Any) -> Any:
    arrays: dict[str, np.ndarray] = {}
    tree = pack(value, kind, arrays, "state")
    with TemporaryDirectory() as folder:
        file = Path(folder) / "run.ckpt"
        file.write_bytes(checkpoint.to_bytes({"state": tree}, arrays))
        document, arrays = checkpoint.read_file(file)
    value = unpack(document["state"], kind, arrays, "state")
    assert not arrays
    return value


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
    assert_same(through_file(tree, Tree), tree)


def test_a_packed_array_is_a_copy() -> None:
    array, arrays = np.zeros(3), {}
    pack(array, np.ndarray, arrays, "it")
    array[:] = 1
    assert not arrays["it"].any()


def test_one_array_in_two_fields_comes_back_as_two() -> None:
    array = np.zeros(2)
    leaf = through_file(Leaf(array, 1.0, 1, True, "a", array), Leaf)
    leaf.array[:] = 1
    assert leaf.maybe is not None and not leaf.maybe.any()


def test_scalars_of_numpy_come_back_as_pythons() -> None:
    leaf = Leaf(np.zeros(1), np.float64(0.1), np.int64(3), np.bool_(True), np.str_("a"))  # type: ignore[arg-type]
    assert_same(through_file(leaf, Leaf), Leaf(np.zeros(1), 0.1, 3, True, "a"))


@dataclass
class Loose:
    what: Any


@dataclass
class Either:
    what: int | str


@dataclass
class Bare:
    what: list


LEAF = {"array": np.zeros(2), "number": 1.0, "whole": 1, "flag": True, "word": "a"}


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (Leaf(**LEAF | {"array": [1.0]}), "state.array is list, ndarray expected"),
        (Leaf(**LEAF | {"array": np.array([{}])}), "state.array is an array of object"),
        (Leaf(**LEAF | {"array": np.ma.zeros(2)}), "state.array"),
        (Leaf(**LEAF | {"whole": 1.0}), "state.whole is float, int expected"),
        (Leaf(**LEAF | {"whole": True}), "state.whole is bool"),
        (Leaf(**LEAF | {"flag": 1}), "state.flag is int"),
        (Leaf(**LEAF | {"word": None}), "state.word is NoneType, str expected"),
        (Loose(1), r"state.what is annotated (typing.)?Any, which cannot be kept"),
        (Either(1), r"state.what is annotated int \| str"),
        (Bare([]), "state.what is annotated list"),
    ],
)
def test_what_is_no_state_is_refused(value: Any, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        pack(value, type(value), {}, "state")


def test_a_generator_of_unknown_kind_is_refused() -> None:
    class Own(np.random.PCG64):
        pass

    with pytest.raises(TypeError, match="rng draws from Own"):
        pack(np.random.Generator(Own(1)), np.random.Generator, {}, "rng")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"extra": 1}, "state.extra is unknown"),
        ({"word": ...}, "state.word is missing"),
        ({"number": "1.0"}, "state.number is str, float expected"),
        ({"array": 5}, "state.array"),
        ({"array": True}, "state.array"),
        ({"maybe": "None"}, "state.maybe"),
    ],
)
def test_a_tree_that_does_not_fit_is_refused(change: dict, message: str) -> None:
    arrays: dict[str, np.ndarray] = {}
    tree = pack(Leaf(**LEAF), Leaf, arrays, "state") | change
    with pytest.raises(TypeError, match=message):
        unpack({key: value for key, value in tree.items() if value is not ...}, Leaf, arrays, "state")


@pytest.mark.parametrize(
    "tree", [None, 3, {}, {"state": {"bit_generator": "RandomState"}}, {"state": {"bit_generator": "PCG64"}, "seeds": 1}]
)
def test_what_is_no_generator_is_refused(tree: Any) -> None:
    with pytest.raises(TypeError, match="rng is no generator"):
        unpack(tree, np.random.Generator, {}, "rng")


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
    tree = json.loads(json.dumps(pack(generator(name, 1, 3), np.random.Generator, {}, "rng")))
    unpack(tree, np.random.Generator, {}, "rng")
    change(tree)
    with pytest.raises(TypeError, match="rng is no generator"):
        unpack(tree, np.random.Generator, {}, "rng")
