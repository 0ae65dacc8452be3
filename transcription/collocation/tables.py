"""An interval of collocation: its points, its Runge-Kutta coefficients, its equations and its costates."""

from __future__ import annotations

import numpy as np

from ..elements.tables import Tables
from ..numerics import polynomials

POINTS = ("radau", "gauss", "lobatto", "chebyshev")
"""Kinds of points; all but those of Gauss have the left end among them, and Lobatto's and Chebyshev's the right end, too."""
BASES = {"radau": "radau", "gauss": "legendre", "lobatto": "lobatto", "chebyshev": "chebyshev"}
"""The Lagrange polynomials on them, which are those of the controls."""
CLOSED = {"radau": "closed-radau", "gauss": "closed-legendre", "lobatto": "lobatto", "chebyshev": "chebyshev"}
"""The Lagrange polynomials on them and both ends, which are those of the states."""


def degree_of_controls(points: str, degree: int) -> int:
    """The degree of controls that have a value at each collocated point: one less than there are points."""
    return degree if points in ("lobatto", "chebyshev") else degree - 1


def collocation_tables(points: str, degree: int, control_order: int, bernstein: bool) -> Tables:
    """The interval with states of a degree, collocated at points of a kind: `degree` of Gauss's or Radau's, one more of the others."""
    basis, full = BASES[points], degree_of_controls(points, degree)
    tau = polynomials.nodes(basis, full)
    # The Runge-Kutta method: integrals of the rates' polynomial through their values at the points.
    integrals, weights = polynomials.lagrange_integrals(tau, tau), polynomials.lagrange_integrals(tau, np.ones(1))[0]
    integrals[tau == -1.0], integrals[tau == 1.0] = 0.0, weights
    own = np.flatnonzero((tau > -1.0) & (tau < 1.0))
    nodes = np.array([-1.0, *tau[own], 1.0])
    inside = (nodes[:, None] == tau).astype(float)
    rows = _tested(tau, weights, nodes) if points in ("radau", "gauss") else _integrated(tau, integrals, nodes)
    balance, test, costates = rows
    return Tables(
        tau=tau,
        weights=weights,
        inside=inside,
        balance=balance,
        test=test,
        implicit=0.5 * integrals.T,
        recover=0.5 * integrals.T[:, own],
        nodes=tau[own],
        stages=tau[own],
        at_stages=np.eye(len(own)),
        closed=CLOSED[points],
        control_basis="bernstein" if bernstein else basis,
        control_order=control_order,
        exact=polynomials.nodes(basis, control_order),
        costate_basis="" if costates is None else CLOSED[points],
        costates=costates,
    )


def _tested(tau: np.ndarray, weights: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Balance, test and costates of Gauss's or Radau's points.

    The differential form D X = h/2 f at the points is multiplied by test polynomials, of which there are as many as equations, summed with
    the weights, and integrated by parts, which is exact for these quadratures. The tests are the Lagrange polynomials on the points, for
    Radau's without the last one, and 1: so the right end enters one equation only, and the multipliers are values of the costates there.
    They are those of the covector mapping of the differential form: its multipliers over the weights.
    """
    radau = tau[0] == -1.0
    of_tests = np.append(tau[:-1] if radau else tau, 1.0)
    values, slopes = polynomials.lagrange_matrix(of_tests, tau), polynomials.lagrange_derivative(of_tests, tau)
    balance = (nodes[:, None] == tau) @ (weights[:, None] * slopes)
    balance[0] += polynomials.lagrange_matrix(of_tests, nodes[:1])[0]
    balance[-1, -1] -= 1.0
    places = np.append(tau, 1.0) if radau else nodes
    return balance, weights[:, None] * values, polynomials.lagrange_matrix(of_tests, places)


def _integrated(tau: np.ndarray, integrals: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, None]:
    """Balance and test of Lobatto's or Chebyshev's points, of the integral form x_i = x_0 + h sum_j a_ij f_j; no costates."""
    balance = np.vstack([np.ones((1, len(tau) - 1)), -np.eye(len(nodes) - 1)])
    return balance, integrals[1:].T, None
