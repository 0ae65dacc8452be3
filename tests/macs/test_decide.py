"""decide: the optimum of every preference on fronts that are known in closed form, and what it makes of other problems."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rest_to_rest import DIAGONAL, MESH, RANGES, WIDE_E, WIDE_T, balanced, both, cart, crossing, effort, ends, in_time
from scipy.optimize import brentq, minimize_scalar
from smooth_problems import bryson_denham, corners, shuttle, two_wells

from macs import MACS, Front, sweep
from macs.decisions import (
    Around,
    Choice,
    FuzzyGoal,
    FuzzyPhysicalProgramming,
    FuzzySatisfactory,
    GoalProgramming,
    Nimbus,
    PhysicalProgramming,
    Preference,
    Range,
    Ranges,
    ReferencePoint,
    Smaller,
    WeightedSum,
    decide,
    satisfy,
)
from macs.decisions.solver import NO_OPTIMUM
from problems import Problem, load
from problems.cases.goddard import optimal_flight
from transcription import DFET
from transcription.catalogue import parse
from transcription.nlp import scalarized

NOW = {"effort": 10.0, "time": in_time(10.0)}
HOPED = crossing((10, WIDE_E), (0.7, WIDE_T))
RESERVED = crossing((10, 20), (0.7, 1.3))
LEVEL = crossing((10, 86), (0.7, 3.3))
CLOSE = crossing((10, 20), (0.7, 0.3))
NEARBY = crossing((30, 5), (0.7, 3.3))
KNOWN: list[tuple[Preference, float, tuple[float, ...]]] = [
    (WeightedSum({"effort": 1.0, "time": 2.0}), (T := balanced(1 / WIDE_E, 2 / WIDE_T)), (both(T)[0] + 2 * both(T)[1],)),
    (GoalProgramming({"effort": 10.0, "time": 0.7}), NOW["time"], ((NOW["time"] - 0.7) / WIDE_T, 0.0)),
    (
        GoalProgramming({"effort": 10.0, "time": 0.7}, {"effort": 1.0, "time": 3.0}),
        (T := balanced(1 / WIDE_E, 3 / WIDE_T)),
        ((effort(T) - 10) / WIDE_E + 3 * (T - 0.7) / WIDE_T, 0.0),
    ),
    # All targets are met: the least sum among those who meet them.
    (GoalProgramming({"effort": 40.0, "time": 2.0}), (T := balanced(1 / WIDE_E, 1 / WIDE_T)), (0.0, sum(both(T)))),
    (FuzzyGoal({"effort": 40.0, "time": 2.0}), T, (0.0, sum(both(T)))),
    (FuzzyGoal({"effort": 10.0, "time": 0.7}), LEVEL, ((LEVEL - 0.7) / 3.3, 0.0)),
    (FuzzyGoal({"effort": 10.0, "time": 0.7}, {"effort": 20.0, "time": 0.3}), CLOSE, ((CLOSE - 0.7) / 0.3, 0.0)),
    (FuzzyGoal({"effort": 10.0, "time": 0.7}, aggregate="sum"), NOW["time"], ((NOW["time"] - 0.7) / 3.3, 0.0)),
    (FuzzyGoal({"effort": Around(30.0, 5.0), "time": 0.7}), NEARBY, ((NEARBY - 0.7) / 3.3, 0.0)),
    (ReferencePoint({"effort": 10.0, "time": 0.7}), HOPED, ((1 + 2e-4) * (HOPED - 0.7) / WIDE_T,)),
    (ReferencePoint({"effort": 40.0, "time": 2.0}), (T := crossing((40, WIDE_E), (2, WIDE_T))), ((1 + 2e-4) * (T - 2) / WIDE_T,)),
    (ReferencePoint({"effort": 10.0, "time": 0.7}, {"effort": 30.0, "time": 2.0}), RESERVED, ((1 + 2e-4) * (RESERVED - 0.7) / 1.3,)),
    (Nimbus(NOW, improve=["time"], until={"effort": 20.0}), (T := in_time(20)), ((T - 0.5) / WIDE_T + 1e-4 * sum(both(T)),)),
    (Nimbus(NOW, to={"effort": 8.0}, free=["time"]), 4.0, ((12 / 64 - 8) / WIDE_E + 1e-4,)),
    # (1/2 + lambda) d_1 + (1/2 - lambda) d_2 where the order is not kept, and everywhere else: kappa is d_1 - d_2 of either sign.
    (FuzzySatisfactory({}, ["effort", "time"], 0.1), (T := balanced(0.6 / WIDE_E, 0.4 / WIDE_T)), (0.6 * both(T)[0] + 0.4 * both(T)[1],)),
    (FuzzySatisfactory({}, ["time", "effort"], 0.0, ordered=True), DIAGONAL, (both(DIAGONAL)[1],)),
]
"""Preferences, the time of their optimum, and its values, all derived by hand from the front."""


@pytest.mark.parametrize(("preference", "T", "values"), KNOWN, ids=[repr(one[0]) for one in KNOWN])
def test_every_method_finds_its_optimum(preference: Preference, T: float, values: tuple[float, ...]) -> None:
    choice = decide(cart(), MESH, preference, ranges=RANGES, start=ends())
    assert choice.message == "" and choice.values == pytest.approx(values, rel=1e-6, abs=1e-7)
    assert choice.objectives["time"] == pytest.approx(T, rel=3e-6)
    # On the front, and known to be there.
    assert choice.objectives["effort"] == pytest.approx(effort(choice.objectives["time"]), rel=1e-7)
    assert choice.point.optimality < 1e-6 and choice.point.verified and choice.point.status == "converged"
    # So does the ranking of a dense front.
    assert preference.rank(dense(), RANGES).best.objectives["time"] == pytest.approx(choice.objectives["time"], abs=4e-4)


@pytest.mark.slow
def test_values_that_are_enough_are_reached_and_no_more() -> None:
    enough = Nimbus(NOW, to={"effort": 8.0}, free=["time"], enough=True)
    choice = decide(cart(), MESH, enough, ranges=RANGES, start=ends())
    T = in_time(8)
    # The second stage may use up what the first may be exceeded by, 1e-7.
    assert choice.message == "" and choice.values == pytest.approx((0.0, (T - NOW["time"]) / WIDE_T + 1e-4 * sum(both(T))), abs=3e-7)
    assert choice.objectives["time"] == pytest.approx(T, rel=3e-6) and choice.point.verified and choice.point.optimality < 1e-6
    assert enough.rank(dense(), RANGES).best.objectives["time"] == pytest.approx(T, abs=2.1e-4)
    # Out of reach: as near as can be.
    near = Nimbus(NOW, to={"effort": 8.0}, until={"time": 1.1}, enough=True)
    choice = decide(cart(), MESH, near, ranges=RANGES, start=ends())
    assert choice.objectives["time"] == pytest.approx(1.1, rel=1e-5) and choice.values[0] == pytest.approx(
        (effort(1.1) - 8) / WIDE_E, rel=1e-4
    )
    # Limits that are met but for rounding are met.
    assert choice.degrees["time"] == 1.0


EFFORTS, TIMES = Smaller(5, 10, 15, 25, 50), Smaller(0.6, 0.8, 1.0, 1.3, 2.0)
RANGED = Range(2, 5, 8, 10, 12, 14, 16, 20, 30, 40)
PHYSICAL = [
    PhysicalProgramming({"effort": EFFORTS, "time": TIMES}),
    PhysicalProgramming({"effort": RANGED, "time": TIMES}),
    FuzzyPhysicalProgramming({"effort": EFFORTS, "time": TIMES}, spread={"effort": 2.0, "time": 0.1}),
]


@pytest.mark.slow
@pytest.mark.parametrize("preference", PHYSICAL, ids=["crisp", "range", "fuzzy"])
def test_physical_programming_finds_its_optimum(preference: PhysicalProgramming) -> None:
    (stage,) = preference.stages(cart().compile().goals, RANGES)
    # On a grid, and then between its best neighbours: the value has several valleys.
    T = np.linspace(0.62, 1.9, 2001)
    k = int(np.argmin(stage.numbers(np.stack([12 / T**3, T], axis=1))))
    truth = minimize_scalar(
        lambda T: float(stage.numbers(np.array([[12 / T**3, T]]))[0]),
        bounds=(T[k - 1], T[k + 1]),
        method="bounded",
        options={"xatol": 1e-9},
    )
    choice = decide(cart(), MESH, preference, start=ends(), ranges=RANGES)
    assert choice.message == "" and choice.value == pytest.approx(truth.fun, rel=1e-6, abs=1e-9)
    assert choice.objectives["time"] == pytest.approx(truth.x, rel=1e-5) and choice.point.optimality < 1e-6
    # Neither end is within the hard limits: the first step finds a point that is.
    assert [step.name for step in choice.history] == ["largest excess over hard limits", stage.name]


MET = {"effort": 10.0, "time": 0.7}
"""Targets that are met from 1.063 on and up to 0.7: there memberships have kinks; in kappa, that of the less important goal is concave."""
KINKS: list[tuple[FuzzySatisfactory, float]] = [
    # (1/2 + lambda) d_1 + (1/2 - lambda) d_2 still falls where the first target is met, and rises from there on; so for either order.
    (FuzzySatisfactory(MET, ["effort", "time"], 0.1), NOW["time"]),
    (FuzzySatisfactory(MET, ["time", "effort"], 0.4), 0.7),
    # Where that of the less important goal is met.
    (FuzzySatisfactory(MET, ["time", "effort"], 0.01), NOW["time"]),
    # Between both kinks.
    (FuzzySatisfactory(MET, ["time", "effort"], 0.1), balanced(0.4 / 86, 0.6 / 3.3)),
    # A target on either side, of which all but the kink is missed.
    (FuzzySatisfactory({"effort": Around(20.0, 12.0)}, ["effort", "time"], 0.1), in_time(20.0)),
    (FuzzySatisfactory({"effort": Around(20.0, 12.0)}, ["time", "effort"], 0.1), in_time(20.0)),
]


@pytest.mark.parametrize("k", range(len(KINKS)), ids=[repr(one[0]) for one in KINKS])
def test_solves_do_not_stall_at_kinks_of_memberships(k: int) -> None:
    """Optima at kinks, and behind kinks that lie on the way; from the slow end and from the quick one in turn."""
    preference, T = KINKS[k]
    choice = decide(cart(), MESH, preference, ranges=RANGES, start=ends()[(k + k // 2) % 2])
    # What the closed form says is right: no point of the front, in steps of 2e-4, is better.
    ranking = preference.rank(dense(), RANGES)
    assert ranking.best.objectives["time"] == pytest.approx(T, abs=2.1e-4)
    assert choice.message == "" and choice.objectives["time"] == pytest.approx(T, rel=1e-5)
    assert choice.value <= ranking.values[ranking.order[0]] + 1e-8


@pytest.mark.slow
@settings(max_examples=15, deadline=None, derandomize=True)
@given(weight=st.floats(-3, 3), wide=st.tuples(st.floats(-2, 2), st.floats(-2, 2)))
def test_any_weights_in_any_ranges(weight: float, wide: tuple[float, float]) -> None:
    e, t = WIDE_E * 10 ** wide[0], WIDE_T * 10 ** wide[1]
    ranges = Ranges({"effort": 12 / 64, "time": 0.5}, {"effort": 12 / 64 + e, "time": 0.5 + t})
    choice = decide(cart(), MESH, WeightedSum({"effort": 10**weight, "time": 1.0}), ranges=ranges, start=ends())
    T = min(max(balanced(10**weight / e, 1 / t), 0.5), 4.0)
    truth = 10**weight * (effort(T) - 12 / 64) / e + (T - 0.5) / t
    assert choice.value == pytest.approx(truth, rel=1e-6, abs=1e-7 * (1 + 10**weight * WIDE_E / e + WIDE_T / t))


@pytest.mark.parametrize("first", ["effort", "time"])
def test_priorities_are_lexicographic(first: str) -> None:
    preference = GoalProgramming({"effort": 10.0, "time": 0.7}, priorities=[first, "time" if first == "effort" else "effort"])
    choice = decide(cart(), MESH, preference, ranges=RANGES, start=ends())
    # The first target is met, but for 1e-7 of a range; what that is worth to the second is at most six times as much.
    second = (in_time(10.0) - 0.7) / WIDE_T if first == "effort" else (effort(0.7) - 10) / WIDE_E
    assert choice.values[0] <= 1.5e-7 and choice.values[1:] == pytest.approx((second, 0.0), abs=1e-6)
    assert [step.name for step in choice.history] == ["priority 1", "priority 2"]
    assert choice.point.optimality < 1e-6


def test_weights_are_those_of_the_sum() -> None:
    # Where a weighted sum of normalised objectives is least, the multipliers are its weights over the ranges.
    choice = decide(cart(), MESH, WeightedSum({"effort": 1.0, "time": 2.0}), ranges=RANGES, start=ends())
    assert choice.point.weights is not None
    assert choice.point.weights["effort"] / choice.point.weights["time"] == pytest.approx(WIDE_T / WIDE_E / 2, rel=1e-5)
    assert choice.degrees == pytest.approx(
        {"effort": 1 - both(choice.objectives["time"])[0], "time": 1 - both(choice.objectives["time"])[1]}
    )


@pytest.mark.slow
def test_without_anything_but_a_preference() -> None:
    choice = decide(cart(), ReferencePoint({"effort": 10.0, "time": 0.7}))
    assert choice.ranges.best["time"] == pytest.approx(0.5, abs=1e-6) and choice.ranges.worst["effort"] == pytest.approx(96.0, rel=1e-4)
    assert choice.objectives["time"] == pytest.approx(HOPED, rel=1e-4) and choice.point.verified
    assert choice.stats["gradient_solves"] > 2 and "effort" in choice.table() and "achievement" in choice.table()


def test_stages_after_the_first_stay_on_the_mesh_that_was_found() -> None:
    choice = decide(cart(), GoalProgramming({"effort": 40.0, "time": 2.0}), start=ends(), ranges=RANGES)
    assert choice.values == pytest.approx((0.0, sum(both(balanced(1 / WIDE_E, 1 / WIDE_T)))), rel=1e-5) and choice.point.verified


@pytest.mark.parametrize("word", ["radau:6x3", "gauss:4x3"])
def test_other_transcriptions(word: str) -> None:
    choice = decide(cart(), parse(word), ReferencePoint({"effort": 10.0, "time": 0.7}), ranges=RANGES, starts=1)
    assert choice.objectives["time"] == pytest.approx(HOPED, rel=1e-6) and choice.point.optimality < 1e-6


def test_units_and_senses_do_not_matter() -> None:
    problem = Problem("cart, the other way round")
    trip = problem.phase("trip", t0=0, tf=(0.5, 4.0))
    x, v = trip.state("x", bounds=(-1, 2), initial=0, final=1), trip.state("v", bounds=(-5, 5), initial=0, final=0)
    u = trip.control("u", bounds=(-60, 60))
    trip.dynamics(x=v, v=u + 0 * x)
    problem.maximize("savings", 1e5 - 1e3 * trip.integral(u**2))
    problem.maximize("haste", -1e-6 * trip.tf)
    ranges = Ranges({"savings": 1e5 - 187.5, "haste": -0.5e-6}, {"savings": 4e3, "haste": -4e-6})
    choice = decide(problem, MESH, ReferencePoint({"savings": 9e4, "haste": -0.7e-6}), ranges=ranges, starts=1)
    assert choice.objectives["haste"] == pytest.approx(-1e-6 * HOPED, rel=1e-6)
    assert choice.value == pytest.approx((1 + 2e-4) * (HOPED - 0.7) / WIDE_T, rel=1e-6)


TIME, SPEED = "flight time", "horizontal speed"


def goddard(preference: Preference) -> Choice:
    ranges = Ranges({TIME: 110.0, SPEED: 0.9}, {TIME: 250.0, SPEED: 0.0})
    return decide(load("goddard"), DFET(4, 6), preference, ranges=ranges, starts=1)


def speed(T: float) -> float:
    return float(optimal_flight(T, 2)["vx"][-1])


@pytest.mark.slow
def test_goddard_between_time_and_speed() -> None:
    choice = goddard(WeightedSum({"flight time": 1.0, "horizontal speed": 0.5}))
    truth = minimize_scalar(
        lambda T: (T - 110) / 140 + 0.5 * (0.9 - speed(T)) / 0.9, bounds=(110, 250), method="bounded", options={"xatol": 1e-6}
    )
    assert 112 < truth.x < 249 and choice.value == pytest.approx(truth.fun, rel=1e-6) and choice.point.optimality < 1e-6
    choice = goddard(ReferencePoint({"flight time": 120.0, "horizontal speed": 0.8}))
    T = brentq(lambda T: (T - 120) / 140 - (0.8 - speed(T)) / 0.9, 112, 250, xtol=1e-10)
    assert choice.objectives == pytest.approx({"flight time": T, "horizontal speed": speed(T)}, rel=1e-5)
    assert choice.value == pytest.approx((1 + 2e-4) * (T - 120) / 140, rel=1e-6)


def test_an_end_that_its_mesh_makes_too_good_still_is_one() -> None:
    # On this mesh the fastest ascent takes less than any real one, so that it is not verified.
    choice = decide(load("goddard"), DFET(4, 6), WeightedSum({TIME: 1.0, SPEED: 1.0}), starts=1)
    assert choice.ranges.best[TIME] == pytest.approx(109.08, abs=0.01) and choice.ranges.worst[TIME] == pytest.approx(250.0)


@pytest.mark.slow
def test_peaks_of_the_user() -> None:
    # The front is (T, 16 / T^4), from 1 to 3.
    choice = decide(shuttle(), DFET(4, 2), ReferencePoint({"time": 1.5}), starts=1)
    T = brentq(lambda T: (T - 1.5) / 2 - (16 / T**4 - 16 / 81) / (16 - 16 / 81), 1, 3)
    assert choice.objectives["time"] == pytest.approx(T, rel=1e-5) and choice.point.optimality < 1e-6
    # The order of priority asks for a lower thrust only: it may be relaxed, as long as a rise of the peak is no gain.
    choice = decide(shuttle(), DFET(4, 2), FuzzySatisfactory({}, ["time", "largest thrust squared"]), starts=1)
    wide = 16 - 16 / 81
    T = minimize_scalar(lambda T: 0.6 * (T - 1) / 2 + 0.4 * (16 / T**4 - 16 / 81) / wide, bounds=(1, 3), method="bounded").x
    assert choice.objectives["time"] == pytest.approx(T, rel=1e-4)
    with pytest.raises(ValueError, match="may ask for a worse value of 'largest thrust squared'"):
        decide(shuttle(), DFET(4, 2), GoalProgramming({"largest thrust squared": Around(5.0)}), starts=1)


@pytest.mark.slow
def test_three_objectives_and_one_that_does_not_matter() -> None:
    choice = decide(corners(), MESH, WeightedSum({"from 0": 1.0, "from 2": 3.0}), starts=1)
    # Squared distances from two unit vectors, one thrice as heavy: a quarter of the way from the other.
    assert list(choice.point.parameters.values()) == pytest.approx([0.25, 0.0, 0.75], abs=1e-6)
    best, worst = ({f"from {i}": value for i in range(3)} for value in (0.0, 2.0))
    choice = decide(corners(), MESH, ReferencePoint(best), ranges=Ranges(best, worst), starts=1)
    assert list(choice.point.parameters.values()) == pytest.approx([1 / 3] * 3, abs=1e-5)


@pytest.mark.slow
def test_where_a_state_is_limited() -> None:
    choice = decide(bryson_denham(), DFET(8, 3), ReferencePoint({"highest": 0.1}), starts=1)
    assert choice.point.optimality < 1e-6 and choice.point.verified
    a, b = (1 - degree for degree in choice.degrees.values())
    assert a == pytest.approx(b, abs=1e-6)


@pytest.mark.slow
def test_ranges_that_say_nothing_of_where_the_front_is() -> None:
    # The optimum is thirty times the ranges away: what the derived problem looks for is not confined to these.
    narrow = Ranges({"effort": 50.0, "time": 0.6}, {"effort": 51.0, "time": 0.61})
    choice = decide(
        cart(),
        MESH,
        WeightedSum({"effort": 1.0, "time": 1e-9}),
        ranges=narrow,
        start=decide(cart(), MESH, WeightedSum({"time": 1.0}), ranges=RANGES, starts=1).point,
    )
    assert choice.objectives["effort"] == pytest.approx(12 / 64, rel=1e-6)


@cache
def front() -> Front:
    return sweep(cart(), MESH, points=11, starts=1)


@pytest.mark.parametrize("preference", [one[0] for one in KNOWN[::5]], ids=[repr(one[0]) for one in KNOWN[::5]])
def test_never_worse_than_the_best_ranked(preference: Preference) -> None:
    ranking = preference.rank(front(), RANGES)
    choice = decide(cart(), MESH, preference, ranges=RANGES, start=front())
    known = ranking.stage_values[ranking.order[0]]
    assert choice.value <= known[0] + 1e-6


@cache
def dense() -> Front:
    """Points of the front in closed form, in steps of 2e-4."""
    T = np.linspace(0.5, 4.0, 17_501)
    goals = cart().compile().goals
    F = np.stack([12 / T**3, T], axis=1)
    return Front(F=F, decision=np.empty((len(T), 0)), violation=np.zeros(len(T)), status=["converged"] * len(T), goals=goals)


def test_the_best_that_is_known_stands_where_solves_fail() -> None:
    preference = ReferencePoint({"effort": 10.0, "time": 0.7})
    choice = decide(cart(), MESH, preference, ranges=RANGES, start=front(), max_iterations=1)
    best = preference.rank(front(), RANGES).best
    assert choice.objectives == best.objectives and "the limit of 1 iterations was reached" in choice.message
    choice = decide(cart(), MESH, preference, ranges=RANGES, start=front(), time_limit=1e-9)
    assert choice.objectives == best.objectives and "time limit" in choice.message
    assert "time limit" in choice.stopped
    with pytest.raises(TimeoutError, match="time limit"):
        decide(cart(), MESH, preference, time_limit=1e-9)


@pytest.mark.slow
def test_same_seed_same_bits() -> None:
    preference = ReferencePoint({"effort": 10.0, "time": 0.7})
    one, other = (decide(cart(), MESH, preference, ranges=RANGES, starts=4, seed=5) for _ in range(2))
    assert one.point.decision.tobytes() == other.point.decision.tobytes() and one.value == other.value


# Hard limits that cannot be met, and arguments that make no sense


QUICKEST = WeightedSum({"time": 1.0})


def test_limits_that_cannot_be_met_together_are_named() -> None:
    # An effort of 11 takes (12 / 11)^(1/3) = 1.029.
    choice = decide(
        cart(), MESH, Nimbus({"effort": 10.0, "time": 1.0}, improve=["time"], until={"effort": 11.0}), ranges=RANGES, start=ends()
    )
    assert np.isinf(choice.value) and "\n" not in choice.message
    assert "time at most 1" in choice.message and "effort at most 11" in choice.message
    # The nearest exceeds both by the same part of their ranges.
    over = [(choice.objectives["time"] - 1.0) / 3.5, (choice.objectives["effort"] - 11.0) / (96 - 12 / 64)]
    assert over[0] == pytest.approx(over[1], rel=1e-4) and over[0] > 1e-3
    assert choice.history[0].value == pytest.approx(over[0], rel=1e-6)


def test_limits_that_no_known_point_meets_can_be_met() -> None:
    # Neither end of the front is within them.
    choice = decide(
        cart(), MESH, Nimbus({"effort": 10.0, "time": 1.1}, improve=["time"], until={"effort": 11.0}), ranges=RANGES, start=ends()
    )
    assert choice.message == "" and choice.objectives["effort"] == pytest.approx(11.0, rel=1e-6)
    assert [step.name for step in choice.history] == ["largest excess over hard limits", "achievement"]


BAD: list[tuple[Any, dict[str, Any], str]] = [
    ((lambda x: x, QUICKEST), {}, "needs derivatives.*preference.rank"),
    ((cart(), MESH), {}, "preference must be a Preference"),
    ((cart(), 3, QUICKEST), {}, "transcription must be a Transcription"),
    ((cart(), "dfet:4x6", QUICKEST), {}, "transcription must be a Transcription.*parse makes one from a word"),
    ((cart(), MESH, QUICKEST), {"start": 3}, "start must be a Front or a Point"),
    ((cart(), MESH, QUICKEST), {"starts": 0}, "starts"),
    ((cart(), MESH, QUICKEST), {"seed": -1}, "seed"),
    ((cart(), MESH, QUICKEST), {"ranges": Ranges({"effort": 1.0}, {"effort": 2.0})}, "the ranges have no 'time'"),
    ((cart(), MESH, ReferencePoint({"time": 9.0})), {"ranges": RANGES}, "beyond its range"),
]


@pytest.mark.parametrize(("arguments", "more", "words"), BAD, ids=[one[2] for one in BAD])
def test_bad_arguments_are_one_line_before_any_work(arguments: Any, more: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        decide(*arguments, **more)
    assert "\n" not in str(caught.value)


def test_black_boxes_and_other_problems_are_refused() -> None:
    box = MACS().minimize(lambda X: np.stack([X[:, 0], 1 - X[:, 0]], axis=1), [(0.0, 1.0)] * 2, evaluations=60, seed=1)
    with pytest.raises(ValueError, match="black box"):
        decide(cart(), MESH, QUICKEST, start=box)
    with pytest.raises(ValueError, match="needs derivatives"):
        decide(box, QUICKEST)
    with pytest.raises(ValueError, match="another problem, 'cart'"):
        decide(two_wells(), MESH, WeightedSum({"from left": 1.0}), start=ends())
    with pytest.raises(ValueError, match="satisfy takes a FuzzySatisfactory"):
        satisfy(cart(), MESH, QUICKEST)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_problem_without_a_feasible_point_says_what_is_violated() -> None:
    problem = two_wells()
    problem.constraint("beyond", problem.parameters["p"], lower=3.0)
    with pytest.raises(ValueError, match="no ranges; the nearest violates constraint 'beyond'"):
        decide(problem, MESH, WeightedSum({"from left": 1.0}))
    both = {"from left": 0.0, "from right": 0.0}, {"from left": 1.0, "from right": 1.0}
    choice = decide(problem, MESH, WeightedSum({"from left": 1.0}), ranges=Ranges(*both))
    assert choice.point.status != "converged" and choice.history[0].status != "converged"
    assert "the nearest violates constraint 'beyond'" in choice.message


@pytest.mark.slow
@pytest.mark.parametrize(("method", "words"), [(MESH, ""), (None, "no solve converged: ")], ids=["given", "found"])
def test_where_all_solves_fail_the_message_says_why(monkeypatch: pytest.MonkeyPatch, method: Any, words: str) -> None:
    """From the ends of the front, with boxes of a tenth of the bounds, solves do not reach what is asked for."""
    preference, known = ReferencePoint({"effort": 10.0, "time": 0.7}), ends()
    monkeypatch.setattr(scalarized, "_strategies", lambda *_: (scalarized.NEAR,))
    monkeypatch.setattr(scalarized, "SOLVE", replace(scalarized.SOLVE, restarts=0))
    choice = decide(cart(), method, preference, ranges=RANGES, start=known)
    assert choice.message == f"achievement: {words}{scalarized.IN_BOX}; {NO_OPTIMUM}"
    assert choice.history[0].status == "failed" and choice.history[0].message == f"{words}{scalarized.IN_BOX}"
    # Where they ended is feasible, and better than what was known.
    assert choice.point.status == "converged" and choice.point.verified and choice.point.optimality > 1e-6
    best = preference.rank(known, RANGES)
    assert choice.value < best.values[best.order[0]] - 1e-3 and NO_OPTIMUM in choice.point.note


@pytest.mark.parametrize(
    ("call", "preference"),
    [
        (decide, WeightedSum({"tyme": 1.0})),
        (decide, PhysicalProgramming({"tyme": Smaller(1, 2, 3, 4, 5)})),
        (decide, Nimbus({"effort": 10.0, "time": 1.0}, improve=["tyme"], free=["effort"])),
        (decide, ReferencePoint({"time": 1.0}, {"tyme": 2.0})),
        (satisfy, FuzzySatisfactory({}, ["effort", "tyme"])),
    ],
    ids=lambda one: type(one).__name__,
)
def test_names_are_checked_before_any_work(call, preference) -> None:
    # A payoff table, which would be first, ends at once.
    with pytest.raises(ValueError, match="unknown objective 'tyme'"):
        call(cart(), MESH, preference, time_limit=1e-9)
