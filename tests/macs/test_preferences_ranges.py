"""Ranges of objectives: best and worst values by name, in the user's units and senses, and how objectives are normalised by them."""

import numpy as np
import pytest
from choices import plain_front
from synthetic_fronts import marked

from macs.decisions import Ranges
from macs.preferences.ranges import confidence
from problems.compiled import Objective

GOALS = (Objective("cost"), Objective("speed", "m/s", "maximize"))
RANGES = Ranges({"cost": 2.0, "speed": 30.0}, {"cost": 6.0, "speed": 10.0})


def test_best_and_worst_follow_the_senses_and_are_normalised_to_0_and_1():
    found = Ranges.over(GOALS, np.array([[3.0, 20.0], [2.0, 10.0], [6.0, 30.0], [4.0, 15.0]]))
    assert found == RANGES
    assert found.to_dict() == {"best": {"cost": 2.0, "speed": 30.0}, "worst": {"cost": 6.0, "speed": 10.0}}
    assert Ranges(**found.to_dict()) == found
    best, worst = RANGES.ends(GOALS)
    assert best.tolist() == [2.0, 30.0] and worst.tolist() == [6.0, 10.0]
    assert RANGES.spans(GOALS).tolist() == [4.0, 20.0]
    assert RANGES.normalised(GOALS, [2.0, 30.0]) == [0.0, 0.0]
    assert RANGES.normalised(GOALS, [6.0, 10.0]) == [1.0, 1.0]
    assert RANGES.normalised(GOALS, [3.0, 25.0]) == [0.25, 0.25]
    flat = Ranges({"cost": 5.0, "speed": 0.0}, {"cost": 5.0, "speed": 0.0})
    assert flat.spans(GOALS).tolist() == [5.0, 1.0]
    assert flat.normalised(GOALS, [7.5, -3.0]) == [0.5, 3.0]
    assert Ranges({"cost": 5.0, "speed": 1e-3}, {"cost": 5.5, "speed": 0.0}).spans(GOALS).tolist() == [0.5, 1e-3]
    assert Ranges({"cost": -5.0, "speed": 0.5}, {"cost": -5.0, "speed": 0.5}).spans(GOALS).tolist() == [5.0, 0.5]


@pytest.mark.parametrize("sense", ["minimize", "maximize"])
def test_zero_has_no_sign(sense):
    """A maximised objective of zero would be shown as -0."""
    goals = (Objective("speed", "", sense),)
    for found in (Ranges.over(goals, np.array([[-0.0], [-0.0]])), Ranges.of(plain_front(np.array([[-0.0]]), list(goals)))):
        assert [str(value) for value in (found.best["speed"], found.worst["speed"])] == ["0.0", "0.0"]


def test_what_ranges_have_to_name():
    with pytest.raises(ValueError, match="the ranges have no 'speed'; they have cost"):
        Ranges({"cost": 1.0}, {"cost": 2.0}).ends(GOALS)
    with pytest.raises(ValueError, match="haste"):
        Ranges({"cost": 1.0, "speed": 2.0, "haste": 0.0}, {"cost": 2.0, "speed": 1.0, "haste": 1.0}).ends(GOALS)
    with pytest.raises(ValueError, match="'cost' is minimized"):
        Ranges({"cost": 3.0, "speed": 2.0}, {"cost": 2.0, "speed": 1.0}).ends(GOALS)
    with pytest.raises(ValueError, match="'speed' is maximized"):
        Ranges({"cost": 0.0, "speed": 1.0}, {"cost": 1.0, "speed": 2.0}).ends(GOALS)


def test_a_value_lies_within_a_range_as_far_as_solves_find_ends():
    for inside in (2.0, 6.0, 2.0 - 1e-9, 4.0):
        RANGES.check(inside, GOALS[0], "the aim")
    for outside in (1.9999, 6.0001):
        with pytest.raises(ValueError, match=r"the aim of 'cost', .*, lies beyond its range: best 2, worst 6"):
            RANGES.check(outside, GOALS[0], "the aim")
    # One without width says nothing of values.
    Ranges({"cost": 5.0}, {"cost": 5.0}).check(9.0, GOALS[0], "the aim")
    with pytest.raises(ValueError, match="best 30 m/s, worst 10 m/s"):
        RANGES.check(31.0, GOALS[1], "the aim")


def rows(*objectives, **columns):
    return plain_front(np.array(objectives, dtype=float), list(GOALS), **columns)


def test_ranges_of_a_front_are_those_of_its_feasible_points_that_no_other_dominates():
    front = rows((1.0, 10.0), (2.0, 30.0), (3.0, 20.0), (0.0, 99.0), status=["converged"] * 3 + ["infeasible"])
    assert Ranges.of(front) == Ranges({"cost": 1.0, "speed": 30.0}, {"cost": 2.0, "speed": 10.0})
    front = rows((1.0, 10.0), (2.0, 30.0), (3.0, 40.0))
    assert Ranges.of(marked(front, [True, True, False])).worst["cost"] == 2.0
    assert Ranges.of(marked(front, [True, False, False])).worst["cost"] == 3.0
    assert Ranges.of(marked(front, [False, False, False])).worst["cost"] == 3.0
    payoff = front.replace(solver={"name": "payoff", "settings": {}})
    assert Ranges.of(marked(payoff, [True, True, False])).worst["cost"] == 3.0, "a payoff table keeps all its ends"
    with pytest.raises(ValueError, match=r"^the front has no feasible point, so that it has no ranges$"):
        Ranges.of(rows((1.0, 1.0), status=["failed"]))
    with pytest.raises(ValueError, match=r"^the front has no feasible point, so that it has no ranges: nothing there$"):
        Ranges.of(rows((1.0, 1.0), status=["failed"]).replace(message="nothing there"))
    front = marked(plain_front(np.array([[1.0, 9.0], [2.0, 5.0], [3.0, np.inf], [4.0, 1.0]]), GOALS), [True, False, True, True])
    assert confidence(front).tolist() == [0, 1, 2, 0]
