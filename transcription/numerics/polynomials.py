"""Polynomial bases on [-1, 1]: their nodes, quadrature on these, Lagrange and Bernstein functions, derivatives and integrals.

Pure functions: arrays in, arrays out. Lagrange functions are evaluated by the barycentric formula (Berrut and Trefethen, "Barycentric
Lagrange Interpolation", SIAM Review 46(3), 2004), Bernstein functions from their definition (Farouki, "The Bernstein polynomial basis: a
centennial retrospective", CAGD 29(6), 2012).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from scipy.special import comb, roots_jacobi


def gauss_legendre(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The n Gauss-Legendre nodes and weights on [-1, 1]: exact for polynomials of degree 2n - 1."""
    return legendre.leggauss(n)


def lobatto_nodes(n: int) -> np.ndarray:
    """The n Gauss-Lobatto nodes on [-1, 1], both ends among them: the roots of (1 - t^2) P'_{n-1}(t). For n = 1, the midpoint."""
    if n == 1:
        return np.zeros(1)
    inner = legendre.Legendre.basis(n - 1).deriv().roots().real if n > 2 else np.empty(0)
    inner = np.sort(inner)
    return np.concatenate([[-1.0], 0.5 * (inner - inner[::-1]), [1.0]])


def radau_nodes(n: int) -> np.ndarray:
    """The n Gauss-Radau nodes on [-1, 1] with -1 among them, and not 1: the roots of P_{n-1}(t) + P_n(t)."""
    return np.append(-1.0, roots_jacobi(n - 1, 0.0, 1.0)[0]) if n > 1 else np.array([-1.0])


def chebyshev_nodes(n: int) -> np.ndarray:
    """The n Chebyshev-Gauss-Lobatto nodes on [-1, 1], -cos(pi k / (n - 1)), both ends among them. For n = 1, the midpoint."""
    if n == 1:
        return np.zeros(1)
    # As sines, which are symmetric to the last bit.
    return np.sin(np.pi * (2.0 * np.arange(n) - (n - 1)) / (2.0 * (n - 1)))


NODES: dict[str, Callable[[int], np.ndarray]] = {
    "lobatto": lambda degree: lobatto_nodes(degree + 1),
    "legendre": lambda degree: gauss_legendre(degree + 1)[0],
    "closed-legendre": lambda degree: np.array([-1.0, *gauss_legendre(degree - 1)[0], 1.0]),
    "radau": lambda degree: radau_nodes(degree + 1),
    "closed-radau": lambda degree: np.append(radau_nodes(degree), 1.0),
    "chebyshev": lambda degree: chebyshev_nodes(degree + 1),
    "bernstein": lambda degree: np.linspace(-1.0, 1.0, degree + 1) if degree else np.zeros(1),
}
"""The places of the coefficients of each basis, by degree."""
BASES = tuple(NODES)


@cache
def nodes(basis: str, degree: int) -> np.ndarray:
    """The places of a basis' coefficients on [-1, 1], shape (degree + 1,).

    Those of a Lagrange basis are its nodes ("closed-legendre": Gauss-Legendre nodes and both ends; "closed-radau": Gauss-Radau nodes and
    1), those of Bernstein's the equally spaced abscissae of the control points. Raises ValueError for an unknown basis.
    """
    if basis not in NODES:
        raise ValueError(f"unknown basis '{basis}'; there are {', '.join(BASES)}")
    points = NODES[basis](degree)
    points.setflags(write=False)
    return points


def bernstein_matrix(degree: int, tau: np.ndarray) -> np.ndarray:
    """Values of the Bernstein functions of a degree at `tau` (n,), shape (n, degree + 1)."""
    s = 0.5 * (np.asarray(tau, dtype=float)[:, None] + 1.0)
    i, binomials = _binomials(degree)
    return binomials * s**i * (1.0 - s) ** (degree - i)


