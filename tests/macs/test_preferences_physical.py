"""Physical programming: preference functions over all classes and boundaries; fuzzy ones against adaptive quadrature."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from choices import cart, turned_cart
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from macs.decisions import FuzzyPhysicalProgramming, Larger, PhysicalProgramming, Range, Smaller, Value
from macs.preferences.preference_functions import FuzzyFunction, PreferenceFunction

CLASSES = {Smaller: 5, Larger: 5, Value: 9, Range: 10}
GAPS = st.floats(-2, 2).map(lambda power: 10.0**power)


@st.composite
def objective_class(draw):
    """A class with boundaries at gaps that differ by up to four orders of magnitude, somewhere, in some unit."""
    kind = draw(st.sampled_from([*CLASSES]))
    gaps = np.array(draw(st.lists(GAPS, min_size=CLASSES[kind] - 1, max_size=CLASSES[kind] - 1)))
    marks = np.concatenate([[0.0], np.cumsum(gaps)]) + draw(st.floats(-10, 10)) * gaps.sum()
    marks = marks * 10.0 ** draw(st.integers(-6, 6))
    return kind(*(marks[::-1] if kind is Larger else marks).tolist())


def functions(classes) -> list[PreferenceFunction]:
    return list(PhysicalProgramming({f"J{k}": one for k, one in enumerate(classes)}).functions.values())


MANY = st.lists(objective_class(), min_size=1, max_size=6)


def samples(function: PreferenceFunction) -> np.ndarray:
    """Values all over an objective: many in each of its ranges, and beyond."""
    marks = np.array([mark for mark, _ in function.boundaries])
    wide = np.concatenate([[2 * marks[0] - marks[-1]], marks, [2 * marks[-1] - marks[0]]])
    return np.unique(np.concatenate([np.linspace(low, high, 60) for low, high in pairwise(wide)]))


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(MANY)
def test_exact_and_equal_at_boundaries(classes):
    found = functions(classes)
    z = found[0].z
    assert z[0] == 0.1
    # One objective that crosses a range costs more than all others that cross the one before.
    assert np.all(np.diff(z)[1:] > max(len(classes) - 1, 1) * np.diff(z)[:-1])
    for function, one in zip(found, classes, strict=True):
        assert np.array_equal(function.z, z)
        for side in one.sides:
            assert np.array([float(function(J)) for J in side.boundaries]) == pytest.approx(z, rel=1e-14)


@settings(max_examples=40, deadline=None)
@given(MANY)
def test_monotone_and_positive(classes):
    for function, one in zip(functions(classes), classes, strict=True):
        J = samples(function)
        p = function(J)
        assert np.all(p > 0)
        for side in one.sides:
            way = side.direction * (J - side.boundaries[0])
            inside = way >= 0 if len(one.sides) > 1 else np.isfinite(way)
            rising = p[inside][np.argsort(way[inside])]
            assert np.all(np.diff(rising) >= -1e-14 * rising[1:])
            # Between the first and the last boundary strictly so, each sample from the other.
            between = np.sort(way[(way >= 0) & (side.direction * (J - side.boundaries[-1]) <= 0)])
            values = function(side.boundaries[0] + side.direction * between)
            assert values[-1] > values[len(values) // 2] > values[0]


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(MANY)
def test_once_continuously_differentiable(classes):
    for function in functions(classes):
        x = ca.SX.sym("x")
        slope = ca.Function("slope", [x], [ca.gradient(function(x), x)])
        curvature = ca.Function("curvature", [x], [ca.hessian(function(x), x)[0]])
        marks = [mark for mark, _ in function.boundaries]
        for k, mark in enumerate(marks):
            step = 1e-9 * min(abs(mark - other) for other in (*marks[:k], *marks[k + 1 :]))
            here, near = float(slope(mark)), (mark - step, mark + step)
            # What the second derivative on either side, which is bounded, changes over the step and over the rounding of J.
            change = max(float(curvature(one)) for one in near) * (step + 1e-15 * max(map(abs, marks)))
            for one in near:
                assert float(slope(one)) == pytest.approx(here, rel=1e-9, abs=2 * change)


@settings(max_examples=40, deadline=None)
@given(objective_class())
def test_least_where_ideal(one):
    function = functions([one])[0]
    if isinstance(one, Value):
        assert function(one.boundaries[4]) == pytest.approx(0.1, rel=1e-15)
        assert np.all(function(samples(function)) >= 0.1 * (1 - 1e-14))
    elif isinstance(one, Range):
        inside = np.linspace(one.boundaries[4], one.boundaries[5], 11)
        assert function(inside) == pytest.approx(0.1, rel=1e-15)
        assert np.all(function(samples(function)) >= 0.1 * (1 - 1e-14))
    else:
        side = one.sides[0]
        first, second = side.boundaries[:2]
        slope = 0.1 * (function.z[1] - function.z[0]) / abs(second - first)
        for far in (1e-3, 0.3, 2.0):
            J = first - far * (second - first)
            exponent = -slope * abs(J - first) / 0.1
            assert function(J) == pytest.approx(0.1 * np.exp(max(exponent, -600.0)), rel=1e-6)


def test_the_spline_is_the_quartic_with_its_ends_and_slopes():
    """p'' = a xi^2 + b (xi - 1)^2, with the values and slopes of Messac's rules at both ends, found as a linear system."""
    marks, beta, count = np.array([1.0, 2.5, 3.0, 4.2, 6.0]), 1.5, 4
    function = functions([Smaller(*marks), *(Smaller(1, 2, 3, 4, 5),) * (count - 1)])[0]
    beta = function.beta
    steps = 0.1 * (beta * (count - 1)) ** np.arange(5)
    z, length = np.cumsum(steps), np.diff(marks)
    slope = [0.1 * steps[1] / length[0]]
    for k in range(4):
        mean = steps[k + 1] / length[k]
        least, most = (4 * mean - slope[-1]) / 3, 4 * mean - 3 * slope[-1]
        slope.append(least + 0.1 * (most - least))
        # p = a xi^4 / 12 + b (xi - 1)^4 / 12 + c xi + d.
        rows = [[0, 1 / 12, 0, 1], [1 / 12, 0, 1, 1], [0, -1 / 3, 1, 0], [1 / 3, 0, 1, 0]]
        a, b, c, d = np.linalg.solve(rows, [z[k], z[k + 1], slope[k] * length[k], slope[k + 1] * length[k]])
        assert a > 0 and b > 0
        xi = np.linspace(0, 1, 11)
        assert function(marks[k] + xi * length[k]) == pytest.approx(a * xi**4 / 12 + b * (xi - 1) ** 4 / 12 + c * xi + d, rel=1e-12)


