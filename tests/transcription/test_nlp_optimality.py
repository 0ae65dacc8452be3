"""The certificate of optimality: residuals and multipliers against closed forms, by hand, and what is left once the states follow."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from cases import slot
from scipy.sparse import csr_matrix, diags
from smooth_problems import bryson_denham, nlp_of, shuttle, slide, still, two_wells, vector

from problems import Problem, load
from transcription import DFET, NLP
from transcription.inner import inner_solver
from transcription.nlp.optimality import Conditions, Linearised, Multipliers, optimality, steepest
from transcription.nlp.scalarized import scalarize

SPAN = 4.0
"""Of the parameters of `two_wells`."""


def at(nlp: NLP, **values: float) -> float:
    return optimality(nlp, vector(nlp, **values), np.ones(len(nlp.problem.goals)))


@pytest.mark.parametrize("p", [0.0, 1e-3, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("q", [0.0, 0.1, -0.5])
def test_between_the_wells_only_the_distance_from_the_line_is_left(p: float, q: float) -> None:
    # mu = (1 - p, p) makes the derivative in p vanish; in q it is 2 q, whatever mu.
    assert at(nlp_of(two_wells()), p=p, q=q) == pytest.approx(2 * abs(q) * SPAN, abs=1e-12)


def test_beyond_a_well_at_a_bound_in_other_scales_and_with_equations_twice() -> None:
    assert at(nlp_of(two_wells()), p=1.5, q=0.0) == pytest.approx(2 * 0.5 * SPAN)
    assert at(nlp_of(two_wells()), p=-0.25, q=0.0) == pytest.approx(2 * 0.25 * SPAN)
    assert at(nlp_of(two_wells(q=(0.5, 2.0))), p=0.3, q=0.5) == pytest.approx(0, abs=1e-12)
    assert at(nlp_of(two_wells(q=(-2.0, 0.5))), p=0.3, q=0.5) == pytest.approx(2 * 0.5 * 2.5)
    nlp = nlp_of(two_wells())
    z = vector(nlp, p=0.5, q=0.25)
    assert optimality(nlp, z, np.array([10.0, 10.0])) == pytest.approx(0.1 * optimality(nlp, z, np.ones(2)))
    # In other scales, mu is another one, but what can be made to vanish still is.
    assert optimality(nlp, vector(nlp, p=0.5, q=0.0), np.array([1e-3, 50.0])) == pytest.approx(0, abs=1e-9)
    # A range of zero, of an objective that does not vary over a front, stands for its own scale.
    assert 0 < optimality(nlp, z, np.zeros(2)) == pytest.approx(optimality(nlp, z))
    problem = two_wells()
    for factor in (1, 2):
        problem.constraint(f"wall {factor}", factor * problem.parameters["q"], lower=0.5 * factor, upper=0.5 * factor)
    nlp = nlp_of(problem)
    assert at(nlp, p=0.3, q=0.5) == pytest.approx(0, abs=1e-9)
    assert at(nlp, p=1.3, q=0.5) == pytest.approx(2 * 0.3 * SPAN, rel=1e-6)


def test_the_states_are_eliminated_by_their_adjoint() -> None:
    nlp = nlp_of(slide())
    for c in (0.05, 0.25, 0.5):
        assert at(nlp, u=c) == pytest.approx(0, abs=1e-9)
    # Of a constant control c, both objectives fall with it where c < 0: by 4 |c| and 4 (1 - 2 c), times what is a constant control's
    # share of a unit vector of coefficients. mu takes the lesser.
    weights = 0.5 / 4 * np.tile(np.polynomial.legendre.leggauss(3)[1], 4)
    assert at(nlp, u=-0.1) == pytest.approx(4 * 0.1 * np.linalg.norm(weights) * 4, rel=1e-9)


def solved(nlp: NLP, ranges: np.ndarray, share: float) -> np.ndarray:
    """A vector of the front that scalarize finds, from random controls."""
    rng = np.random.default_rng(5)
    candidates = nlp.lower[nlp.free] + rng.random((1, len(nlp.free))) * nlp.span[nlp.free]
    start = nlp.propagate(nlp.first_guess(candidates))[0]
    (F,), _ = nlp.evaluate(start[None])
    found = scalarize(nlp, start, reference=F - ranges * np.array([share, 1 - share]), weights=ranges)
    assert found.status == "converged"
    return found.z


CASES = {
    "goddard": (DFET(4, 6), np.array([141.0, 0.9])),
    "orbit_rise": (DFET(30, 1), np.array([60.0, 0.34])),
    "orbit_rise_full": (DFET(30, 1), np.array([60.0, 0.34])),
}


@pytest.mark.parametrize("name", CASES)
def test_small_on_the_front_and_large_off_it(name: str) -> None:
    mesh, ranges = CASES[name]
    nlp = mesh.transcribe(load(name))
    z = solved(nlp, ranges, 0.5)
    assert optimality(nlp, z, ranges) < 1e-8
    rng = np.random.default_rng(1)
    moved = z[nlp.free] + 0.05 * nlp.span[nlp.free] * rng.normal(size=len(nlp.free))
    again = inner_solver("auto").solve(nlp, np.clip(moved, nlp.lower[nlp.free], nlp.upper[nlp.free])[None], z[None])
    assert again.status[0] == "converged" and optimality(nlp, again.z[0], ranges) > 1e-3


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


def test_weights_of_two_objectives_and_what_the_best_of_a_mixture_leave() -> None:
    nlp = nlp_of(two_wells(q=(0.5, 2.0)), SMALLEST)
    for p in (0.0, 0.2, 0.9):
        multipliers = check(nlp, vector(nlp, p=p, q=0.5), np.array([1.0, 1.0]))
        assert multipliers.of_objectives == pytest.approx([1 - p, p], abs=1e-6)
        assert multipliers.of_bounds[slot(nlp, "q")] == pytest.approx(-2 * 0.5)
    # In other scales it is the ratio that stays.
    multipliers = check(nlp, vector(nlp, p=0.2, q=0.5), np.array([0.5, 8.0]))
    assert multipliers.of_objectives[1] / multipliers.of_objectives[0] == pytest.approx(0.2 / 0.8, rel=1e-5)
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


ONE = np.ones(1)


def flight(gain: float = 1.0, final: float | None = None, rate: float = 0.0) -> tuple[Problem, Any]:
    """x' = rate x + gain u in 2 time units, with u in a box of width 2."""
    problem = Problem("flight")
    run = problem.phase("run", t0=0, tf=2)
    x, u = run.state("x", bounds=(-1, 1), initial=0, final=final), run.control("u", bounds=(-1, 1))
    run.dynamics(x=rate * x + gain * u)
    return problem, run


