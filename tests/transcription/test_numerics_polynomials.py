import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.interpolate import BPoly

from transcription import PiecewisePolynomial
from transcription.numerics import polynomials as pl

LEAST = {"lobatto": 0, "legendre": 0, "closed-legendre": 2, "radau": 0, "closed-radau": 1, "chebyshev": 0, "bernstein": 0}
bases = st.sampled_from(sorted(LEAST)).flatmap(lambda b: st.tuples(st.just(b), st.integers(LEAST[b], 12)))
tau = st.lists(st.floats(-1, 1), min_size=1, max_size=9).map(np.array)


def polynomial(seed: int, degree: int) -> Polynomial:
    return Polynomial(np.random.default_rng(seed).uniform(-1, 1, degree + 1))


def coefficients(basis: str, degree: int, p: Polynomial) -> np.ndarray:
    """Of a polynomial in a basis: values at the nodes; for Bernstein's by solving for them."""
    if basis != "bernstein":
        return p(pl.nodes(basis, degree))
    points = np.cos(np.linspace(0, np.pi, degree + 1))
    return np.linalg.solve(pl.basis_matrix(basis, degree, points), p(points))


@given(bases, tau)
def test_a_basis_sums_to_one_and_its_derivatives_to_zero(which, tau):
    values, slopes = pl.basis_matrix(*which, tau), pl.basis_derivative(*which, tau)
    assert values.shape == slopes.shape == (len(tau), which[1] + 1)
    assert values.sum(axis=1) == pytest.approx(np.ones(len(tau)), abs=1e-12)
    assert slopes.sum(axis=1) == pytest.approx(np.zeros(len(tau)), abs=1e-9)


@given(bases, tau, st.integers(0, 2**32 - 1))
def test_polynomials_of_the_degree_are_reproduced_with_their_slope(which, tau, seed):
    p = polynomial(seed, which[1])
    c = coefficients(*which, p)
    assert pl.basis_matrix(*which, tau) @ c == pytest.approx(p(tau), abs=1e-9)
    assert pl.basis_derivative(*which, tau) @ c == pytest.approx(p.deriv()(tau), abs=1e-7)


@pytest.mark.parametrize(("basis", "degree"), [(b, d) for b in ("lobatto", "legendre", "closed-legendre") for d in (2, 3, 5, 9)])
def test_lagrange_functions_are_one_at_their_own_node(basis, degree):
    nodes = pl.nodes(basis, degree)
    assert (np.diff(nodes) > 0).all() and nodes == pytest.approx(-nodes[::-1], abs=1e-15)
    assert np.array_equal(pl.basis_matrix(basis, degree, nodes), np.eye(degree + 1))
    near = np.nextafter(nodes, 2)
    assert pl.basis_matrix(basis, degree, near) == pytest.approx(np.eye(degree + 1), abs=1e-12)


@given(st.integers(0, 12), st.integers(0, 2**32 - 1))
def test_bernstein_agrees_with_scipy(degree, seed):
    c, t = np.random.default_rng(seed).normal(size=degree + 1), np.linspace(-1, 1, 9)
    assert pl.bernstein_matrix(degree, t) @ c == pytest.approx(BPoly(c[:, None], [-1, 1])(t), abs=1e-11)
    assert pl.bernstein_derivative(degree, t) @ c == pytest.approx(BPoly(c[:, None], [-1, 1]).derivative()(t), abs=1e-9)


@pytest.mark.parametrize("n", range(1, 16))
def test_quadrature_is_exact_to_degree_2n_minus_1_and_no_further(n):
    nodes, weights = pl.gauss_legendre(n)
    for degree in range(2 * n + 1):
        exact = (1 - (-1) ** (degree + 1)) / (degree + 1)
        error = abs(weights @ nodes**degree - exact)
        assert error < 1e-14 if degree < 2 * n else error > 1e-10


def test_unknown_bases_are_refused():
    for action in (pl.nodes, lambda b, d: pl.basis_matrix(b, d, np.zeros(1)), lambda b, d: pl.basis_derivative(b, d, np.zeros(1))):
        with pytest.raises(ValueError, match=r"hermite.*lobatto"):
            action("hermite", 3)


@settings(max_examples=30)
@given(bases, st.integers(1, 5), st.integers(0, 2**32 - 1), st.floats(0, 1))
def test_piecewise_polynomials_agree_with_their_elements(which, elements, seed, share):
    rng = np.random.default_rng(seed)
    edges = np.cumsum(rng.uniform(0.1, 2, elements + 1)) - 3
    pieces = PiecewisePolynomial(edges, rng.normal(size=(elements, which[1] + 1, 2)), which[0])
    for j in range(elements):
        tau = 2 * share * 0.999 - 1
        time = edges[j] + 0.5 * (tau + 1) * (edges[j + 1] - edges[j])
        assert pieces(time) == pytest.approx(pieces.on_element(j, np.array([tau]))[0], abs=1e-8)
    assert pieces(np.full((2, 3), edges[0])).shape == (2, 3, 2)
    assert pieces(edges[-1]) == pytest.approx(pieces.on_element(elements - 1, np.ones(1))[0])
    if elements > 1:
        assert pieces(edges[1]) == pytest.approx(pieces.on_element(1, -np.ones(1))[0]), "the later element has the say"


@pytest.mark.parametrize("basis", pl.BASES)
@pytest.mark.parametrize("degree", [0, 1, 3, 6, 12])
def test_a_basis_as_sums_of_powers(basis, degree):
    if degree < LEAST[basis]:
        return
    tau = np.linspace(-1.0, 1.0, 41)
    powers = tau[:, None] ** np.arange(degree + 1)
    error = np.abs(powers @ pl.monomials(basis, degree) - pl.basis_matrix(basis, degree, tau)).max()
    assert error < 1e-15 * 4.0**degree + 1e-15
