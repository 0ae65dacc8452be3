"""Multipliers of small programs, by hand; and what they are said to do: leave the residual, and vanish where nothing is at a limit."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from cases import slot
from smooth_problems import bryson_denham, nlp_of, shuttle, slide, still, two_wells, vector

from transcription import DFET, NLP
from transcription.nlp.optimality import Conditions, Multipliers, optimality
from transcription.nlp.scalarized import scalarize

SMALLEST = DFET(1, 0)
"""One coefficient of each control."""
P, Q = (-2.0, 2.0), (0.0, 10.0)
"""Bounds of the parameters of `plane`."""


def plane(slope: tuple[float, float] = (3.0, -4.0), **limits: Any) -> NLP:
    """A linear objective of p and q, and a limit of 2 p + 5 q, of which 7 counts as one."""
    problem = still("plane")
    p, q = problem.parameter("p", bounds=P, scale=1.0), problem.parameter("q", bounds=Q)
    if limits:
        problem.constraint("limit", 2 * p + 5 * q, scale=7.0, **limits)
    problem.minimize("f", slope[0] * p + slope[1] * q)
    return nlp_of(problem, SMALLEST)


def found(nlp: NLP, z: np.ndarray, F_scales: Any = None) -> Multipliers:
    conditions = Conditions.of(nlp, z, None if F_scales is None else np.array(F_scales))
    assert conditions is not None
    multipliers = conditions.multipliers()
    assert multipliers is not None
    return multipliers


def row(nlp: NLP, label: str) -> int:
    return nlp.g_labels.index(label)


def check(nlp: NLP, z: np.ndarray, F_scales: np.ndarray) -> Multipliers:
    """The multipliers, after a look at all that is said of them: by derivatives of the program's own functions."""
    multipliers = found(nlp, z, F_scales)
    symbol = ca.MX.sym("z", len(z))
    F, g = nlp.functions(symbol)
    dF, dg, values = (np.array(one) for one in ca.Function("d", [symbol], [ca.jacobian(F, symbol), ca.jacobian(g, symbol), g])(z))
    unit = np.where(np.isfinite(nlp.span), nlp.span, nlp.scale)
    left = (multipliers.of_objectives @ dF + multipliers.of_rows @ dg + multipliers.of_bounds) * unit
    measured = np.isinf(nlp.span)
    measured[nlp.free] = True
    assert left[~measured] == pytest.approx(0, abs=1e-9), "the derivatives by the states vanish"
    one_way = nlp.g_lower < nlp.g_upper
    products = []
    for low, value, high, own in (
        (nlp.lower, z, nlp.upper, multipliers.of_bounds),
        (nlp.g_lower[one_way], values[one_way, 0], nlp.g_upper[one_way], multipliers.of_rows[one_way]),
    ):
        slack = np.where(own > 0, high - value, value - low)
        products.append(own[own != 0] * np.maximum(slack[own != 0], 0.0))
    residual = np.linalg.norm(np.concatenate([left[measured], *products]))
    assert residual == pytest.approx(optimality(nlp, z, F_scales), rel=1e-5, abs=1e-9)
    used = np.isfinite(F_scales)
    assert (multipliers.of_objectives >= 0).all() and not multipliers.of_objectives[~used].any()
    assert (multipliers.of_objectives * F_scales)[used].sum() == pytest.approx(1)
    return multipliers


@pytest.mark.parametrize("scale", [1.0, 0.5, 20.0])
@pytest.mark.parametrize("slope", [(3.0, -4.0), (-3.0, 4.0)])
def test_at_a_corner_of_the_box_they_are_the_slopes(slope: tuple[float, float], scale: float) -> None:
    nlp = plane(slope)
    p, q = (P[0], Q[1]) if slope[0] > 0 else (P[1], Q[0])
    multipliers = check(nlp, vector(nlp, p=p, q=q), np.array([scale]))
    assert multipliers.of_objectives == pytest.approx([1 / scale])
    # Positive at upper bounds, negative at lower ones.
    assert multipliers.of_bounds[[slot(nlp, "p"), slot(nlp, "q")]] == pytest.approx(-np.array(slope) / scale)