@pytest.mark.parametrize("gain", [1e-9, 1.0, 1e8, 1e12])
def test_however_sensitive_states_are_their_total_derivative_is_left(gain: float) -> None:
    problem, run = flight(gain)
    problem.minimize("end", run.final(run["x"]))
    nlp = nlp_of(problem, DFET(1, 0))
    # x(2) = 2 gain u, by a width of 2.
    assert optimality(nlp, np.zeros(len(nlp.variables)), ONE) == pytest.approx(4 * gain, rel=1e-12)


@pytest.mark.parametrize("gain", [1e-3, 1.0, 1e8])
@pytest.mark.parametrize("u", [0.0, 0.3])
def test_an_imposed_end_takes_what_it_can(gain: float, u: float) -> None:
    problem, run = flight(gain, final=0.0)
    problem.minimize("effort", run.integral((1 + run.time) * run["u"] + run["u"] ** 2))
    nlp = nlp_of(problem, DFET(2, 0))
    z = np.zeros(len(nlp.variables))
    z[nlp.free] = u, -u
    z = nlp.propagate(z[None])[0]
    # By the controls of the halves the gradient is (3/2 + 2 u, 5/2 - 2 u); of it, the end takes the mean. Widths are 2.
    slope = 2 * np.array([1.5 + 2 * u, 2.5 - 2 * u])
    conditions = Conditions.of(nlp, z, ONE)
    assert conditions is not None
    assert conditions.reduced[:, 0] == pytest.approx(slope - slope.mean(), rel=1e-9, abs=1e-9)
    assert conditions.residual == pytest.approx(np.sqrt(2) * abs(1 - 4 * u), rel=1e-9)
    # The costate of x is that mean over the gain: what is left by the states is nothing, too.
    equations = conditions.linear.of_equations
    states = np.setdiff1d(np.arange(len(z)), nlp.free)
    adjoint = conditions.adjoints[:, 0]
    assert (equations.T @ adjoint)[states] == pytest.approx(conditions.linear.of_objectives[0, states], abs=1e-9)
    assert (equations.T @ adjoint)[nlp.free] == pytest.approx(np.full(2, slope.mean()), rel=1e-9)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("rate", [1.0, 3.0])
def test_equations_that_determine_no_states_have_no_adjoint(rate: float, size: float) -> None:
    # With one coefficient of x, its mean m, on one element: x(2) - x(0) = 2 rate m and the moment of the equation make 1 - rate a factor
    # of all that x can do; where it is 0, x is anything, and no multiplier of the equations takes its slope.
    problem, run = flight(rate=rate)
    problem.minimize("end", run.final(run["x"]))
    nlp = nlp_of(problem, DFET(1, 0))
    residual = optimality(nlp, np.zeros(len(nlp.variables)), ONE / size)
    assert residual == np.inf if rate == 1.0 else 0 < residual < 10 * size


