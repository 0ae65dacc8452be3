"""Schemas of plain data: errors of one line that name the key, the value and the nearest known word."""

import msgspec
import numpy as np
import pytest

from runs.files import Count, Number, Positive, Section, Text, checked, from_record, to_record


class Bird(Section, tag="bird", tag_field="of"):
    name: Text
    wings: Count = 2


class Fish(Section, tag="fish", tag_field="of"):
    depths: list[Number]

    def __post_init__(self) -> None:
        if len(self.depths) > 2:
            raise ValueError("a fish has one or two depths")


class Zoo(Section):
    animals: list[Bird | Fish]
    area: Positive | None = None
    prices: dict[str, Number] = {}  # noqa: RUF012 - msgspec copies it


BIRD = {"of": "bird", "name": "wren"}


def test_values_of_numpy_are_numbers_and_lists():
    zoo = checked({"animals": [{"of": "fish", "depths": np.array([1.0, 2.0])}], "area": np.float64(3)}, Zoo)
    assert zoo == Zoo(animals=[Fish(depths=[1.0, 2.0])], area=3.0)
    assert checked(np.int64(3), Count) == 3 and checked((1, 2.5), list[Number]) == [1.0, 2.5]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (3, "zoo must be a table with animals, area, prices, not 3"),
        ({}, "animals is missing"),
        ({"animals": [], "aera": 1}, "unknown key 'aera', did you mean area?"),
        ({"animals": [BIRD, 1]}, "animals 2 must be a table, not 1"),
        ({"animals": [{"of": "brid"}]}, "animals 1: of must be one of bird, fish, not 'brid'"),
        ({"animals": [BIRD, {**BIRD, "wing": 1}]}, "animals 2: unknown key 'wing', did you mean wings?"),
        ({"animals": [{**BIRD, "wings": 0}]}, "animals 1: wings must be a whole number of at least 1, not 0"),
        ({"animals": [{"of": "fish", "depths": [1, np.nan]}]}, "animals 1: depths 2 must be a finite number, not nan"),
        ({"animals": [{"of": "fish", "depths": [1, 2, 3]}]}, "animals 1: a fish has one or two depths"),
        ({"animals": [], "area": -1}, "area must be a positive number, not -1"),
        ({"animals": [], "prices": {"adult": "x"}}, "prices must be a table whose entries are each a finite number, not {'adult': 'x'}"),
        ({"animals": "x" * 500}, f"animals must be a list, not '{'x' * 79}"),
    ],
)
def test_errors_are_one_line_in_the_users_words(value, message):
    with pytest.raises(ValueError) as refused:
        checked(value, Zoo, "zoo")
    said = str(refused.value)
    assert said.startswith(message) and "\n" not in said and not isinstance(refused.value, msgspec.ValidationError)


def test_records_come_back_or_are_refused():
    content = {"a": [1, 2.5, float("inf")], "b": {"c": None}}
    assert from_record(to_record(content)) == from_record(to_record(content, indent=1)) == content
    for damaged in (b"", b"[1]", b"[" * 10_000, to_record(content).replace(b"2.5", b"2.6"), b"\xff", to_record(content)[:-5]):
        with pytest.raises(ValueError) as refused:
            from_record(damaged)
        assert "\n" not in str(refused.value)