@pytest.mark.parametrize(
    ("slope", "limits"), [((-6, -15), {"upper": 10.0}), ((6, 15), {"lower": 10.0}), ((6, 15), {"upper": 10.0, "lower": 10.0})]
)
def test_a_row_has_what_its_limit_is_worth(slope: tuple[float, float], limits: dict[str, float]) -> None:
    # The objective is +-3 times what is limited: a unit more of the limit changes it by so much.
    nlp = plane(slope, **limits)
    multipliers = check(nlp, vector(nlp, p=0.0, q=2.0), np.array([2.0]))
    assert multipliers.of_rows[row(nlp, "constraint 'limit'")] == pytest.approx(-slope[0] / 2 / 2)
    assert multipliers.of_bounds == pytest.approx(0, abs=1e-12)
    assert optimality(nlp, vector(nlp, p=0.0, q=2.0), np.array([2.0])) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("slope", "limits"), [((6, 15), {"upper": 10.0}), ((-6, -15), {"lower": 10.0})])
def test_a_limit_on_the_wrong_side_has_none(slope: tuple[float, float], limits: dict[str, float]) -> None:
    nlp = plane(slope, **limits)
    z = vector(nlp, p=0.0, q=2.0)
    assert found(nlp, z, [1.0]).of_rows == pytest.approx(0, abs=1e-12)
    assert optimality(nlp, z, np.array([1.0])) == pytest.approx(np.hypot(6 * 4, 15 * 10))


@pytest.mark.parametrize("side", ["lower", "upper"])
@pytest.mark.parametrize("away", [1e-6, 1e-3, 0.05])
def test_bounds_count_by_their_slack_in_spans(side: str, away: float) -> None:
    # Slope k in spans and slack s: of multiplier v are left (k - v, s v), at best k s/sqrt(1 + s^2), by v = k/(1 + s^2).
    nlp = plane((0.0, 4.0 if side == "lower" else -4.0))
    z = vector(nlp, p=0.0, q=Q[0] + away if side == "lower" else Q[1] - away)
    k, s = 4.0 * 10, away / 10
    multipliers = check(nlp, z, np.array([1.0]))
    assert optimality(nlp, z, np.array([1.0])) == pytest.approx(k * s / np.sqrt(1 + s**2), rel=1e-6)
    assert multipliers.of_bounds[slot(nlp, "q")] == pytest.approx((-1 if side == "lower" else 1) * 4.0 / (1 + s**2), rel=1e-6)


@pytest.mark.parametrize("side", ["lower", "upper"])
@pytest.mark.parametrize("away", [1e-5, 1e-2, 0.06])
def test_rows_count_by_their_slack_in_scales(side: str, away: float) -> None:
    # In units the row's gradient is (2 * 4, 5 * 10)/7 = a, the objective's is 3 * 7 a; with slack s, at best 21 |a| s/sqrt(|a|^2 + s^2).
    sign = 1.0 if side == "lower" else -1.0
    nlp = plane((6 * sign, 15 * sign), **{side: 10.0})
    z = vector(nlp, p=sign * away / 2, q=2.0)
    a, s = np.hypot(8, 50) / 7, away / 7
    multipliers = check(nlp, z, np.array([1.0]))
    assert optimality(nlp, z, np.array([1.0])) == pytest.approx(21 * a * s / np.sqrt(a**2 + s**2), rel=1e-6)
    assert multipliers.of_rows[row(nlp, "constraint 'limit'")] == pytest.approx(-sign * 3 * a**2 / (a**2 + s**2), rel=1e-6)


def test_what_is_far_from_a_limit_has_no_multiplier() -> None:
    # A little more than a hundredth of a span or scale: of the bound below, of the row below and above, and of the bound above.
    for q, limits in ((0.11, {"upper": 50.0}), (2.0, {"lower": 9.92}), (2.0, {"upper": 10.08}), (9.89, {"lower": 0.0})):
        nlp = plane((0.0, 4.0 if q < 1 or "lower" in limits else -4.0), **limits)
        z = vector(nlp, p=0.0, q=q)
        multipliers = found(nlp, z, [1.0])
        assert not multipliers.of_bounds.any() and not multipliers.of_rows.any()
        assert optimality(nlp, z, np.array([1.0])) == pytest.approx(4 * 10)


def test_weights_of_two_objectives() -> None:
    nlp = nlp_of(two_wells(q=(0.5, 2.0)), SMALLEST)
    for p in (0.0, 0.2, 0.9):
        multipliers = check(nlp, vector(nlp, p=p, q=0.5), np.array([1.0, 1.0]))
        assert multipliers.of_objectives == pytest.approx([1 - p, p], abs=1e-6)
        assert multipliers.of_bounds[slot(nlp, "q")] == pytest.approx(-2 * 0.5)
    # In other scales it is the ratio that stays.
    multipliers = check(nlp, vector(nlp, p=0.2, q=0.5), np.array([0.5, 8.0]))
    assert multipliers.of_objectives[1] / multipliers.of_objectives[0] == pytest.approx(0.2 / 0.8, rel=1e-5)


