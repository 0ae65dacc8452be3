"""Which absolute values are found among the terms of an integrand."""

import casadi as ca
import numpy as np
import pytest

from problems.absolute import absolute_terms, branches

U, V, X = (ca.MX.sym(name) for name in "uvx")
W = ca.vertcat(U, V)

SPELLINGS = {
    "alone": (ca.fabs(U), [1.0]),
    "times a number": (0.5 * ca.fabs(U), [0.5]),
    "divided": (ca.fabs(U) / 4, [0.25]),
    "negated": (-ca.fabs(U), [-1.0]),
    "two": (ca.fabs(U) + ca.fabs(V), [1.0, 1.0]),
    "with a smooth rest": (ca.fabs(U - 3 * X) + X**2 - 1e-9 * U, [1.0]),
    "nested": (2 * (X - (ca.fabs(U) + X * V - 3 * ca.fabs(V)) / 4) + U, [-0.5, 1.5]),
    "a norm": (ca.norm_1(W) + X, [1.0, 1.0]),
    "a norm of a row": (ca.norm_1(W.T), [1.0, 1.0]),
    "a norm of a scalar": (3 * ca.norm_1(U), [3.0]),
    "a sum over a vector": (ca.sum1(ca.fabs(W)), [1.0, 1.0]),
    "weights": (ca.dot(ca.DM([2, 0.5]), ca.fabs(W)) + V, [2.0, 0.5]),
    "weights, one of them 0": (ca.dot(ca.DM([0, 0.5]), ca.fabs(W)), [0.5]),
    "a product with a row": (ca.mtimes(ca.DM([[1, 2]]), ca.fabs(W)) - 1, [1.0, 2.0]),
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_terms_are_found_and_add_up_to_the_integrand(spelling):
    expr, factors = SPELLINGS[spelling]
    terms = absolute_terms(expr)
    absolute = [(factor, term) for factor, term in terms if term.is_op(ca.OP_FABS)]
    assert [factor for factor, _ in absolute] == pytest.approx(factors, rel=1e-15)
    assert len(terms) - len(absolute) <= 1
    both = ca.Function("both", [U, V, X], [expr, sum((factor * term for factor, term in terms), ca.MX(0))])
    for point in np.random.default_rng(0).uniform(-2, 2, (20, 3)):
        stated, found = (float(value) for value in both(*point))
        assert found == pytest.approx(stated, rel=1e-14, abs=1e-14)


@pytest.mark.parametrize("expr", [U**2 + X, X * ca.fabs(U), ca.fmax(U, -U), ca.fabs(U) ** 3, ca.dot(W, ca.fabs(W)), ca.norm_2(W), ca.MX(0)])
def test_others_stay_as_they_are(expr):
    ((factor, term),) = absolute_terms(expr)
    assert factor == 1.0 and term is expr


@pytest.mark.parametrize(
    ("expr", "count"),
    [
        (ca.fabs(U), 2),
        (X + 3 * ca.fabs(U - V) + ca.fabs(X), 4),
        (ca.fmax(ca.fabs(U), X) / 2, 3),
        (sum((ca.fabs(U + k) for k in range(40)), X), 8),
        (X - ca.fabs(U), 1),
        (X * ca.fabs(U), 1),
    ],
)
def test_a_peak_is_the_greatest_of_smooth_branches(expr, count):
    found = branches(expr)
    both = ca.Function("both", [U, V, X], [expr, ca.mmax(ca.vertcat(*found))])
    assert len(found) == count
    for point in np.random.default_rng(0).uniform(-2, 2, (20, 3)):
        stated, greatest = (float(value) for value in both(*point))
        assert greatest == pytest.approx(stated, rel=1e-14, abs=1e-14)


@pytest.mark.slow
def test_a_sum_of_thousands_of_terms_is_no_obstacle():
    assert len(absolute_terms(sum((U * k for k in range(5000)), ca.fabs(X)))) == 2
