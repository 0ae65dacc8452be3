"""What each preference makes of a few objectives, in numbers that are worked out by hand: values, limits, degrees, and their words."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from macs.decisions import Around, FuzzyGoal, FuzzySatisfactory, GoalProgramming, Nimbus, Ranges, ReferencePoint, WeightedSum
from macs.preferences.goals import aims
from problems.compiled import Objective

A, B, C = Objective("a", "kg"), Objective("b", "m", "maximize"), Objective("c")
TWO, THREE = (A, B), (A, B, C)
RANGES = Ranges({"a": 0.0, "b": 20.0}, {"a": 10.0, "b": 0.0})
WIDE = Ranges({"a": 0.0, "b": 20.0, "c": 0.0}, {"a": 10.0, "b": 0.0, "c": 4.0})


def values(preference: Any, *J: tuple[float, ...], goals: Any = TWO, ranges: Any = RANGES) -> list[list[float]]:
    """Values of the stages, a row for each of the objectives."""
    return np.stack([stage.numbers(np.array(J)) for stage in preference.stages(goals, ranges)], axis=1).tolist()


def degrees(preference: Any, *J: tuple[float, ...], goals: Any = TWO, ranges: Any = RANGES) -> list[list[float]]:
    return preference.degrees(goals, ranges, J).tolist()


def close(rows: list[list[float]]) -> Any:
    return pytest.approx(np.array(rows), abs=1e-12, nan_ok=True)


def stages(preference: Any, goals: Any = TWO, ranges: Any = RANGES) -> list[tuple[str, bool]]:
    """Names of the stages, and whether each follows only on a zero."""
    return [(stage.name, stage.after_zero) for stage in preference.stages(goals, ranges)]


# Weighted sums


def test_a_weighted_sum_is_that_of_normalised_objectives() -> None:
    preference = WeightedSum({"b": 3, "a": 2.0})
    assert np.array(values(preference, (0.0, 20.0), (10.0, 0.0), (5.0, 15.0), (12.0, 20.0))) == close([[0.0], [5.0], [1.75], [2.4]])
    assert np.array(values(WeightedSum({"b": 3.0}), (5.0, 15.0))) == close([[0.75]])
    assert stages(preference) == [("weighted sum", False)] and preference.names == ("b", "a")
    assert preference.words == "weighted sum of b, a"


def test_degrees_of_a_weighted_sum_are_linear_from_the_best_to_the_worst_and_beyond() -> None:
    """Of all objectives, also of those without a weight."""
    assert np.array(degrees(WeightedSum({"b": 3.0}), (0, 20), (10, 0), (5, 5), (15, 30))) == close(
        [[1, 1], [0, 0], [0.5, 0.25], [-0.5, 1.5]]
    )


def test_what_is_given_is_kept_as_numbers_and_tuples_and_apart_from_what_the_user_changes() -> None:
    given: dict[str, Any] = {"a": 1, "b": 2}
    made = (
        (WeightedSum(given), "weights"),
        (FuzzyGoal({"a": 1, "b": 1}, given), "tolerances"),
        (ReferencePoint({"a": 0}, given), "reservation"),
        (Nimbus({"a": 9, "b": 9}, to=given, free=["c"]), "to"),
    )
    given["a"] = "changed"
    for preference, name in made:
        found = getattr(preference, name)
        assert found == {"a": 1.0, "b": 2.0} and {type(value) for value in found.values()} == {float}, (preference, name)
    assert FuzzySatisfactory({}, ["a", ("b", "c")]).priorities == (("a",), ("b", "c"))


@pytest.mark.parametrize(
    "preference",
    [
        WeightedSum({"a": 1.0}),
        GoalProgramming({"a": 1.0}),
        FuzzyGoal({"a": 1.0}),
        FuzzySatisfactory({}, ["a", "b"]),
        ReferencePoint({"a": 1.0}),
        Nimbus({"a": 4.0, "b": 5.0}, improve=["a"], free=["b"]),
    ],
    ids=lambda one: type(one).__name__,
)
def test_without_ranges_nothing_is_judged(preference: Any) -> None:
    words = f"^{type(preference).__name__} needs the ranges of the objectives: Ranges.of"
    for call in (lambda: preference.stages(TWO, None), lambda: preference.degrees(TWO, None, np.ones((1, 2)))):
        with pytest.raises(ValueError, match=words):
            call()
    assert eval(repr(preference)) == preference
    # Degrees are of any objectives, lists of whole numbers too.
    assert preference.degrees(TWO, RANGES, [[1, 2]]).shape == (1, 2)


# Goals


def test_deviations_count_on_the_worse_side_in_widths_of_ranges() -> None:
    preference = GoalProgramming({"a": 4.0, "b": 10.0}, weights={"b": 3.0})
    found = values(preference, (4.0, 10.0), (6.0, 10.0), (3.0, 5.0), (6.0, 5.0), (0.0, 20.0))
    # The second stage is the sum of all normalised objectives.
    assert np.array(found) == close([[0, 0.9], [0.2, 1.1], [0.75, 1.05], [0.95, 1.35], [0, 0]])
    assert stages(preference) == [("deviations", False), ("sum of all", True)] and preference.names == ("a", "b")
    assert np.array(degrees(preference, (6.0, 5.0), (0.0, 20.0), (14.0, -10.0))) == close([[0.8, 0.75], [1, 1], [0, 0]])


def test_a_target_on_both_sides_counts_on_both() -> None:
    preference = GoalProgramming({"b": Around(8.0)})
    assert np.array(values(preference, (1.0, 8.0), (1.0, 12.0), (1.0, 4.0)))[:, 0] == pytest.approx([0.0, 0.2, 0.2])
    assert np.array(degrees(preference, (1.0, 12.0), (1.0, 4.0))) == close([[np.nan, 0.8], [np.nan, 0.8]])


def test_levels_of_priority_are_stages() -> None:
    preference = GoalProgramming({"a": 4.0, "b": 10.0, "c": 1.0}, {"c": 2.0}, ["b", ("a", "c")])
    assert stages(preference, THREE, WIDE) == [("priority 1", False), ("priority 2", False), ("sum of all", True)]
    assert np.array(values(preference, (6.0, 5.0, 2.0), goals=THREE, ranges=WIDE)) == close([[0.25, 0.7, 1.85]])
    assert stages(GoalProgramming({"a": 4.0}, priorities=["a"])) == [("deviations", False), ("sum of all", True)]


# Fuzzy goals


def test_the_least_membership_or_the_sum_of_what_they_lack() -> None:
    """The memberships of 4 or less and of 10 or more are 0 at the worst ends of the ranges, 10 and 0."""
    J = ((4.0, 10.0), (7.0, 8.0), (2.0, 5.0), (10.0, 0.0))
    least, total = FuzzyGoal({"a": 4.0, "b": 10.0}), FuzzyGoal({"a": 4.0, "b": 10.0}, aggregate="sum")
    assert np.array(values(least, *J))[:, 0] == pytest.approx([0.0, 0.5, 0.5, 1.0], abs=1e-12)
    assert np.array(values(total, *J))[:, 0] == pytest.approx([0.0, 0.7, 0.5, 2.0], abs=1e-12)
    for preference, name in ((least, "largest 1 - membership"), (total, "sum of 1 - membership")):
        assert np.array(degrees(preference, *J)) == close([[1, 1], [0.5, 0.8], [1, 0.5], [0, 0]])
        assert stages(preference) == [(name, False), ("sum of all", True)] and preference.names == ("a", "b")
        assert np.array(values(preference, (4.0, 10.0)))[0, 1] == pytest.approx(0.9)


def test_tolerances_are_hard_limits_of_fuzzy_goals() -> None:
    preference = FuzzyGoal({"a": 4.0, "b": Around(10.0, (2.0, 4.0))}, {"a": 2.0})
    stage = preference.stages(TWO, RANGES)[0]
    assert stage.limit_names == ("a at most 6 kg", "b at least 8 m", "b at most 14 m")
    assert stage.excesses(np.array([[6.0, 10.0], [8.0, 6.0], [4.0, 18.0]])) == close([[0, -1, -1], [1, 1, -2], [-1, -5, 1]])
    found = values(preference, (6.0, 14.0), (6.1, 10.0), (4.0, 7.9), (4.0, 14.1))
    assert [math.isfinite(row[0]) for row in found] == [True, False, False, False]
    assert np.array(degrees(preference, (5.0, 9.0), (5.0, 13.0))) == close([[0.5, 0.5], [0.5, 0.25]])


def test_by_default_a_target_on_both_sides_is_missed_by_the_ends_of_the_range() -> None:
    preference = FuzzyGoal({"b": Around(5.0)})
    assert preference.stages(TWO, RANGES)[0].limit_names == ("b at least 0 m", "b at most 20 m")
    assert np.array(degrees(preference, (1, 0), (1, 2.5), (1, 12.5), (1, 20)))[:, 1] == pytest.approx([0.0, 0.5, 0.5, 0.0])


@pytest.mark.parametrize(
    ("target", "goal"), [({"a": 10.0}, "a"), ({"b": 0.0}, "b"), ({"a": Around(10.0)}, "a"), ({"b": Around(20.0)}, "b")]
)
def test_a_target_at_the_end_of_its_range_needs_a_tolerance(target: Any, goal: str) -> None:
    with pytest.raises(ValueError, match=f"^the target of '{goal}', .*, is the end of its range: give a tolerance, or another target$"):
        FuzzyGoal(target).stages(TWO, RANGES)
    value = target[goal]
    given = FuzzyGoal({goal: Around(value.value, 2.0)}) if isinstance(value, Around) else FuzzyGoal(target, {goal: 2.0})
    assert given.stages(TWO, RANGES)


def test_a_range_without_width_has_targets_as_wide_as_its_size() -> None:
    """There is no end to be missed; what counts as one is the size of the value."""
    flat = Ranges({"a": 5.0, "b": 20.0}, {"a": 5.0, "b": 0.0})
    stage = FuzzyGoal({"a": 5.0}).stages(TWO, flat)[0]
    assert stage.limit_names == ("a at most 10 kg",)
    assert stage.numbers(np.array([[7.5, 1.0], [5.0, 1.0]])).tolist() == [0.5, 0.0]


@pytest.mark.parametrize(("target", "words"), [({"a": 10.1}, "10.1 kg"), ({"a": -0.1}, "-0.1 kg"), ({"a": Around(11.0)}, "11 kg")])
def test_targets_lie_within_the_ranges(target: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"^the target of 'a', {words}, lies beyond its range: best 0 kg, worst 10 kg$"):
        GoalProgramming(target).stages(TWO, RANGES)


def test_deviations_have_no_kink_where_nothing_is_better_than_the_target() -> None:
    """A solve that exceeds the best value by a little sees that it is better still."""
    found = aims({"a": 0.0, "b": 12.0}, TWO, RANGES)
    assert found["a"].best and not found["b"].best and not aims({"a": Around(0.0)}, TWO, RANGES)["a"].best
    J = [np.array([-1.0, 2.0]), np.array([16.0, 8.0])]
    assert found["a"].deviation(J).tolist() == [-0.1, 0.2] and found["b"].deviation(J) == pytest.approx([0.0, 0.2])
    assert len(found["a"].parts(J)) == 1 and np.max([np.zeros(2), *found["b"].parts(J)[1:]], axis=0) == pytest.approx([0.0, 0.2])
    assert found["b"].parts(J)[0] == 0.0
    assert aims({"b": 21.0 - 1.0}, TWO, RANGES)["b"].best
    around = aims({"b": Around(10.0)}, TWO, RANGES)["b"]
    assert around.deviation(J) == pytest.approx([0.3, 0.1])


# Orders of priority


def test_an_order_of_priority_is_weighed_by_what_violates_it_most() -> None:
    """1 - membership is (0.2, 0.5) and (0.5, 0.2): the mean is 0.35, and kappa -0.3 and 0.3."""
    preference = FuzzySatisfactory({}, ["a", "b"], 0.2)
    J = ((2.0, 10.0), (5.0, 16.0))
    assert preference.kappa(TWO, RANGES, np.array(J)) == pytest.approx([-0.3, 0.3])
    assert np.array(values(preference, *J)) == close([[0.29], [0.41]])
    assert np.array(degrees(preference, *J)) == close([[0.8, 0.5], [0.5, 0.8]])
    assert stages(preference) == [("1 - membership, order", False)] and preference.names == ("a", "b")
    assert preference.kappa(TWO, RANGES, [[2, 10]]) == pytest.approx([-0.3])  # type: ignore[arg-type]


def test_all_goals_of_one_level_are_to_be_satisfied_at_least_as_all_of_the_next() -> None:
    preference = FuzzySatisfactory({"c": 1.0}, [("a", "b"), "c"], 0.5, ordered=True)
    stage = preference.stages(THREE, WIDE)[0]
    # 1 - membership: 0.2, 0.5, 0.3.
    J = (2.0, 10.0, 1.9)
    assert preference.kappa(THREE, WIDE, np.array([J])) == pytest.approx([0.2])
    assert stage.limit_names == (
        "a at most 10 kg",
        "b at least 0 m",
        "c at most 4",
        "a satisfied at least as c",
        "b satisfied at least as c",
    )
    assert stage.excesses(np.array([J])) == close([[-0.8, -0.5, -0.7, -0.1, 0.2]])
    free = FuzzySatisfactory({"c": 1.0}, [("a", "b"), "c"], 0.5)
    assert free.stages(THREE, WIDE)[0].limit_names == stage.limit_names[:3]
    assert np.array(values(free, J, goals=THREE, ranges=WIDE)) == close([[1.0 / 3.0 + 0.1]])


def test_three_levels_are_compared_each_with_the_next() -> None:
    preference = FuzzySatisfactory({}, ["a", "b", "c"], ordered=True)
    words = preference.stages(THREE, WIDE)[0].limit_names[3:]
    assert words == ("a satisfied at least as b", "b satisfied at least as c") and preference.regulating == 0.1
    # 1 - membership: 0.9, 0.95, 0.5; the first and the last are not compared.
    assert preference.kappa(THREE, WIDE, np.array([[9.0, 1.0, 2.0]])) == pytest.approx([0.45])


# Reference points


def test_achievements_are_0_at_aspirations_and_1_at_reservations() -> None:
    preference = ReferencePoint({"a": 2.0, "b": 15.0}, {"a": 6.0}, augmentation=0.01)
    # The reservation of b is a range's width worse than 15.
    J = ((2.0, 15.0), (6.0, -5.0), (4.0, 10.0), (0.0, 20.0))
    assert np.array(values(preference, *J)) == close([[0.0], [1.02], [0.5 + 0.0075], [-0.25 - 0.0075]])
    assert np.array(degrees(preference, *J)) == close([[1, 1], [0, 0], [0.5, 0.75], [1.5, 1.25]])
    assert stages(preference) == [("achievement", False)] and preference.names == ("a", "b")


def test_without_an_aspiration_the_best_is_hoped_for() -> None:
    preference = ReferencePoint({"a": 2.0}, {"b": 10.0}, augmentation=0.0)
    assert preference.names == ("a", "b")
    assert np.array(values(preference, (2.0, 15.0), (7.0, 20.0), (2.0, 10.0))) == close([[0.5], [0.5], [1.0]])


@pytest.mark.parametrize(
    ("aspiration", "reservation", "words"),
    [
        ({"a": 11.0}, None, "the aspiration of 'a', 11 kg, lies beyond its range"),
        ({"a": 1.0}, {"b": 21.0}, "the reservation of 'b', 21 m, lies beyond its range"),
        ({"a": 3.0}, {"a": 3.0}, "the reservation of 'a', 3 kg, must be worse than its aspiration, 3 kg"),
        ({"b": 3.0}, {"b": 4.0}, "the reservation of 'b', 4 m, must be worse than its aspiration, 3 m"),
        ({"d": 3.0}, None, "unknown objective 'd'"),
    ],
)
def test_reservations_are_worse_than_aspirations(aspiration: Any, reservation: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"^{words}"):
        ReferencePoint(aspiration, reservation).stages(TWO, RANGES)


# From a current point


NOW = {"a": 4.0, "b": 10.0, "c": 2.0}


def test_nimbus_weighs_what_is_to_improve_and_limits_the_rest() -> None:
    preference = Nimbus(NOW, improve=["a"], to={"b": 16.0}, until={"c": 3.0}, augmentation=0.01)
    (stage,) = preference.stages(THREE, WIDE)
    assert (stage.name, stage.after_zero) == ("achievement", False) and preference.names == ("a", "b", "c")
    assert stage.limit_names == ("a at most 4 kg", "b at least 10 m", "c at most 3")
    J = ((3.0, 12.0, 3.0), (1.0, 11.0, 1.0), (4.0, 18.0, 0.0))
    # Counted from 0 and from 16; normalised, the sums of all are 0.3 + 0.4 + 0.75, and so on.
    assert np.array(values(preference, *J, goals=THREE, ranges=WIDE)) == close([[0.3145], [0.2580], [0.4050]])
    assert stage.excesses(np.array([[5.0, 8.0, 4.0]])) == close([[0.1, 0.1, 0.25]])
    assert np.isinf(values(preference, (4.1, 12.0, 1.0), (3.0, 9.9, 1.0), (3.0, 12.0, 3.1), goals=THREE, ranges=WIDE)).all()
    found = degrees(preference, (3.0, 13.0, 3.0), (0.0, 17.0, 3.1), (5.0, 9.0, 0.0), goals=THREE, ranges=WIDE)
    assert np.array(found) == close([[0.25, 0.5, 1], [1, 1, 0], [0, 0, 1]])


def test_nimbus_keeps_what_is_good_and_forgets_what_is_free() -> None:
    preference = Nimbus(NOW, improve=["a"], keep=["b"], free=["c"])
    (stage,) = preference.stages(THREE, WIDE)
    assert stage.limit_names == ("a at most 4 kg", "b at least 10 m")
    found = degrees(preference, (2.0, 10.0, 9.0), (2.0, 9.9, 9.0), (2.0, 10.0 - 1e-6, 9.0), goals=THREE, ranges=WIDE)
    assert np.array(found) == close([[0.5, 1, np.nan], [0.5, 0, np.nan], [0.5, 1, np.nan]])


def test_what_is_at_its_best_already_has_all_that_was_asked_for() -> None:
    preference = Nimbus({"a": 0.0, "b": 10.0}, improve=["a"], free=["b"])
    assert np.array(degrees(preference, (0.0, 5.0), (1.0, 5.0)))[:, 0].tolist() == [1.0, 1.0]


def test_values_that_are_enough_are_reached_first_and_then_the_loss_of_others_is_small() -> None:
    preference = Nimbus(NOW, to={"b": 16.0}, until={"c": 3.0}, free=["a"], augmentation=0.0, enough=True)
    assert stages(preference, THREE, WIDE) == [("missing", False), ("loss of others", True)]
    J = ((4.0, 12.0, 2.0), (6.0, 18.0, 2.5), (5.0, 16.0, 3.0))
    assert np.array(values(preference, *J, goals=THREE, ranges=WIDE)) == close([[0.2, 0.0], [0.0, 0.2], [0.0, 0.25]])
    first, second = preference.stages(THREE, WIDE)
    assert first.limit_names == ("b at least 10 m", "c at most 3") and second.limit_names == ()
    more = Nimbus(NOW, to={"b": 16.0}, until={"c": 3.0}, free=["a"], augmentation=0.1, enough=True)
    assert np.array(values(more, J[0], goals=THREE, ranges=WIDE)) == close([[0.2, 0.13]])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"improve": ["a"], "free": ["b"]}, "'c' is in no class of Nimbus: improve, to, keep, until or free"),
        ({"to": {"a": 4.0}, "free": ["b", "c"]}, "'a' is to improve to 4 kg, which is not better than 4 kg"),
        ({"to": {"b": 9.0}, "free": ["a", "c"]}, "'b' is to improve to 9 m, which is not better than 10 m"),
        ({"to": {"b": 21.0}, "free": ["a", "c"]}, "the value in `to` of 'b', 21 m, lies beyond its range"),
        ({"improve": ["a"], "until": {"b": 10.5}, "free": ["c"]}, "'b' may become worse until 10.5 m, which is better than 10 m"),
        ({"improve": ["a"], "free": ["b", "c", "d"]}, "unknown objective 'd'"),
    ],
)
def test_classes_of_nimbus_make_sense_together(given: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"^{words}"):
        Nimbus(NOW, **given).stages(THREE, WIDE)


def test_limits_may_be_the_current_values_and_the_current_values_those_of_a_choice() -> None:
    class Chosen:
        point = NOW

    preference = Nimbus(Chosen(), improve=["a"], until={"b": 10.0, "c": 2.0})  # type: ignore[arg-type]
    assert preference.current == NOW and preference.stages(THREE, WIDE)[0].limit_names[1:] == ("b at least 10 m", "c at most 2")
    with pytest.raises(ValueError, match=r"^the current point of Nimbus has no 'c'$"):
        Nimbus({"a": 4.0, "b": 10.0}, improve=["a"], free=["b"]).check(THREE)
    with pytest.raises(ValueError, match=r"^unknown objective 'd'"):
        Nimbus({**NOW, "d": 1.0}, improve=["a"], free=["b", "c"]).check(THREE)
