"""Hard limits on their own: all of them in one stage, what is within them, and what is said where no point is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from choices import plain_front

from macs.decisions import Stage
from macs.preferences.preference import keeps_limits, within_limits
from macs.preferences.stage import LIMIT_TOL, conflict_message, excess_stage, with_all_limits
from problems.compiled import Objective

TIME, MASS = Objective("time", "s"), Objective("mass")


def limited(name: str, *bounds: tuple[int, float, str], unnamed: bool = False) -> Stage:
    """A stage with the value of the first objective, and upper limits of some."""
    names = () if unnamed else tuple(words for _, _, words in bounds)
    return Stage(name, lambda J, peaks: J[0], limits=lambda J: [J[i] - most for i, most, _ in bounds], limit_names=names)


def at(*objectives: float, **columns: Any) -> Any:
    """A point with these objectives."""
    return plain_front(np.array([objectives]), [TIME, MASS], **columns)[0]


# All limits in one stage


def test_the_first_stage_has_the_limits_of_all_each_once_and_the_others_have_none() -> None:
    stages = [
        limited("one", (0, 3.0, "time at most 3")),
        limited("two", (0, 3.0, "time at most 3"), (1, 5.0, "mass at most 5")),
        limited("three", (1, 4.0, "mass at most 4")),
    ]
    first, *others = with_all_limits(stages, 2)
    assert first.limit_names == ("time at most 3", "mass at most 5", "mass at most 4")
    J = np.array([[7.0, 10.0], [1.0, 4.5]])
    assert first.excesses(J).tolist() == [[4.0, 5.0, 6.0], [-2.0, -0.5, 0.5]]
    assert [one.name for one in (first, *others)] == ["one", "two", "three"]
    for one in others:
        assert one.limit_names == () and not one.excess(J).any() and one.numbers(J).tolist() == [7.0, 1.0]


def test_limits_without_names_are_numbered_from_one() -> None:
    stage = limited("cheap", (0, 3.0, ""), (1, 5.0, ""), unnamed=True)
    (found,) = with_all_limits([stage], 2)
    assert found.limit_names == ("limit 1 of cheap", "limit 2 of cheap")
    assert found.excesses(np.array([[4.0, 7.0]])).tolist() == [[1.0, 2.0]]


def test_limits_without_names_are_all_kept_also_where_stages_have_one_name() -> None:
    """They were taken for one limit, and the second was lost."""
    found = with_all_limits([limited("level", (0, 3.0, ""), unnamed=True), limited("level", (1, 5.0, ""), unnamed=True)], 2)[0]
    assert found.excesses(np.array([[0.0, 7.0]])).tolist() == [[-3.0, 2.0]]
    assert not within_limits(found, at(0.0, 7.0))


def test_the_stage_of_the_excess_is_the_largest_and_is_called_so_in_a_history() -> None:
    stage = excess_stage(limited("cheap", (0, 3.0, "short"), (1, 5.0, "light")))
    assert stage.name == "largest excess over hard limits"
    assert stage.numbers(np.array([[4.0, 7.0], [5.5, 7.0], [0.0, 1.0]])).tolist() == [2.0, 2.5, -3.0]


# Within them


@pytest.mark.parametrize(("share", "within"), [(-1.0, True), (0.0, True), (1.0, True), (1.1, False), (1e6, False)])
def test_rounding_does_not_count_as_beyond_a_limit(share: float, within: bool) -> None:
    """What is met has a value, what is not has none: both are told by the same slack, exactly."""
    stage, point = limited("cheap", (0, 0.0, "time at most 0")), at(share * LIMIT_TOL, 1.0)
    assert within_limits(stage, point) is within
    assert keeps_limits(stage, point, 1e-3) is within
    assert np.isfinite(stage.numbers(np.array([[*point.objectives.values()]]))[0]) == within


def test_what_was_simulated_keeps_a_limit_as_far_as_simulations_may_miss_it() -> None:
    """A point of a time of 2 that flies 3.05: half a tenth beyond the limit of 3."""
    stage = limited("cheap", (0, 3.0, "time at most 3"))
    flown = {"defect": [0.5], "simulated_violation": [0.0], "simulated_F": [[3.05, 1.0]], "verified": [False]}
    point = at(2.0, 1.0, **flown)
    assert point.verified is False and within_limits(stage, point)
    assert keeps_limits(stage, point, 0.1) and not keeps_limits(stage, point, 0.01)


# What is said


def test_only_limits_in_conflict_are_named_and_what_the_nearest_misses() -> None:
    """Limits are in conflict that are exceeded at least half as much as the one that is exceeded most."""
    stage = limited("cheap", (0, 3.0, "time at most 3 s"), (1, 5.0, "mass at most 5"), (1, 5.5, "mass at most 5.5"))
    assert conflict_message(stage, (TIME, MASS), np.array([4.0, 7.0])) == (
        "no point was found that meets all of: time at most 3 s, mass at most 5, mass at most 5.5; the nearest has time 4 s, mass 7:"
        " 'time at most 3 s' is missed by 1 s, 'mass at most 5' is missed by 2, 'mass at most 5.5' is missed by 1.5"
    )
    words = conflict_message(stage, (TIME, MASS), np.array([3.99, 7.0]))
    assert "meets all of: mass at most 5, mass at most 5.5;" in words and "'time at most 3 s' is missed by 0.99 s" in words


@pytest.mark.parametrize(("J", "name"), [((9.0, 0.0), "short"), ((0.0, 9.0), "light")])
def test_a_single_limit_is_named_alone(J: tuple[float, float], name: str) -> None:
    words = conflict_message(limited("cheap", (0, 3.0, "short"), (1, 5.0, "light")), (TIME, MASS), np.array(J))
    assert words.startswith(f"no point was found that meets {name}; the nearest has time {J[0]:g} s, mass {J[1]:g}: '{name}' is missed by")
    assert "all of" not in words


def test_limits_without_names_are_said_by_their_numbers() -> None:
    words = conflict_message(limited("cheap", (0, 3.0, ""), (1, 5.0, ""), unnamed=True), (TIME, MASS), np.array([1.0, 9.0]))
    assert words.startswith("no point was found that meets limit 2 of cheap;") and words.endswith("'limit 2 of cheap' is missed by 4")