@pytest.mark.parametrize("elements", [2, 30])
def test_where_states_are_free_too_the_rest_of_a_projection_is_left(elements: int) -> None:
    # Few equations or many, each of a free vector: of the gradient, what they span is taken away.
    problem, run = flight(rate=-0.5, final=0.0)
    problem.minimize("effort", run.integral(run["x"] + run.time * run["u"]))
    nlp = nlp_of(problem, DFET(elements, 1)).whole
    assert len(nlp.free) == len(nlp.variables)
    conditions = Conditions.of(nlp, np.zeros(len(nlp.variables)), ONE)
    assert conditions is not None
    equations, gradient = conditions.linear.of_equations.toarray(), conditions.linear.of_objectives[0]
    left = gradient - equations.T @ np.linalg.lstsq(equations.T, gradient)[0]
    assert conditions.reduced[:, 0] == pytest.approx(left, abs=1e-9) and conditions.residual == pytest.approx(np.linalg.norm(left))


def test_products_that_overflow_are_no_residual() -> None:
    # The derivatives are numbers, their product is none.
    problem, run = flight(1e200)
    problem.minimize("end", 1e200 * run.final(run["x"]))
    nlp = nlp_of(problem, DFET(1, 0))
    z = np.zeros(len(nlp.variables))
    assert Linearised.of(nlp, z, ONE) is not None
    assert Conditions.of(nlp, z, ONE) is None and optimality(nlp, z, ONE) == np.inf


@pytest.mark.parametrize("broken", ["slope of the objective", "slope of a constraint", "a constraint"])
def test_derivatives_and_values_that_are_no_numbers(broken: str) -> None:
    problem = still("broken")
    p, q = problem.parameter("p", bounds=(0, 1)), problem.parameter("q", bounds=(0, 1))
    problem.minimize("f", ca.sqrt(p) if broken == "slope of the objective" else q)
    if broken == "slope of a constraint":
        problem.constraint("c", ca.sqrt(p) + q, lower=0, scale=1)
    elif broken == "a constraint":
        problem.constraint("c", 1e308 * p + 1e308 * q, lower=0, scale=1)
    nlp = nlp_of(problem, DFET(1, 0))
    good, bad = vector(nlp, p=0.5, q=0.5), vector(nlp, p=1.0 if broken == "a constraint" else 0.0, q=1.0)
    assert Linearised.of(nlp, good, ONE) is not None and np.isfinite(optimality(nlp, good, ONE))
    assert Linearised.of(nlp, bad, ONE) is None and optimality(nlp, bad, ONE) == np.inf


@pytest.mark.parametrize("small", [1.0, 1e-3, 1e-4])
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_the_steepest_direction_does_not_depend_on_the_size_of_equations_or_gradients(small: float, size: float) -> None:
    # On s0 + s1 = 0 with lengths 1 and 2 of s0 and s1, of the gradient (1, 0) remains s = (1, -1)/3: then (1, 0) - (1, -2)/3 = 2/3 (1, 1).
    metric, equations = diags([1.0, 2.0, 1.0]), csr_matrix([[small, small, 0.0]])
    gradients = size * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 5.0]])
    s, multipliers = steepest(metric, equations, gradients)
    assert s / size == pytest.approx(np.array([[1 / 3, 0], [-1 / 3, 0], [0, 5]]), rel=1e-7, abs=1e-7)
    assert multipliers / size * small == pytest.approx(np.array([[2 / 3, 0]]), rel=1e-7)


def test_states_are_eliminated_where_objectives_do_not_depend_on_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the least time nothing but that equations of states are met depends on states: no larger system is needed."""
    monkeypatch.setattr("transcription.nlp.optimality.steepest", None)
    problem = Problem("dash")
    dash = problem.phase("dash", t0=0.0, tf=(0.5, 5.0))
    dash.state("x", bounds=(-2, 2), initial=0, final=1)
    v = dash.state("v", bounds=(-2, 2), initial=0, final=0)
    dash.dynamics(x=v, v=dash.control("u", bounds=(-1, 1)))
    problem.minimize("time", dash.tf)
    nlp = DFET(2, 2).nlp(problem)
    solved = scalarize(nlp, nlp.first_guess(0.5 * (nlp.lower + nlp.upper)[nlp.free][None])[0], reference=np.zeros(1), weights=np.ones(1))
    assert solved.F[0] == pytest.approx(2.0, abs=1e-6) and optimality(nlp, solved.z) < 1e-6
