"""Preferences of every class: as plain data and back, as functions of symbols, and what is wrong with one, in one line."""

import json
import math
import pickle
import warnings
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np
import pytest
from choices import cart, plain_front
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
    Ranges,
    ReferencePoint,
    Smaller,
    Value,
    WeightedSum,
    from_dict,
    to_dict,
)
from macs.preferences.catalogue import METHODS
from problems.compiled import Objective

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
        {"targets": {"time": {"class": "Around", "value": 2.0, "tolerance": [1.0, 3.0]}, "class": 4.0}, "tolerances": {"class": 1.0}}
        | {"aggregate": "sum"},
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


def test_nested_settings_defaults_and_classes_of_the_users_own() -> None:
    """A pair of tolerances of a target is what lies deepest."""
    pair = {"class": "Around", "value": 2.0, "tolerance": [1.0, 3.0]}
    assert from_dict({"method": "FuzzyGoal", "settings": {"targets": {"time": pair}}}) == FuzzyGoal({"time": Around(2.0, (1.0, 3.0))})
    for deeper in ([[1.0], 3.0], {"more": {"more": 1.0}}):
        with pytest.raises(ValueError, match=r"^FuzzyGoal: its settings are nested too deeply$"):
            from_dict({"method": "FuzzyGoal", "settings": {"targets": {"time": {**pair, "tolerance": deeper}}}})
    assert from_dict({"method": "ReferencePoint", "settings": {"aspiration": {"time": 2}}}) == ReferencePoint({"time": 2.0})
    # Numbers of numpy are numbers.
    front = cart(5)
    now = front[1]
    assert json.dumps(to_dict(Nimbus(now, improve=["time"], free=["effort"], augmentation=front.F[0, 0] / 10)))

    class Mine(WeightedSum):
        pass

    with pytest.raises(ValueError, match=r"^a Mine cannot be written down; there are WeightedSum"):
        to_dict(Mine({"time": 1.0}))


def physical(one: dict[str, Any]) -> dict[str, Any]:
    return {"method": "PhysicalProgramming", "settings": {"classes": {"time": one}}}


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
        (physical({"class": "os.system"}), "unknown class 'os.system'"),
        (physical({"class": "Smaller", "boundaries": [3, 2, 1, 0, -1]}), "the boundaries of Smaller must increase"),
        (physical({"class": "Smaller", "boundaries": [], "more": 1}), "PhysicalProgramming: Smaller: unknown key 'more'"),
        (physical({"class": "Larger"}), "PhysicalProgramming: the boundaries of Larger must be a list of numbers, not None"),
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


# What is wrong with a preference is said in one line that names it


