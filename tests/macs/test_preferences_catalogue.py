"""Preferences as plain data and back, for every class; what is no preference is refused in one line."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import pytest
from choices import cart
from hypothesis import given, settings
from hypothesis import strategies as st

from macs.decisions import (
    Around,
    FuzzyGoal,
    FuzzyPhysicalProgramming,
    FuzzySatisfactory,
    GoalProgramming,
    Larger,
    Nimbus,
    PhysicalProgramming,
    Preference,
    Range,
    ReferencePoint,
    Smaller,
    Value,
    WeightedSum,
    from_dict,
    to_dict,
)
from macs.preferences.catalogue import METHODS

number = st.floats(-1e12, 1e12)
positive = st.floats(1e-9, 1e9)
name = st.sampled_from(["time", "effort", "class", "method", "höchste Last [g]"])


def named(values: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    return st.dictionaries(name, values, min_size=1)


def rising(count: int) -> st.SearchStrategy[list[float]]:
    return st.lists(st.integers(-(10**9), 10**9).map(float), min_size=count, max_size=count, unique=True).map(sorted)


around = st.builds(Around, number, st.none() | positive | st.tuples(positive, positive))
target = number | around
one_class = (
    rising(5).map(Smaller)
    | rising(5).map(lambda found: Larger(found[::-1]))
    | rising(9).map(Value)
    | rising(10).map(Range)
)  # fmt: skip


@st.composite
def goal_programming(draw: Any) -> GoalProgramming:
    targets = draw(named(number | st.builds(Around, number)))
    weights = draw(st.none() | st.fixed_dictionaries(dict.fromkeys(targets, positive)))
    priorities = draw(st.none() | st.permutations([*targets]).map(lambda found: [tuple(found[:1]), *found[1:]]))
    return GoalProgramming(targets, weights, priorities)


@st.composite
def fuzzy_goal(draw: Any) -> FuzzyGoal:
    targets = draw(named(target))
    plain = [one for one, value in targets.items() if not isinstance(value, Around)]
    tolerances = draw(st.fixed_dictionaries(dict.fromkeys(plain, positive))) if plain else None
    return FuzzyGoal(targets, tolerances, draw(st.sampled_from(["min", "sum"])))


@st.composite
def fuzzy_satisfactory(draw: Any) -> FuzzySatisfactory:
    names = draw(st.lists(name, min_size=2, unique=True))
    cut = draw(st.integers(1, len(names) - 1))
    targets = {one: draw(target) for one in names if draw(st.booleans())}
    return FuzzySatisfactory(targets, [tuple(names[:cut]), *names[cut:]], draw(st.floats(0, 10)), draw(st.booleans()))


@st.composite
def nimbus(draw: Any) -> Nimbus:
    names = draw(st.permutations(["time", "effort", "heat", "class"]))
    now = {one: draw(number) for one in names}
    if draw(st.booleans()):
        return Nimbus(now, improve=names[:1], keep=names[1:2], until={names[2]: draw(number)}, free=names[3:])
    return Nimbus(now, to={names[0]: draw(number)}, free=names[1:], augmentation=draw(st.floats(0, 1)), enough=draw(st.booleans()))


@st.composite
def fuzzy_physical(draw: Any) -> FuzzyPhysicalProgramming:
    classes = draw(named(one_class))
    spread = draw(positive | st.fixed_dictionaries(dict.fromkeys(classes, positive)))
    return FuzzyPhysicalProgramming(classes, draw(st.floats(1.01, 9)), spread=spread, printed=draw(st.booleans()))


EVERY: dict[type[Preference], st.SearchStrategy[Preference]] = {
    WeightedSum: st.builds(WeightedSum, named(positive)),
    GoalProgramming: goal_programming(),
    FuzzyGoal: fuzzy_goal(),
    FuzzySatisfactory: fuzzy_satisfactory(),
    ReferencePoint: st.builds(ReferencePoint, named(number), st.none() | named(number), st.floats(0, 1)),
    Nimbus: nimbus(),
    PhysicalProgramming: st.builds(PhysicalProgramming, named(one_class), st.floats(1.01, 9)),
    FuzzyPhysicalProgramming: fuzzy_physical(),
}


def test_the_table_has_every_class() -> None:
    def below(kind: type) -> set[type]:
        return {kind, *(one for child in kind.__subclasses__() for one in below(child))}

    found = {kind for kind in below(Preference) - {Preference} if kind.__module__.startswith("macs.preferences")}
    assert found == set(METHODS.values()) == set(EVERY)


@pytest.mark.slow
@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
def test_round_trip(kind: type[Preference]) -> None:
    @settings(max_examples=60, deadline=None)
    @given(EVERY[kind])
    def check(preference: Preference) -> None:
        again = from_dict(json.loads(json.dumps(to_dict(preference), allow_nan=False)))
        assert type(again) is kind and again == preference and repr(again) == repr(preference)

    check()


EXAMPLES: list[tuple[Preference, dict[str, Any]]] = [
    (
        FuzzyGoal({"time": Around(2.0, (1.0, 3.0)), "class": 4.0}, {"class": 1.0}, "sum"),
        {
            "targets": {"time": {"class": "Around", "value": 2.0, "tolerance": [1.0, 3.0]}, "class": 4.0},
            "tolerances": {"class": 1.0},
            "aggregate": "sum",
        },
    ),
    (
        PhysicalProgramming({"time": Smaller(1, 2, 3, 4, 5), "class": Value(1, 2, 3, 4, 5, 6, 7, 8, 9)}, beta=3.0),
        {
            "classes": {
                "time": {"class": "Smaller", "boundaries": [1.0, 2.0, 3.0, 4.0, 5.0]},
                "class": {"class": "Value", "boundaries": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]},
            },
            "beta": 3.0,
        },
    ),
]


@pytest.mark.parametrize(("preference", "settings_of_it"), EXAMPLES, ids=lambda one: type(one).__name__)
def test_what_is_written_is_what_a_file_says_and_is_read_again(preference: Preference, settings_of_it: dict[str, Any]) -> None:
    data = to_dict(preference)
    assert data["method"] == type(preference).__name__ and data["settings"] == settings_of_it
    assert json.loads(json.dumps(data)) == data and from_dict(data) == preference


def test_settings_are_nested_as_deep_as_targets_on_both_sides_and_no_deeper() -> None:
    """A pair of tolerances of a target is what lies deepest."""
    pair = {"class": "Around", "value": 2.0, "tolerance": [1.0, 3.0]}
    assert from_dict({"method": "FuzzyGoal", "settings": {"targets": {"time": pair}}}) == FuzzyGoal({"time": Around(2.0, (1.0, 3.0))})
    for deeper in ([[1.0], 3.0], {"more": {"more": 1.0}}):
        with pytest.raises(ValueError, match=r"^FuzzyGoal: its settings are nested too deeply$"):
            from_dict({"method": "FuzzyGoal", "settings": {"targets": {"time": {**pair, "tolerance": deeper}}}})


def test_what_is_left_out_has_its_default() -> None:
    assert from_dict({"method": "ReferencePoint", "settings": {"aspiration": {"time": 2}}}) == ReferencePoint({"time": 2.0})
    # Numbers of numpy are numbers.
    front = cart(5)
    now = front[1]
    assert json.dumps(to_dict(Nimbus(now, improve=["time"], free=["effort"], augmentation=front.F[0, 0] / 10)))


GOOD = {"method": "ReferencePoint", "settings": {"aspiration": {"time": 2.0}}}
DEEP: dict[str, Any] = {}
for _ in range(2000):
    DEEP = {"a": DEEP}


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (None, "a preference must be a table of method, settings, not None"),
        ({}, "unknown preference None; there are WeightedSum"),
        ({**GOOD, "method": "Referencepoint"}, "unknown preference 'Referencepoint', did you mean ReferencePoint?"),
        ({**GOOD, "more": 1}, "a preference: unknown key 'more'"),
        ({**GOOD, "settings": 3}, "ReferencePoint must be a table of aspiration, reservation, augmentation, not 3"),
        ({**GOOD, "settings": {"aspirations": {"time": 2.0}}}, "ReferencePoint: unknown key 'aspirations', did you mean aspiration?"),
        ({**GOOD, "settings": {}}, "ReferencePoint: 'aspiration' is missing"),
        ({**GOOD, "settings": {"aspiration": {"time": "2"}}}, "ReferencePoint: the aspiration of 'time' must be a number, not '2'"),
        ({**GOOD, "settings": {"aspiration": {"time": True}}}, "ReferencePoint: True is no number"),
        ({**GOOD, "settings": {"aspiration": {"time": float("nan")}}}, "must be finite"),
        ({**GOOD, "settings": {"aspiration": {"a\nb": "2"}}}, "ReferencePoint: the aspiration of 'a b' must be a number"),
        ({**GOOD, "settings": {"aspiration": DEEP}}, "nested too deeply"),
        ({"method": "PhysicalProgramming", "settings": {"classes": {"time": {"class": "os.system"}}}}, "unknown class 'os.system'"),
        (
            {"method": "PhysicalProgramming", "settings": {"classes": {"time": {"class": "Smaller", "boundaries": [3, 2, 1, 0, -1]}}}},
            "the boundaries of Smaller must increase",
        ),
        (
            {"method": "PhysicalProgramming", "settings": {"classes": {"time": {"class": "Smaller", "boundaries": [], "more": 1}}}},
            "PhysicalProgramming: Smaller: unknown key 'more'",
        ),
        (
            {"method": "PhysicalProgramming", "settings": {"classes": {"time": {"class": "Larger"}}}},
            "PhysicalProgramming: the boundaries of Larger must be a list of numbers, not None",
        ),
        ("x" * 500, "a preference must be a table of method, settings, not 'xxx"),
        ({"method": "FuzzyGoal", "settings": {"targets": {"time": {"class": "Around", "vale": 2}}}}, "Around: unknown key 'vale'"),
        ({"method": "FuzzySatisfactory", "settings": {"targets": 0, "priorities": ["a", "b"]}}, "the targets must be a dict by name"),
        ({"method": "Nimbus", "settings": {"current": {"a": 1, "b": 2}, "to": 0, "improve": ["a"], "free": ["b"]}}, "'to' must be a dict"),
    ],
)
def test_what_is_no_preference(data: Any, words: str) -> None:
    with pytest.raises(ValueError) as caught:
        from_dict(data)
    assert words in str(caught.value) and "\n" not in str(caught.value) and len(str(caught.value)) < 400


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3) | name,
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(name | st.text(max_size=3), inner, max_size=3),
    max_leaves=12,
)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(st.data())
def test_anything_else_is_refused_or_read(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from([*EVERY]))
    good = to_dict(data.draw(EVERY[kind]))
    good["settings"][data.draw(st.sampled_from([*good["settings"]]))] = data.draw(plain)
    try:
        again = from_dict(good)
    except ValueError as error:
        assert "\n" not in str(error)
    else:
        assert from_dict(json.loads(json.dumps(to_dict(again)))) == again


def test_a_class_of_the_users_own_is_not_written() -> None:
    @dataclass(frozen=True)
    class Mine(WeightedSum):
        pass

    with pytest.raises(ValueError, match=r"^a Mine cannot be written down; there are WeightedSum"):
        to_dict(Mine({"time": 1.0}))
