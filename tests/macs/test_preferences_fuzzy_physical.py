"""Fuzzy physical programming against adaptive quadrature, and in the limit of no fuzziness."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from macs.decisions import FuzzyPhysicalProgramming, Larger, PhysicalProgramming, Range, Smaller, Value
from macs.preferences.preference_functions import FuzzyFunction

CLASSES = [
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
@pytest.mark.parametrize("one", CLASSES, ids=repr)
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
@given(st.sampled_from(CLASSES), st.floats(-3, 0.3).map(lambda power: 10.0**power))
def test_not_below_the_crisp_one_and_monotone(one, spread):
    fuzzy = FuzzyPhysicalProgramming({"J": one}, spread=spread).fuzzy_functions["J"]
    marks = [mark for mark, _ in fuzzy.crisp.boundaries]
    J = np.union1d(np.linspace(marks[0] - 1, marks[-1] + 1, 400), marks)
    p = fuzzy(J)
    assert np.all(p >= fuzzy.crisp(J) * (1 - 1e-11))
    if len(one.sides) == 1:
        rising = p if one.sides[0].direction > 0 else p[::-1]
        assert np.all(np.diff(rising) > 0)


@pytest.mark.parametrize("one", CLASSES, ids=repr)
def test_tends_to_the_crisp_one_with_the_square_of_the_spread(one):
    crisp = PhysicalProgramming({"J": one}).functions["J"]
    marks = [mark for mark, _ in crisp.boundaries]
    J = np.union1d(np.linspace(marks[0] - 1, marks[-1] + 1, 400), marks)
    off, gap = [], np.diff(marks).min()
    for part in (1e-1, 1e-2, 1e-3):
        fuzzy = FuzzyPhysicalProgramming({"J": one}, spread={"J": part * gap}).fuzzy_functions["J"]
        off.append(np.abs(fuzzy(J) / crisp(J) - 1).max())
    # At a kink of the second derivative, too: it takes its mean there.
    assert off[1] < 0.02 * off[0]
    assert off[2] < 0.02 * off[1]
    assert off[2] < 1e-3


@pytest.mark.parametrize("printed", [False, True])
def test_the_number_of_values_does_not_matter(printed):
    fuzzy = FuzzyPhysicalProgramming({"J": CLASSES[1]}, printed=printed).fuzzy_functions["J"]
    J = np.linspace(0, 6, 101)
    together = fuzzy(J)
    assert [float(fuzzy(float(value))) for value in J] == together.tolist()
    assert np.concatenate([fuzzy(J[:1]), fuzzy(J[1:4]), fuzzy(J[4:])]).tolist() == together.tolist()


@pytest.mark.parametrize("one", CLASSES, ids=repr)
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
