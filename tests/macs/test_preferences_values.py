"""What each preference makes of a few objectives, in numbers that are worked out by hand: values, limits, degrees, and their words."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from choices import FASTEST, SLOWEST, cart, plain_front, turned_cart
from scipy.optimize import brentq

from macs.decisions import Around, FuzzyGoal, FuzzySatisfactory, GoalProgramming, Nimbus, Preference, Ranges, ReferencePoint, WeightedSum
from macs.preferences.goals import aims
from problems.compiled import Objective

A, B, C = Objective("a", "kg"), Objective("b", "m", "maximize"), Objective("c")
TWO, THREE = (A, B), (A, B, C)
RANGES = Ranges({"a": 0.0, "b": 20.0}, {"a": 10.0, "b": 0.0})
WIDE = Ranges({"a": 0.0, "b": 20.0, "c": 0.0}, {"a": 10.0, "b": 0.0, "c": 4.0})
NOW = {"a": 4.0, "b": 10.0, "c": 2.0}
NAN, INF = np.nan, np.inf
ENOUGH: dict[str, Any] = {"to": {"b": 16.0}, "until": {"c": 3.0}, "free": ["a"], "enough": True}


class Chosen:
    """What `decide` returns has a point."""

    point = NOW


@dataclass
class Case:
    """A preference, the names of its stages, those that follow only on a zero in brackets, what its limits say, and, by objectives, the
    values of the first stages, the excesses over limits, degrees, and kappa."""

    preference: Any
    stages: str
    limits: tuple[str, ...] = ()
    values: dict[tuple[float, ...], Any] = field(default_factory=dict)
    excesses: dict[tuple[float, ...], Any] = field(default_factory=dict)
    degrees: dict[tuple[float, ...], Any] = field(default_factory=dict)
    kappa: dict[tuple[float, ...], Any] = field(default_factory=dict)


CASES = [
    Case(
        WeightedSum({"b": 3, "a": 2.0}),
        "weighted sum",
        values={(0, 20): 0, (10, 0): 5, (5, 15): 1.75, (12, 20): 2.4},
        degrees={(0, 20): (1, 1), (10, 0): (0, 0), (5, 5): (0.5, 0.25), (15, 30): (-0.5, 1.5)},
    ),
    Case(WeightedSum({"b": 3.0}), "weighted sum", values={(5, 15): 0.75}, degrees={(5, 5): (0.5, 0.25)}),
    # Deviations count on the worse side, in widths of ranges; the second stage is the sum of all normalised objectives.
    Case(
        GoalProgramming({"a": 4.0, "b": 10.0}, weights={"b": 3.0}),
        "deviations, (sum of all)",
        values={(4, 10): (0, 0.9), (6, 10): (0.2, 1.1), (3, 5): (0.75, 1.05), (6, 5): (0.95, 1.35), (0, 20): (0, 0)},
        degrees={(6, 5): (0.8, 0.75), (0, 20): (1, 1), (14, -10): (0, 0)},
    ),
    Case(
        GoalProgramming({"b": Around(8.0)}),
        "deviations, (sum of all)",
        values={(1, 8): 0, (1, 12): 0.2, (1, 4): 0.2},
        degrees={(1, 12): (NAN, 0.8), (1, 4): (NAN, 0.8)},
    ),
    Case(GoalProgramming({"a": 4.0}, priorities=["a"]), "deviations, (sum of all)"),
    Case(
        GoalProgramming({"a": 4.0, "b": 10.0, "c": 1.0}, {"c": 2.0}, ["b", ("a", "c")]),
        "priority 1, priority 2, (sum of all)",
        values={(6, 5, 2): (0.25, 0.7, 1.85)},
    ),
    # The memberships of 4 or less and of 10 or more are 0 at the worst ends of the ranges, 10 and 0.
    Case(
        FuzzyGoal({"a": 4.0, "b": 10.0}),
        "largest 1 - membership, (sum of all)",
        ("a at most 10 kg", "b at least 0 m"),
        values={(4, 10): (0, 0.9), (7, 8): 0.5, (2, 5): 0.5, (10, 0): 1},
        degrees={(4, 10): (1, 1), (7, 8): (0.5, 0.8), (2, 5): (1, 0.5), (10, 0): (0, 0)},
    ),
    Case(
        FuzzyGoal({"a": 4.0, "b": 10.0}, aggregate="sum"),
        "sum of 1 - membership, (sum of all)",
        ("a at most 10 kg", "b at least 0 m"),
        values={(4, 10): (0, 0.9), (7, 8): 0.7, (2, 5): 0.5, (10, 0): 2},
    ),
    Case(
        FuzzyGoal({"a": 4.0, "b": Around(10.0, (2.0, 4.0))}, {"a": 2.0}),
        "largest 1 - membership, (sum of all)",
        ("a at most 6 kg", "b at least 8 m", "b at most 14 m"),
        values={(6, 14): 1, (6.1, 10): INF, (4, 7.9): INF, (4, 14.1): INF},
        excesses={(6, 10): (0, -1, -1), (8, 6): (1, 1, -2), (4, 18): (-1, -5, 1)},
        degrees={(5, 9): (0.5, 0.5), (5, 13): (0.5, 0.25)},
    ),
    Case(
        FuzzyGoal({"b": Around(5.0)}),
        "largest 1 - membership, (sum of all)",
        ("b at least 0 m", "b at most 20 m"),
        degrees={(1, 0): (NAN, 0), (1, 2.5): (NAN, 0.5), (1, 12.5): (NAN, 0.5), (1, 20): (NAN, 0)},
    ),
    # 1 - membership is (0.2, 0.5) and (0.5, 0.2): the mean is 0.35, and kappa -0.3 and 0.3.
    Case(
        FuzzySatisfactory({}, ["a", "b"], 0.2),
        "1 - membership, order",
        ("a at most 10 kg", "b at least 0 m"),
        values={(2, 10): 0.29, (5, 16): 0.41},
        degrees={(2, 10): (0.8, 0.5), (5, 16): (0.5, 0.8)},
        kappa={(2, 10): -0.3, (5, 16): 0.3},
    ),
    # 1 - membership: 0.2, 0.5, 0.3.
    Case(
        FuzzySatisfactory({"c": 1.0}, [("a", "b"), "c"], 0.5, ordered=True),
        "1 - membership, order",
        ("a at most 10 kg", "b at least 0 m", "c at most 4", "a satisfied at least as c", "b satisfied at least as c"),
        excesses={(2, 10, 1.9): (-0.8, -0.5, -0.7, -0.1, 0.2)},
        kappa={(2, 10, 1.9): 0.2},
    ),
    Case(
        FuzzySatisfactory({"c": 1.0}, [("a", "b"), "c"], 0.5),
        "1 - membership, order",
        ("a at most 10 kg", "b at least 0 m", "c at most 4"),
        values={(2, 10, 1.9): 1 / 3 + 0.1},
    ),
    # 1 - membership: 0.9, 0.95, 0.5; each level is compared with the next, so that the first and the last are not.
    Case(
        FuzzySatisfactory({}, ["a", "b", "c"], ordered=True),
        "1 - membership, order",
        ("a at most 10 kg", "b at least 0 m", "c at most 4", "a satisfied at least as b", "b satisfied at least as c"),
        kappa={(9, 1, 2): 0.45},
    ),
    # The reservation of b is a range's width worse than 15.
    Case(
        ReferencePoint({"a": 2.0, "b": 15.0}, {"a": 6.0}, augmentation=0.01),
        "achievement",
        values={(2, 15): 0, (6, -5): 1.02, (4, 10): 0.5 + 0.0075, (0, 20): -0.25 - 0.0075},
        degrees={(2, 15): (1, 1), (6, -5): (0, 0), (4, 10): (0.5, 0.75), (0, 20): (1.5, 1.25)},
    ),
    # Without an aspiration the best is hoped for.
    Case(ReferencePoint({"a": 2.0}, {"b": 10.0}, augmentation=0.0), "achievement", values={(2, 15): 0.5, (7, 20): 0.5, (2, 10): 1}),
    # Counted from 0 and from 16; normalised, the sums of all are 0.3 + 0.4 + 0.75, and so on.
    Case(
        Nimbus(NOW, improve=["a"], to={"b": 16.0}, until={"c": 3.0}, augmentation=0.01),
        "achievement",
        ("a at most 4 kg", "b at least 10 m", "c at most 3"),
        values={(3, 12, 3): 0.3145, (1, 11, 1): 0.258, (4, 18, 0): 0.405, (4.1, 12, 1): INF, (3, 9.9, 1): INF, (3, 12, 3.1): INF},
        excesses={(5, 8, 4): (0.1, 0.1, 0.25)},
        degrees={(3, 13, 3): (0.25, 0.5, 1), (0, 17, 3.1): (1, 1, 0), (5, 9, 0): (0, 0, 1)},
    ),
    Case(
        Nimbus(NOW, improve=["a"], keep=["b"], free=["c"]),
        "achievement",
        ("a at most 4 kg", "b at least 10 m"),
        degrees={(2, 10, 9): (0.5, 1, NAN), (2, 9.9, 9): (0.5, 0, NAN), (2, 10 - 1e-6, 9): (0.5, 1, NAN)},
    ),
    # What is at its best already has all that was asked for.
    Case(
        Nimbus({"a": 0.0, "b": 10.0}, improve=["a"], free=["b"]),
        "achievement",
        ("a at most 0 kg",),
        degrees={(0, 5): (1, NAN), (1, 5): (1, NAN)},
    ),
    # Limits may be the current values.
    Case(
        Nimbus(Chosen(), improve=["a"], until={"b": 10.0, "c": 2.0}),  # type: ignore[arg-type]
        "achievement",
        ("a at most 4 kg", "b at least 10 m", "c at most 2"),
    ),
    # Values that are enough are reached first; then the loss of others is small.
    Case(
        Nimbus(NOW, augmentation=0.0, **ENOUGH),
        "missing, (loss of others)",
        ("b at least 10 m", "c at most 3"),
        values={(4, 12, 2): (0.2, 0), (6, 18, 2.5): (0, 0.2), (5, 16, 3): (0, 0.25)},
    ),
    Case(
        Nimbus(NOW, augmentation=0.1, **ENOUGH),
        "missing, (loss of others)",
        ("b at least 10 m", "c at most 3"),
        values={(4, 12, 2): (0.2, 0.13)},
    ),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: repr(case.preference))
def test_values_limits_and_degrees(case: Case) -> None:
    preference: Preference = case.preference
    given = {**case.values, **case.excesses, **case.degrees, **case.kappa}
    of = (THREE, WIDE) if "c" in preference.names or any(len(J) == 3 for J in given) else (TWO, RANGES)
    stages = preference.stages(*of)
    assert ", ".join(f"({stage.name})" if stage.after_zero else stage.name for stage in stages) == case.stages
    assert stages[0].limit_names == case.limits and not any(stage.limit_names for stage in stages[1:])
    for J, expected in case.values.items():
        found = [stage.numbers(np.array([J]))[0] for stage in stages]
        assert found[: np.size(expected)] == pytest.approx(np.atleast_1d(expected), abs=1e-12), J
    for J, expected in case.excesses.items():
        assert stages[0].excesses(np.array([J]))[0] == pytest.approx(expected, abs=1e-12), J
    # Degrees are of any objectives, lists of whole numbers too.
    for J, expected in case.degrees.items():
        assert preference.degrees(*of, [J])[0] == pytest.approx(expected, abs=1e-12, nan_ok=True), J  # type: ignore[arg-type]
    for J, expected in case.kappa.items():
        assert preference.kappa(*of, [J]) == pytest.approx([expected]), J  # type: ignore[attr-defined]


def test_names_and_settings_are_kept_as_numbers_and_tuples_apart_from_what_the_user_changes() -> None:
    assert WeightedSum({"b": 3, "a": 2.0}).words == "weighted sum of b, a"
    assert ReferencePoint({"a": 2.0}, {"b": 10.0}).names == GoalProgramming({"a": 4.0, "b": 1.0}, {"b": 3.0}).names == ("a", "b")
    assert Nimbus(NOW, to={"b": 16.0}, until={"c": 3.0}, improve=["a"]).names == ("a", "b", "c")
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


def test_deviations_have_no_kink_where_nothing_is_better_than_the_target() -> None:
    """A solve that exceeds the best value by a little sees that it is better still."""
    found = aims({"a": 0.0, "b": 12.0}, TWO, RANGES)
    assert found["a"].best and not found["b"].best and not aims({"a": Around(0.0)}, TWO, RANGES)["a"].best
    J = [np.array([-1.0, 2.0]), np.array([16.0, 8.0])]
    assert found["a"].deviation(J).tolist() == [-0.1, 0.2] and found["b"].deviation(J) == pytest.approx([0.0, 0.2])
    assert len(found["a"].parts(J)) == 1 and np.max([np.zeros(2), *found["b"].parts(J)[1:]], axis=0) == pytest.approx([0.0, 0.2])
    assert found["b"].parts(J)[0] == 0.0 and aims({"b": 21.0 - 1.0}, TWO, RANGES)["b"].best
    around = aims({"b": Around(10.0)}, TWO, RANGES)["b"]
    assert around.deviation(J) == pytest.approx([0.3, 0.1])


# On a front in closed form: the effort of the cart is 12 / T^3


FRONT = cart()
STEP = (SLOWEST - FASTEST) / (len(FRONT) - 1)
T0, T1, E0, E1 = FASTEST, SLOWEST, 12 / SLOWEST**3, 12 / FASTEST**3
DT, DE = T1 - T0, E1 - E0


def balanced(time_weight: float, effort_weight: float) -> float:
    """Where time_weight * T + effort_weight * 12 / T^3 is least."""
    return (36 * effort_weight / time_weight) ** 0.25


def chosen(preference, front=FRONT) -> float:
    return preference.rank(front).best.objectives["time"]


def test_where_all_goals_are_met_the_point_is_not_dominated():
    ranking = GoalProgramming({"time": 3.5, "effort": 3.0}).rank(FRONT)
    assert ranking.best.objectives["time"] == pytest.approx(balanced(1 / DT, 1 / DE), abs=STEP)
    assert ranking.values[ranking.order[0]] == 0.0
    # The second stage follows only where the first is zero.
    assert np.array_equal(np.isnan(ranking.stage_values[:, 1]), ranking.values > 0)
    dominated = plain_front([[2.5, 1.0], [2.4, 0.9], [1.2, 7.0], [4.0, 0.1]], list(FRONT.goals))
    assert GoalProgramming({"time": 3.5, "effort": 3.0}).rank(dominated).best.index == 1


@pytest.mark.slow
def test_priorities_come_one_after_the_other():
    first_time = GoalProgramming({"time": 2.0, "effort": 0.3}, priorities=["time", "effort"])
    assert chosen(first_time) == pytest.approx(2.0, abs=STEP)
    first_effort = GoalProgramming({"time": 2.0, "effort": 0.3}, priorities=["effort", "time"])
    assert chosen(first_effort) == pytest.approx((12 / 0.3) ** (1 / 3), abs=STEP)
    ranking = first_time.rank(FRONT)
    assert ranking.stage_names == ("priority 1", "priority 2", "sum of all")
    assert list(first_time.rank(FRONT).order) == list(np.lexsort([np.maximum(FRONT.F[:, 1] - 0.3, 0), np.maximum(FRONT.F[:, 0] - 2, 0)]))


def test_beyond_a_tolerance_no_point_is_acceptable():
    ranking = FuzzyGoal({"time": 2.0, "effort": 1.0}, tolerances={"time": 0.5, "effort": 1.0}).rank(FRONT)
    J = FRONT.objectives
    met = (J[:, 0] <= 2.5 + 1e-6) & (J[:, 1] <= 2.0 + 1e-6)
    assert np.array_equal(np.isfinite(ranking.values), met)
    none = FuzzyGoal({"time": 1.3, "effort": 0.2}, tolerances={"time": 0.1, "effort": 0.1}).rank(FRONT)
    assert np.isinf(none.values).all()
    assert none.message == "No point meets all hard limits together."
    # The excesses over 1.4 s and 0.3 are in units of the tolerances.
    T = brentq(lambda T: (T - 1.4) / 0.1 - (12 / T**3 - 0.3) / 0.1, T0, T1)
    assert none.best.objectives["time"] == pytest.approx(T, abs=STEP)


@pytest.mark.parametrize("regulating", [0.0, 0.1, 0.3, 0.45])
def test_eq_53_weighs_two_memberships(regulating):
    preference = FuzzySatisfactory({}, ["effort", "time"], regulating=regulating)
    T = balanced((0.5 - regulating) / DT, (0.5 + regulating) / DE)
    assert chosen(preference) == pytest.approx(min(T, T1), abs=STEP)
    d = np.column_stack([(FRONT.F[:, 1] - E0) / DE, (FRONT.F[:, 0] - T0) / DT])
    value = (0.5 + regulating) * d[:, 0] + (0.5 - regulating) * d[:, 1]
    assert preference.rank(FRONT).values == pytest.approx(value, abs=1e-12)
    assert preference.kappa(FRONT.goals, Ranges.of(FRONT), FRONT.objectives) == pytest.approx(d[:, 0] - d[:, 1], abs=1e-12)


WANTS = [
    lambda t, e: WeightedSum({"time": 1.0, "effort": 2.0}),
    lambda t, e: GoalProgramming({"time": t(1.5), "effort": e(0.5)}),
    lambda t, e: GoalProgramming({"time": Around(t(1.9)), "effort": e(0.5)}, priorities=[("effort",), "time"]),
    lambda t, e: FuzzyGoal({"time": t(1.5), "effort": e(0.5)}),
    lambda t, e: FuzzyGoal({"time": t(1.5), "effort": e(0.5)}, aggregate="sum"),
    lambda t, e: FuzzySatisfactory({"time": t(1.5)}, ["effort", "time"]),
    lambda t, e: ReferencePoint({"time": t(1.5)}, {"time": t(2.0)}),
    lambda t, e: Nimbus({"time": t(2.0), "effort": e(1.5)}, to={"time": t(1.6)}, until={"effort": e(2.9)}),
]


@pytest.mark.parametrize("want", WANTS)
def test_units_and_senses_do_not_matter(want):
    one = want(lambda t: t, lambda e: e).rank(cart(301))
    other = want(lambda t: 1e3 * t, lambda e: -1e10 * e).rank(turned_cart(301))
    assert other.stage_values == pytest.approx(one.stage_values, rel=1e-9, abs=1e-12, nan_ok=True)
    assert other.degrees == pytest.approx(one.degrees, abs=1e-9, nan_ok=True)
    assert other.best.index == one.best.index