def test_degrees_are_the_numbers_of_boundaries():
    one = Smaller(1, 2, 4, 5, 8)
    assert one.degree(np.array([1, 2, 4, 5, 8])) == pytest.approx([1, 2, 3, 4, 5])
    assert one.degree(np.array([1.5, 3.0, 6.5, 9.5])) == pytest.approx([1.5, 2.5, 4.5, 5.5])
    below = one.degree(np.array([-5.0, 0.0, 0.9]))
    assert np.all((below > 0) & (below < 1) & (np.diff(below, append=1) > 0))
    assert Larger(8, 5, 4, 2, 1).degree(np.array([8, 5, 4, 2, 1, 0, 9])) == pytest.approx([1, 2, 3, 4, 5, 6, np.exp(-1 / 3)])
    value = Value(0, 1, 2, 3, 4, 5, 6, 7, 8)
    assert value.degree(np.arange(-1, 10.0)) == pytest.approx([6, 5, 4, 3, 2, 1, 2, 3, 4, 5, 6])
    within = Range(0, 1, 2, 3, 4, 6, 7, 8, 9, 10)
    assert within.degree(np.array([-1, 0, 3, 4, 4.5, 5, 6, 6.5, 10])) == pytest.approx([6, 5, 2, 1, 0.5, 0, 1, 1.5, 5])


@settings(max_examples=30, deadline=None)
@given(st.lists(GAPS, min_size=4, max_size=4), st.lists(GAPS, min_size=4, max_size=4))
def test_units_and_senses_do_not_matter(first, second):
    time = 1.0 + np.concatenate([[0.0], np.cumsum(first) * 3 / sum(first)])
    effort = 0.2 + np.concatenate([[0.0], np.cumsum(second) * 7 / sum(second)])
    one = PhysicalProgramming({"time": Smaller(*time), "effort": Smaller(*effort)}).rank(cart(101))
    other = PhysicalProgramming({"time": Smaller(*(1e3 * time)), "effort": Larger(*(-1e10 * effort))}).rank(turned_cart(101))
    assert other.values == pytest.approx(one.values, rel=1e-9, abs=1e-9)
    assert other.degrees == pytest.approx(one.degrees, rel=1e-9)


