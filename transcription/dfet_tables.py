"""The constant matrices of a finite element in time."""

from __future__ import annotations

import numpy as np

from .numerics import polynomials


class Tables:
    """Basis functions of an element on [-1, 1] where they are needed.

    Parameters
    ----------
    order, control_order : int
        Degrees l of the states and q of the controls. The tests have degree l + 1.
    basis : "lobatto" or "bernstein"

    Attributes
    ----------
    tau, weights : arrays (nq,)
        Gauss-Legendre quadrature, nq = max(l, q) + 1.
    points, dense : arrays
        Where path constraints are imposed: both ends and the quadrature nodes; where peaks are sampled: also halfway between these.
    stages : array (l + 1,)
        Gauss-Legendre nodes of the equivalent Runge-Kutta method. Through the states there and at both ends passes its collocation
        polynomial, which is more accurate by one order than the states' own polynomial of degree l.
    mass : array (l + 1, l + 2)
        Integrals of a state function times the derivative of a test function: exact.
    test : array (nq, l + 2)
        Test functions at the quadrature nodes times the weights.
    recover : array (nq, l + 1)
        The first l + 1 tests solved for the states' coefficients: these are the left end plus h times the rates at the quadrature nodes
        times this.
    implicit : array (nq, nq)
        The same for the states at the quadrature nodes: the transposed matrix of the equivalent Runge-Kutta method.
    """

    def __init__(self, order: int, control_order: int, basis: str) -> None:
        self.order, self.control_order = order, control_order
        self.state_basis = basis
        self.control_basis = "legendre" if basis == "lobatto" else basis
        self.tau, self.weights = polynomials.gauss_legendre(max(order, control_order) + 1)
        self.points = np.array([-1.0, *self.tau, 1.0])
        self.dense = np.sort(np.concatenate([self.points, 0.5 * (self.points[1:] + self.points[:-1])]))
        self.stages = polynomials.gauss_legendre(order + 1)[0]
        derivative = polynomials.basis_derivative(basis, order + 1, self.tau)
        self.mass = self.state(self.tau).T @ (self.weights[:, None] * derivative)
        self.test = self.weights[:, None] * polynomials.basis_matrix(basis, order + 1, self.tau)
        self.recover = -0.5 * self.test[:, :-1] @ np.linalg.inv(self.mass[:, :-1])
        self.implicit = self.recover @ self.state(self.tau).T

    def state(self, tau: np.ndarray) -> np.ndarray:
        """State functions at `tau` (k,), shape (k, l + 1)."""
        return polynomials.basis_matrix(self.state_basis, self.order, tau)

    def flown(self, tau: np.ndarray) -> np.ndarray:
        """What the collocation polynomial at `tau` (k,) takes of the states at both ends and, in between, at the stages, (k, l + 3)."""
        return polynomials.basis_matrix("closed-legendre", self.order + 2, tau)

    def control(self, tau: np.ndarray) -> np.ndarray:
        """Control functions at `tau` (k,), shape (k, q + 1)."""
        return polynomials.basis_matrix(self.control_basis, self.control_order, tau)

    @property
    def state_nodes(self) -> np.ndarray:
        """Abscissae of the coefficients of the states (l + 1,)."""
        return polynomials.nodes(self.state_basis, self.order)

    @property
    def control_nodes(self) -> np.ndarray:
        """Abscissae of the coefficients of the controls (q + 1,)."""
        return polynomials.nodes(self.control_basis, self.control_order)
