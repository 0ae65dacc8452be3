"""What is wrong with a preference is said in one line that names it."""

from __future__ import annotations

import math

import pytest
from choices import cart

from macs.decisions import (
    Around,
    FuzzyGoal,
    FuzzyPhysicalProgramming,
    FuzzySatisfactory,
    GoalProgramming,
    Larger,
    Nimbus,
    PhysicalProgramming,
    Range,
    Ranges,
    ReferencePoint,
    Smaller,
    Value,
    WeightedSum,
)

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
        (
            lambda: PhysicalProgramming({"time": Smaller(1, 1 + 1e-15, 3, 4, 5)}),
            "lengths of ranges differ too much for physical programming",
        ),
    ],
)
def test_what_is_wrong_for_a_front(make, words):
    front, preference = cart(11), make()
    with pytest.raises(ValueError) as caught:
        preference.rank(front)
    assert words in str(caught.value) and "\n" not in str(caught.value)