BOTH = {"time": 2.0, "effort": 1.0}
NOW = {"time": 2.0, "effort": 1.5}


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: WeightedSum({}), "weights must be a dict by name"),
        (lambda: WeightedSum([1.0, 2.0]), "weights must be a dict by name"),
        (lambda: WeightedSum({1: 2.0}), "1 is no name"),
        (lambda: WeightedSum({"time": 0.0, "effort": 0.0}), "weights must not all be zero"),
        (lambda: WeightedSum({"time": -1.0}), "weights of 'time' must not be negative"),
        (lambda: WeightedSum({"time": math.nan}), "weights of 'time' must be finite"),
        (lambda: WeightedSum({"time": "much"}), "weights of 'time' must be a number"),
        (lambda: GoalProgramming({"time": None}), "the target of 'time' must be a number"),
        (lambda: GoalProgramming(BOTH, weights={"speed": 1.0}), "'speed' has a weight but no target"),
        (lambda: GoalProgramming(BOTH, weights={"time": 0.0}), "weights must not all be zero"),
        (lambda: GoalProgramming(BOTH, priorities=["time"]), "'effort' has a target but no priority"),
        (lambda: GoalProgramming(BOTH, priorities=["time", "time", "effort"]), "'time' is named twice"),
        (lambda: GoalProgramming(BOTH, priorities=["time", "speed", "effort"]), "'speed' has a priority but no target"),
        (lambda: GoalProgramming(BOTH, priorities="time"), "priorities must be a list of names"),
        (lambda: GoalProgramming(BOTH, priorities=[1]), "priorities must be a list of names"),
        (lambda: GoalProgramming({"time": Around(2.0, 0.1)}), "goal programming has no tolerances"),
        (lambda: Around(math.inf), "the value of Around must be finite"),
        (lambda: Around(1.0, 0.0), "the tolerance of Around must be positive"),
        (lambda: Around(1.0, (1.0, 2.0, 3.0)), "must be a number or a pair"),
        (lambda: FuzzyGoal(BOTH, aggregate="max"), "aggregate must be 'min' or 'sum'"),
        (lambda: FuzzyGoal(BOTH, tolerances={"speed": 1.0}), "'speed' has a tolerance but no target"),
        (lambda: FuzzyGoal(BOTH, tolerances={"time": -1.0}), "the tolerance of 'time' must be positive"),
        (lambda: FuzzyGoal({"time": Around(2.0)}, tolerances={"time": 1.0}), "the tolerance of 'time' belongs into its target"),
        (lambda: FuzzySatisfactory(BOTH, ["time"]), "at least two levels"),
        (lambda: FuzzySatisfactory({**BOTH, "speed": 1.0}, ["time", "effort"]), "'speed' has a target but no priority"),
        (lambda: FuzzySatisfactory(BOTH, ["time", "effort"], regulating=-0.1), "regulating must be in [0, inf)"),
        (lambda: FuzzySatisfactory(BOTH, ["time", "effort"], ordered=1), "ordered must be True or False"),
        (lambda: ReferencePoint({}), "the aspiration must be a dict by name"),
        (lambda: ReferencePoint(BOTH, augmentation=2.0), "augmentation must be in [0, 1]"),
        (lambda: Nimbus(NOW, free=["time", "effort"]), "an objective that is to become better"),
        (lambda: Nimbus(NOW, improve=["time"], keep=["effort"]), "an objective that may become worse"),
        (lambda: Nimbus(NOW, improve=["time"], free=["time", "effort"]), "'time' is in two classes"),
        (lambda: Nimbus(NOW, improve="time", free=["effort"]), "improve must be a list of names"),
        (lambda: Nimbus(NOW, improve=["time"], free=["effort"], enough=True), "values of `to` cannot be enough while others"),
        (lambda: Nimbus(NOW, to={"time": 1.5}, free=["effort"], enough=1), "enough must be True or False"),
        (lambda: GoalProgramming(3), "the targets must be a dict by name"),
        (lambda: Around(1.0, "12"), "the tolerance of Around must be a number"),
        (lambda: Around(1.0, (-1.0, 2.0)), "the tolerance of Around below must be positive"),
        (lambda: Around(1.0, (1.0, -2.0)), "the tolerance of Around above must be positive"),
        (lambda: FuzzySatisfactory(3, ["time", "effort"]), "the targets must be a dict by name"),
        (lambda: ReferencePoint(BOTH, {"time": "x"}), "the reservation of 'time' must be a number"),
        (lambda: Nimbus({"time": "x"}, improve=["time"]), "the current value of 'time' must be a number"),
        (lambda: Nimbus(NOW, to=[1.0]), "'to' must be a dict by name"),
        (lambda: Nimbus(NOW, until=[1.0]), "'until' must be a dict by name"),
        (lambda: Nimbus(NOW, improve=["time"], free=["effort"], augmentation=-0.1), "augmentation must be in [0, 1]"),
        (lambda: Smaller(1, 2, 3, 4), "Smaller needs 5 boundaries"),
        (lambda: Smaller(1, 2, 3, 3, 4), "the boundaries of Smaller must increase"),
        (lambda: Larger(1, 2, 3, 4, 5), "the boundaries of Larger must decrease"),
        (lambda: Value(1, 2, 3, 4, 5), "Value needs 9 boundaries"),
        (lambda: Range(1, 2, 3, 4, 5, 5, 6, 7, 8, 9), "the boundaries of Range must increase"),
        (lambda: Smaller(1, 2, math.nan, 4, 5), "a boundary of Smaller must be finite"),
        (lambda: PhysicalProgramming({"time": 2.0}), "the class of 'time' must be Smaller, Larger, Value or Range"),
        (lambda: PhysicalProgramming({}), "classes must be a dict by name"),
        (lambda: PhysicalProgramming({"time": Smaller(1, 2, 3, 4, 5)}, beta=1.0), "beta must be in (1, inf)"),
        (lambda: FuzzyPhysicalProgramming({"time": Smaller(1, 2, 3, 4, 5)}, spread=0.0), "spread must be positive"),
        (lambda: FuzzyPhysicalProgramming({"time": Smaller(1, 2, 3, 4, 5)}, spread={"effort": 1.0}), "'effort' has a spread but no class"),
        (lambda: FuzzyPhysicalProgramming({"time": Smaller(1, 2, 3, 4, 5)}, printed="yes"), "printed must be True or False"),
        (lambda: Ranges({"time": 1.0}, {"effort": 2.0}), "ranges need the best and the worst value of 'effort'"),
        (lambda: Ranges({"time": math.inf}, {"time": 2.0}), "best of 'time' must be finite"),
        (lambda: Ranges.of([1, 2]), "ranges are those of a front"),
    ],
)
def test_what_is_wrong_alone(make, words):
    with pytest.raises(ValueError) as caught:
        make()
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: WeightedSum({"tyme": 1.0}), "unknown objective 'tyme', did you mean time?"),
        (lambda: GoalProgramming({"speed": 1.0}), "unknown objective 'speed'"),
        (lambda: GoalProgramming({"time": 1.0}), "the target of 'time', 1 s, lies beyond its range: best 1.2 s, worst 4 s"),
        (lambda: GoalProgramming({"time": Around(5.0)}), "the target of 'time', 5 s, lies beyond its range"),
        (lambda: FuzzyGoal({"effort": 1e10}), "the target of 'effort', 1e+10 m²/s³, lies beyond its range"),
        (lambda: FuzzyGoal({"time": 4.0}), "the target of 'time', 4 s, is the end of its range"),
        (lambda: FuzzyGoal({"time": Around(1.2)}), "the target of 'time', 1.2 s, is the end of its range"),
        (lambda: FuzzySatisfactory({}, ["time", "mass"]), "unknown objective 'mass'"),
        (lambda: ReferencePoint({"time": 0.5}), "the aspiration of 'time', 0.5 s, lies beyond its range"),
        (lambda: ReferencePoint({"time": 2.0}, {"time": 9.0}), "the reservation of 'time', 9 s, lies beyond its range"),
        (lambda: ReferencePoint({"time": 2.0}, {"time": 1.5}), "the reservation of 'time', 1.5 s, must be worse than its aspiration, 2 s"),
        (lambda: ReferencePoint({"time": 2.0}, {"mass": 1.5}), "unknown objective 'mass'"),
        (lambda: Nimbus({"time": 2.0}, improve=["time"], free=["effort"]), "the current point of Nimbus has no 'effort'"),
        (lambda: Nimbus(NOW, improve=["time"], free=["mass"]), "unknown objective 'mass'"),
        (lambda: Nimbus({**NOW, "mass": 1.0}, improve=["time"], free=["effort"]), "unknown objective 'mass'"),
        (lambda: Nimbus(NOW, improve=["time"], until={"effort": 1.0}), "may become worse until 1 m²/s³, which is better than 1.5 m²/s³"),
        (lambda: Nimbus(NOW, to={"time": 3.0}, free=["effort"]), "'time' is to improve to 3 s, which is not better than 2 s"),
        (lambda: Nimbus(NOW, to={"time": 1.0}, free=["effort"]), "the value in `to` of 'time', 1 s, lies beyond its range"),
        (lambda: PhysicalProgramming({"mass": Smaller(1, 2, 3, 4, 5)}), "unknown objective 'mass'"),
        (lambda: PhysicalProgramming({"time": Larger(5, 4, 3, 2, 1)}), "'time' is minimized, so that it cannot be of class Larger"),
        (lambda: PhysicalProgramming({"time": Smaller(1, 1 + 1e-15, 3, 4, 5)}), "lengths of ranges differ too much"),
    ],
)
def test_what_is_wrong_for_a_front(make, words):
    front, preference = cart(11), make()
    with pytest.raises(ValueError) as caught:
        preference.rank(front)
    assert words in str(caught.value) and "\n" not in str(caught.value)