def test_a_mixture_has_what_its_best_weights_leave() -> None:
    nlp = nlp_of(two_wells(q=(0.5, 2.0)), SMALLEST)
    s = 0.003 / 1.5
    z = vector(nlp, p=0.3, q=0.503)
    conditions = Conditions.of(nlp, z, np.ones(2))
    assert conditions is not None
    bound = 2 * 0.503 * 1.5 * s / np.sqrt(1 + s**2)
    for columns, weight in (([0.3], 0.3), ([0], 0.0), ([1], 1.0), ([0, 0.5], 0.3), ([0, 0.1], 0.1), ([1, 0.4], 0.4)):
        assert conditions.residual_of(np.array([1 - np.array(columns), columns])) == pytest.approx(
            np.hypot(2 * (0.3 - weight) * 4, bound), rel=1e-6
        )


# Where limits say the same, the multipliers are not unique.


def test_a_bound_of_a_free_variable_is_named_rather_than_a_row() -> None:
    for side, at in (("lower", P[0]), ("upper", P[1])):
        problem = still("same limit")
        p = problem.parameter("p", bounds=P)
        problem.constraint("limit", 5 * p, scale=3.0, **{side: 5 * at})
        problem.minimize("f", 6 * p if side == "lower" else -6 * p)
        nlp = nlp_of(problem, SMALLEST)
        multipliers = check(nlp, vector(nlp, p=at), np.array([1.0]))
        assert multipliers.of_bounds[slot(nlp, "p")] == pytest.approx(-6 if side == "lower" else 6, rel=1e-6)
        assert multipliers.of_rows == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_rows_that_say_the_same_share(side: str) -> None:
    # The least squares of a + b = 6 are 3 and 3, those of a + 2 b = 6 are 6/5 and 12/5, of which the latter takes 24/5.
    for factor, shares in ((1.0, (3.0, 3.0)), (2.0, (6 / 5, 6 * 4 / 5))):
        problem = still("same rows")
        p = problem.parameter("p", bounds=P)
        problem.constraint("one", p, scale=1.0, **{side: 1.0})
        problem.constraint("other", factor * p, scale=1.0, **{side: factor})
        problem.minimize("f", 6 * p if side == "lower" else -6 * p)
        nlp = nlp_of(problem, SMALLEST)
        both = check(nlp, vector(nlp, p=1.0), np.array([1.0])).of_rows[[row(nlp, "constraint 'one'"), row(nlp, "constraint 'other'")]]
        assert np.abs(both) * [1, factor] == pytest.approx(shares, rel=1e-5)


@pytest.mark.parametrize(
    ("make", "reference"),
    [(lambda: slide(limit=0.5), [np.inf, 0.0]), (shuttle, [2.0, 0.0]), (bryson_denham, [0.0, 0.1])],
    ids=["wall", "peak", "path"],
)
def test_on_fronts_with_states_peaks_and_paths_they_leave_the_residual(make: Any, reference: list[float]) -> None:
    nlp = nlp_of(make(), DFET(3, 2))
    middle = nlp.first_guess((nlp.lower[nlp.free] + 0.5 * nlp.span[nlp.free])[None])[0]
    solved = scalarize(nlp, middle, reference=np.array(reference), weights=np.ones(2))
    assert solved.status == "converged"
    multipliers = check(nlp, solved.z, np.array([2.0, 3.0]))
    assert np.abs(multipliers.of_rows[nlp.g_lower < nlp.g_upper]).max() > 1e-2
    check_alone(nlp, solved.z)


def check_alone(nlp: NLP, z: np.ndarray) -> None:
    """Those of one objective, from those of both, are the same as if the other had been left out from the beginning."""
    both = Conditions.of(nlp, z, np.array([2.0, 3.0]))
    assert both is not None
    for sole in (np.array([True, False]), np.array([False, True])):
        alone, other = both.alone(sole), Conditions.of(nlp, z, np.where(sole, [2.0, 3.0], np.inf))
        assert other is not None and alone.residual == pytest.approx(other.residual, rel=1e-9, abs=1e-12)
        assert alone.residual >= both.residual * (1 - 1e-9)
        one, two = alone.multipliers(), other.multipliers()
        assert one is not None and two is not None
        for name in ("of_objectives", "of_rows", "of_bounds"):
            np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=1e-7, atol=1e-9)
