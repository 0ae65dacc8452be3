"""Basis functions and coefficients of an element on [-1, 1]: what tells one method on elements from another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..numerics import polynomials

POINTS = ("radau", "gauss", "lobatto", "chebyshev")
"""Kinds of points; all but those of Gauss have the left end among them, and Lobatto's and Chebyshev's the right end, too."""
BASES = {"radau": "radau", "gauss": "legendre", "lobatto": "lobatto", "chebyshev": "chebyshev"}
"""The Lagrange polynomials on them, which are those of the controls."""
CLOSED = {"radau": "closed-radau", "gauss": "closed-legendre", "lobatto": "lobatto", "chebyshev": "chebyshev"}
"""The Lagrange polynomials on them and both ends, which are those of the states."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Tables:
    """An element with the states L and R at its ends, which are unknowns of their own, and k coefficients X of the states inside.

    Dynamics are evaluated at nq points, and their equations are affine in L, X, R and the rates f there, each times half of the length: [L
    X R] `balance` + f `test` = 0.
    """

    tau: np.ndarray  # tau, weights: (nq,): Where dynamics and integrands are evaluated, and the weights of the quadrature
    weights: np.ndarray
    inside: np.ndarray  # (k + 2, nq): States there from [L X R]
    # balance, test: (k + 2, rows), (nq, rows): The equations, in the order of time: R enters the last of them with -1, and no other.
    balance: np.ndarray
    test: np.ndarray
    # implicit, recover: (nq, nq), (nq, k): The same equations solved for the states at the points, and for X: these are L plus the length
    # times the rates at the points times this. The first is the transposed matrix of the equivalent Runge-Kutta method.
    implicit: np.ndarray
    recover: np.ndarray
    nodes: np.ndarray  # (k,): Abscissae of X
    stages: np.ndarray  # stages, at_stages: (k,), (k, k): Where trajectories have their states between the ends, and these states from X
    at_stages: np.ndarray
    closed: str  # basis of the polynomial through L, the states at the stages and R
    control_basis: str  # control_basis, control_order: Of the controls
    control_order: int
    # (control_order + 1,): Where path constraints are imposed that are equalities: as many points as a control has coefficients. At more
    # of them the equations would determine more than there is to choose.
    exact: np.ndarray
    # costate_basis, costates: (coefficients, rows): Costates as polynomials on the element, from the multipliers of its equations; no
    # basis: that is not known.
    costate_basis: str = ""
    costates: np.ndarray | None = None

    @property
    def coefficients(self) -> int:
        """Number k of coefficients of a state on an element."""
        return len(self.nodes)

    @property
    def rows(self) -> int:
        """Number of equations of a state on an element."""
        return self.test.shape[1]

    @cached_property
    def points(self) -> np.ndarray:
        """Where path constraints are imposed: at both ends and where dynamics are evaluated."""
        inner = self.tau[(self.tau > -1.0) & (self.tau < 1.0)]
        return np.array([-1.0, *inner, 1.0])

    @cached_property
    def dense(self) -> np.ndarray:
        """Where peaks are sampled: also halfway between these."""
        return np.sort(np.concatenate([self.points, 0.5 * (self.points[1:] + self.points[:-1])]))

    @cached_property
    def control_nodes(self) -> np.ndarray:
        """Abscissae (control_order + 1,) of the coefficients of the controls."""
        return polynomials.nodes(self.control_basis, self.control_order)

    @property
    def needs_right(self) -> bool:
        """Whether dynamics are evaluated at the right end."""
        return bool(self.inside[-1].any())

    def at(self, tau: np.ndarray) -> np.ndarray:
        """States at `tau` (n,) from [L X R], by the polynomial through both ends and the stages, (k + 2, n)."""
        basis = polynomials.basis_matrix(self.closed, self.coefficients + 1, tau).T
        return np.vstack([basis[:1], self.at_stages.T @ basis[1:-1], basis[-1:]])

    def control(self, tau: np.ndarray) -> np.ndarray:
        """Control functions at `tau` (n,), shape (n, control_order + 1)."""
        return polynomials.basis_matrix(self.control_basis, self.control_order, tau)


def dfet_tables(order: int, control_order: int, basis: str) -> Tables:
    """The element of states of degree l = `order` and controls of degree q, tested with functions of degree l + 1.

    Dynamics are evaluated at max(l, q) + 1 Gauss-Legendre nodes; the first l + 1 tests give the states' coefficients. The trajectory is the
    collocation polynomial of the (l + 1)-stage Gauss method that is equivalent for q <= l, of one order more than that of degree l.
    """
    tau, weights = polynomials.gauss_legendre(max(order, control_order) + 1)
    stages, tests = polynomials.gauss_legendre(order + 1)[0], order + 2

    def state(places: np.ndarray) -> np.ndarray:
        return polynomials.basis_matrix(basis, order, places)

    # Integrals of a state function times the derivative of a test function: exact.
    mass = state(tau).T @ (weights[:, None] * polynomials.basis_derivative(basis, order + 1, tau))
    test = weights[:, None] * polynomials.basis_matrix(basis, order + 1, tau)
    recover = -0.5 * test[:, :-1] @ np.linalg.inv(mass[:, :-1])
    nothing = np.zeros((1, len(tau)))
    return Tables(
        tau=tau,
        weights=weights,
        inside=np.vstack([nothing, state(tau).T, nothing]),
        balance=np.vstack([np.eye(1, tests), mass, -np.eye(1, tests, tests - 1)]),
        test=test,
        implicit=recover @ state(tau).T,
        recover=recover,
        nodes=polynomials.nodes(basis, order),
        stages=stages,
        at_stages=state(stages),
        closed="closed-legendre",
        control_basis="legendre" if basis == "lobatto" else basis,
        control_order=control_order,
        exact=polynomials.gauss_legendre(control_order + 1)[0],
        # The multipliers of an element are the coefficients of its test functions.
        costate_basis=basis,
        costates=np.eye(tests),
    )


def control_degree(points: str, degree: int) -> int:
    """The degree of controls that have a value at each collocated point: one less than there are points."""
    return degree if points in ("lobatto", "chebyshev") else degree - 1


def collocation_tables(points: str, degree: int, control_order: int, bernstein: bool) -> Tables:
    """The interval with states of a degree, collocated at points of a kind: `degree` of Gauss's or Radau's, one more of the others."""
    basis, full = BASES[points], control_degree(points, degree)
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

    The differential form D X = h/2 f is multiplied by the Lagrange polynomials on the points, for Radau's without the last one, and 1, and
    integrated by parts, exactly: so the right end enters one equation only, and multipliers are costates at these points, those of the
    covector mapping of the differential form.
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