# Each stage gives the same for numbers and as a function of CasADi symbols, whose derivatives are finite


GOALS = [Objective("time", "s"), Objective("effort", "m²/s³"), Objective("speed", "m/s", "maximize")]
RNG = np.random.default_rng(0)
T = RNG.uniform(1.2, 4.0, 20)
FRONT = plain_front(np.column_stack([T, 12 / T**3, RNG.uniform(10, 20, 20)]), GOALS)
RANGES = Ranges({"time": 1.2, "effort": 0.1875, "speed": 20.0}, {"time": 4.0, "effort": 12 / 1.2**3, "speed": 10.0})
CLASSES = {
    "time": Smaller(1.0, 1.5, 2.5, 3.0, 4.5),
    "effort": Range(-1, -0.5, 0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0),
    "speed": Larger(25, 15, 13, 12, 9),
}
PREFERENCES = [
    WeightedSum({"time": 1.0, "speed": 2.0}),
    GoalProgramming({"time": 2.0, "speed": 15.0}, weights={"time": 3.0}),
    GoalProgramming({"time": 2.0, "speed": Around(15.0), "effort": 1.0}, priorities=["speed", ("time", "effort")]),
    FuzzyGoal({"time": 2.0, "speed": 15.0, "effort": Around(1.0, (0.5, 6.0))}),
    FuzzyGoal({"time": 2.0, "speed": 15.0, "effort": Around(1.0)}, tolerances={"speed": 6.0}, aggregate="sum"),
    FuzzySatisfactory({}, ["time", "speed", "effort"]),
    FuzzySatisfactory({"time": 2.0, "speed": Around(15.0)}, [("time", "speed"), "effort"], ordered=True),
    ReferencePoint({"time": 2.0, "speed": 15.0}, {"time": 3.0}),
    Nimbus({"time": 2.0, "effort": 1.5, "speed": 15.0}, improve=["time"], to={"speed": 18.0}, until={"effort": 5.0}),
    Nimbus({"time": 2.0, "effort": 1.5, "speed": 15.0}, improve=["time"], keep=["speed"], free=["effort"]),
    PhysicalProgramming(CLASSES),
    PhysicalProgramming({"speed": Value(8, 10, 12, 14, 15, 16, 17, 19, 22)}),
    FuzzyPhysicalProgramming(CLASSES, spread=0.3),
    FuzzyPhysicalProgramming(CLASSES, spread=0.3, printed=True),
]


