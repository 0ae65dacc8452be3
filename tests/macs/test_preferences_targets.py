"""Weighted sums, goals, fuzzy goals, reference points and NIMBUS on a front with closed forms: the cart's effort is 12 / T^3."""

from __future__ import annotations

import numpy as np
import pytest
from choices import FASTEST, SLOWEST, cart, plain_front, turned_cart
from scipy.optimize import brentq

from macs.decisions import Around, FuzzyGoal, FuzzySatisfactory, GoalProgramming, Nimbus, Ranges, ReferencePoint, WeightedSum

FRONT = cart()
STEP = (SLOWEST - FASTEST) / (len(FRONT) - 1)
T0, T1, E0, E1 = FASTEST, SLOWEST, 12 / SLOWEST**3, 12 / FASTEST**3
DT, DE = T1 - T0, E1 - E0


def effort(T: float) -> float:
    return 12 / T**3


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
    T = brentq(lambda T: (T - 1.4) / 0.1 - (effort(T) - 0.3) / 0.1, T0, T1)
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