def test_the_value_is_the_logarithm_of_the_mean_and_the_last_boundary_a_hard_limit():
    preference = PhysicalProgramming({"time": Smaller.even(1.5, 3.5), "effort": Smaller(0.3, 0.8, 1.6, 3.0, 6.0)})
    front = cart(2001)
    ranking = preference.rank(front)
    T, E = front.objectives.T
    met = (T <= 3.5) & (E <= 6.0)
    assert np.array_equal(np.isfinite(ranking.values), met)
    p = preference.functions
    assert ranking.values[met] == pytest.approx(np.log10((p["time"](T[met]) + p["effort"](E[met])) / 2), rel=1e-12)
    assert set(ranking.order[: met.sum()]) == set(np.flatnonzero(met))
    least = minimize_scalar(lambda t: p["time"](t) + p["effort"](12 / t**3), bounds=(1.3, 3.5), method="bounded").x
    assert ranking.best.objectives["time"] == pytest.approx(least, abs=2e-3)
    assert ranking.message == ""
    ranking = PhysicalProgramming({"time": Value(1, 1.2, 1.5, 1.9, 2.0, 2.1, 2.5, 3, 3.5)}).rank(cart(2801))
    assert ranking.best.objectives["time"] == pytest.approx(2.0, abs=1e-3)
    assert np.isnan(ranking.degrees[:, 1]).all()


EVERY_CLASS = [
    Smaller(1, 2, 3, 4, 5),
    Smaller(1, 1.3, 3, 3.2, 5),
    Larger(5, 4.7, 3, 2, 1),
    Value(1, 2, 3, 4, 5, 5.01, 8, 9, 10),
    Range(1, 2, 3, 4, 5, 6, 7, 8, 9, 10),
]


def mean(fuzzy: FuzzyFunction, J: float, centre: float) -> float:
    """Eq. (35) by adaptive quadrature between the boundaries, the Gaussian around `centre`."""
    d = fuzzy.spread
    marks = [mark for mark, _ in fuzzy.crisp.boundaries if J - 3 * d < mark < J + 3 * d]
    cuts = [J - 3 * d, *marks, J + 3 * d]
    top = ((np.clip(centre, J - 3 * d, J + 3 * d) - centre) / d) ** 2

    def weight(t: float) -> float:
        return np.exp(top - ((t - centre) / d) ** 2)

    def integral(f) -> float:
        return sum(quad(f, a, b, epsabs=0, epsrel=1e-13, limit=200)[0] for a, b in pairwise(cuts))

    return integral(lambda t: weight(t) * fuzzy.crisp(t)) / integral(weight)


def places(fuzzy: FuzzyFunction) -> list[float]:
    marks = [mark for mark, _ in fuzzy.crisp.boundaries]
    return [*np.random.default_rng(3).uniform(marks[0] - 2, marks[-1] + 1, 12), *marks]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::scipy.integrate.IntegrationWarning")
@pytest.mark.parametrize("one", EVERY_CLASS, ids=repr)
@pytest.mark.parametrize("spread", [1e-3, 0.1, 0.5, 3.0])
def test_quadrature(one, spread):
    fuzzy = FuzzyPhysicalProgramming({"J": one}, spread=spread).fuzzy_functions["J"]
    printed = FuzzyPhysicalProgramming({"J": one}, spread=spread, printed=True).fuzzy_functions["J"]
    marks = np.array([mark for mark, _ in fuzzy.crisp.boundaries])
    for J in places(fuzzy):
        assert fuzzy(J) == pytest.approx(mean(fuzzy, J, J), rel=1e-11)
        assert printed(J) == pytest.approx(mean(fuzzy, J, marks[np.argmin(abs(marks - J))]), rel=1e-8)


def test_steep_ideal_sides():
    """One range is so narrow that beta is in the hundreds, and the ideal side falls by e in a small part of the spread."""
    fuzzy = FuzzyPhysicalProgramming({"J": Smaller(1, 1.003, 3, 3.2, 5)}, spread=0.1).fuzzy_functions["J"]
    assert fuzzy.crisp.pieces[0].formula.steepness * fuzzy.spread > 100
    for J in (1.0, 1.05, 1.2, 0.999, 0.99, 0.75, 0.70):
        assert fuzzy(J) == pytest.approx(mean(fuzzy, J, J), rel=1e-8)