CASES = [(kind, one) for one in PREFERENCES for kind in ((ca.SX,) if isinstance(one, FuzzyPhysicalProgramming) else (ca.SX, ca.MX))]
"""Quadrature has hundreds of operations, which as matrices take seconds."""


@pytest.mark.parametrize(("kind", "preference"), CASES, ids=lambda one: getattr(one, "__name__", type(one).__name__))
def test_numbers_and_symbols_agree(preference, kind):
    symbols = [kind.sym(goal.name) for goal in GOALS]
    J = FRONT.objectives
    for stage in preference.stages(GOALS, RANGES):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            groups, limits = stage.groups(symbols), stage.limits(symbols)
            peaks = [reduce(ca.fmax, group) for group in groups]
            value = stage.value(symbols, peaks)
            numbers = stage.numbers(J)
        assert len(stage.limit_names) == len(limits)
        gradient = ca.gradient(value, ca.vertcat(*symbols)) if kind is ca.SX else ca.vertcat(*(ca.jacobian(value, one) for one in symbols))
        function = ca.Function("stage", symbols, [value, ca.vertcat(0, *limits), gradient])
        for row, number in zip(J, numbers, strict=True):
            found, excess, slopes = (np.array(one).ravel() for one in function(*row))
            assert np.isfinite(slopes).all()
            if excess.max() > 1e-6:
                assert number == np.inf
            else:
                assert number == pytest.approx(found[0], rel=1e-12, abs=1e-13)


SLOW = [pytest.param(one, marks=[pytest.mark.slow] * isinstance(one, FuzzyPhysicalProgramming)) for one in PREFERENCES]


@pytest.mark.parametrize("preference", SLOW, ids=lambda one: type(one).__name__)
def test_values_rise_with_their_peaks_and_gradients_agree_with_differences(preference):
    """What gradient solves rely on: a variable that is not less than any of a group may stand for its peak."""
    symbols = [ca.SX.sym(goal.name) for goal in GOALS]
    for stage in preference.stages(GOALS, RANGES):
        peaks = [ca.SX.sym(f"peak{k}") for k in range(len(stage.groups(symbols)))]
        value = stage.value(symbols, peaks)
        function = ca.Function("value", [ca.vertcat(*symbols), ca.vertcat(*peaks)], [value])
        slopes = ca.Function("slopes", [ca.vertcat(*symbols), ca.vertcat(*peaks)], [ca.gradient(value, ca.vertcat(*symbols, *peaks))])
        printed = getattr(preference, "printed", False)
        for row in FRONT.objectives[:5]:
            at = np.linspace(-0.3, 0.7, len(peaks))
            found = np.array(slopes(row, at)).ravel()
            assert np.all(found[len(GOALS) :] >= 0)
            for k in range(0 if printed else len(GOALS)):
                step = 1e-5 * np.eye(len(GOALS))[k]
                difference = float(function(row + step, at) - function(row - step, at)) / 2e-5
                assert found[k] == pytest.approx(difference, rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("preference", PREFERENCES, ids=lambda one: type(one).__name__)
def test_preferences_go_to_other_processes(preference):
    stages = preference.stages(GOALS, RANGES)
    other = pickle.loads(pickle.dumps(preference))
    assert other == preference
    for one, two in zip(stages, other.stages(GOALS, RANGES), strict=True):
        assert np.array_equal(one.numbers(FRONT.objectives), two.numbers(FRONT.objectives))