@cache
def _binomials(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """0, ..., degree, and the binomial coefficients of the degree over these."""
    i = np.arange(degree + 1)
    return i, comb(degree, i)


def bernstein_derivative(degree: int, tau: np.ndarray) -> np.ndarray:
    """Derivatives of the Bernstein functions of a degree at `tau` (n,), with respect to tau, shape (n, degree + 1)."""
    if degree == 0:
        return np.zeros((len(np.atleast_1d(tau)), 1))
    lower = bernstein_matrix(degree - 1, tau)
    zero = np.zeros((len(lower), 1))
    return 0.5 * degree * (np.hstack([zero, lower]) - np.hstack([lower, zero]))


def basis_matrix(basis: str, degree: int, tau: np.ndarray) -> np.ndarray:
    """Values of a basis at `tau` (n,), shape (n, degree + 1). Raises ValueError for an unknown basis."""
    if basis == "bernstein":
        return bernstein_matrix(degree, tau)
    return _lagrange(nodes(basis, degree), _barycentric_weights(basis, degree), tau)


def lagrange_matrix(points: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Values of the Lagrange functions of any points (k,) at `tau` (n,), shape (n, k)."""
    return _lagrange(points, _weights(points), tau)


def lagrange_derivative(points: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Derivatives of the Lagrange functions of any points (k,) at `tau` (n,), shape (n, k)."""
    return lagrange_matrix(points, tau) @ _differentiation(points, _weights(points))


def lagrange_integrals(points: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Integrals of the Lagrange functions of any points (k,) from -1 to `ends` (n,), shape (n, k).

    Those up to 1 are the weights of the quadrature that interpolates: Gauss's, Radau's and Lobatto's at their nodes, and Clenshaw's and
    Curtis's at Chebyshev-Gauss-Lobatto nodes.
    """
    tau, weights = gauss_legendre(len(points))
    half = 0.5 * (1.0 + np.asarray(ends, dtype=float))
    inside = half[:, None] * (1.0 + tau) - 1.0
    return half[:, None] * (weights @ lagrange_matrix(points, inside.ravel()).reshape(*inside.shape, len(points)))


def _lagrange(points: np.ndarray, weights: np.ndarray, tau: np.ndarray) -> np.ndarray:
    difference = np.asarray(tau, dtype=float)[:, None] - points
    hit = np.abs(difference) < 1e-15
    if not hit.any():
        values = weights / difference
        return values / values.sum(axis=1, keepdims=True)
    on = hit.any(axis=1, keepdims=True)
    difference[hit] = 1.0
    values = weights / difference
    # What stands there at a point may sum to zero, and is not used.
    return np.where(on, hit, values / np.where(on, 1.0, values.sum(axis=1, keepdims=True)))


@cache
def monomials(basis: str, degree: int) -> np.ndarray:
    """A basis as sums of monomials, (degree + 1, degree + 1): [1, tau, ...] @ this. The higher the degree, the more digits are lost."""
    places = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    found = np.linalg.solve(np.vander(places, increasing=True), basis_matrix(basis, degree, places))
    found.setflags(write=False)
    return found


def basis_derivative(basis: str, degree: int, tau: np.ndarray) -> np.ndarray:
    """Derivatives of a basis at `tau` (n,), shape (n, degree + 1). Raises ValueError for an unknown basis."""
    if basis == "bernstein":
        return bernstein_derivative(degree, tau)
    points, weights = nodes(basis, degree), _barycentric_weights(basis, degree)
    return basis_matrix(basis, degree, tau) @ _differentiation(points, weights)


def _differentiation(points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Derivatives of Lagrange functions at their own points, (k, k)."""
    at_points = (weights / weights[:, None]) / (points[:, None] - points + np.eye(len(points)))
    np.fill_diagonal(at_points, 0.0)
    np.fill_diagonal(at_points, -at_points.sum(axis=1))
    return at_points


@cache
def _barycentric_weights(basis: str, degree: int) -> np.ndarray:
    return _weights(nodes(basis, degree))


def _weights(points: np.ndarray) -> np.ndarray:
    """Barycentric weights (k,) up to a common factor: products of distances fall like 2^-k, doubled ones do not."""
    return 1.0 / np.prod(2.0 * (points[:, None] - points) + np.eye(len(points)), axis=1)


def legendre_coefficients(values: np.ndarray) -> np.ndarray:
    """Coefficients of Legendre polynomials from values at the Gauss-Legendre nodes, both along the second axis: (N, k, ...)."""
    k = values.shape[1]
    return np.einsum("ij,nj...->ni...", np.linalg.inv(legendre.legvander(gauss_legendre(k)[0], k - 1)), values)