def test_as_printed_it_jumps_half_way_between_boundaries():
    """Four objectives with boundaries 1 to 5 and a spread of 0.1: 3.68 to 9.01 at 3.5, where the crisp function is 6.03."""
    classes = {name: Smaller(1, 2, 3, 4, 5) for name in "abcd"}
    printed = FuzzyPhysicalProgramming(classes, spread=0.1, printed=True).fuzzy_functions["a"]
    ours = FuzzyPhysicalProgramming(classes, spread=0.1).fuzzy_functions["a"]
    assert [round(float(printed(J)), 2) for J in (3.5 - 1e-9, 3.5 + 1e-9)] == [3.68, 9.01]
    assert round(float(printed.crisp(3.5)), 2) == 6.03
    assert float(ours(3.5 + 1e-9)) == pytest.approx(float(ours(3.5 - 1e-9)), rel=1e-7)


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(EVERY_CLASS), st.floats(-3, 0.3).map(lambda power: 10.0**power))
def test_not_below_the_crisp_one_and_monotone(one, spread):
    fuzzy = FuzzyPhysicalProgramming({"J": one}, spread=spread).fuzzy_functions["J"]
    marks = [mark for mark, _ in fuzzy.crisp.boundaries]
    J = np.union1d(np.linspace(marks[0] - 1, marks[-1] + 1, 400), marks)
    p = fuzzy(J)
    assert np.all(p >= fuzzy.crisp(J) * (1 - 1e-11))
    if len(one.sides) == 1:
        rising = p if one.sides[0].direction > 0 else p[::-1]
        assert np.all(np.diff(rising) > 0)


@pytest.mark.parametrize("one", EVERY_CLASS, ids=repr)
def test_tends_to_the_crisp_one_with_the_square_of_the_spread(one):
    crisp = PhysicalProgramming({"J": one}).functions["J"]
    marks = [mark for mark, _ in crisp.boundaries]
    J = np.union1d(np.linspace(marks[0] - 1, marks[-1] + 1, 400), marks)
    off, gap = [], np.diff(marks).min()
    for part in (1e-1, 1e-2, 1e-3):
        fuzzy = FuzzyPhysicalProgramming({"J": one}, spread={"J": part * gap}).fuzzy_functions["J"]
        off.append(np.abs(fuzzy(J) / crisp(J) - 1).max())
    # At a kink of the second derivative, too: it takes its mean there.
    assert off[1] < 0.02 * off[0] and off[2] < 0.02 * off[1] and off[2] < 1e-3


@pytest.mark.parametrize("printed", [False, True])
def test_the_number_of_values_does_not_matter(printed):
    fuzzy = FuzzyPhysicalProgramming({"J": EVERY_CLASS[1]}, printed=printed).fuzzy_functions["J"]
    J = np.linspace(0, 6, 101)
    together = fuzzy(J)
    assert [float(fuzzy(float(value))) for value in J] == together.tolist()
    assert np.concatenate([fuzzy(J[:1]), fuzzy(J[1:4]), fuzzy(J[4:])]).tolist() == together.tolist()


@pytest.mark.parametrize("one", EVERY_CLASS, ids=repr)
def test_derivatives_agree_with_differences(one):
    fuzzy = FuzzyPhysicalProgramming({"J": one}, spread=0.3).fuzzy_functions["J"]
    x = ca.SX.sym("x")
    slope = ca.Function("slope", [x], [ca.gradient(fuzzy(x), x)])
    steep = max(abs(float(slope(mark))) for mark, _ in fuzzy.crisp.boundaries)
    for J in places(fuzzy):
        h = 1e-5
        assert float(slope(J)) == pytest.approx((fuzzy(J + h) - fuzzy(J - h)) / (2 * h), rel=1e-5, abs=1e-8 * steep)


def test_a_spread_is_a_part_of_the_ranges_or_in_units_of_each_objective():
    classes = {"a": Smaller.even(1, 5), "b": Range(0, 2, 4, 6, 8, 9, 10, 11, 12, 13)}
    part = FuzzyPhysicalProgramming(classes, spread=0.5)
    assert part.spreads == {"a": 0.5, "b": 0.75}
    assert FuzzyPhysicalProgramming(classes, spread={"a": 0.5, "b": 0.75}).spreads == part.spreads
