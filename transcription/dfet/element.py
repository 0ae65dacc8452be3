"""One finite element in time: its equations."""

from __future__ import annotations

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase

from ..numerics import polynomials
from ..numerics.periodic import unwrapped_law, wrapped_controls


def element_function(tables: Tables, phase: CompiledPhase) -> ca.Function:
    """(X, U, left, right, start, h, s) -> (weak form without its right end, integrals, paths, the same at the nodes of equalities, peaks,
    controls at both ends, sizes)."""
    nx, nu = len(phase.states), len(phase.controls)
    X, U = ca.MX.sym("X", nx, tables.order + 1), ca.MX.sym("U", nu, tables.control_order + 1)
    left, right = ca.MX.sym("left", nx), ca.MX.sym("right", nx)
    start, h, s = ca.MX.sym("start"), ca.MX.sym("h"), ca.MX.sym("s", phase.dynamics.size1_in(3))
    law = unwrapped_law(U, phase)

    def over(function: ca.Function, tau: np.ndarray, states: ca.MX) -> ca.MX:
        times = start + 0.5 * h * ca.DM(1.0 + tau).T
        controls = wrapped_controls(law @ ca.DM(tables.control(tau)).T, phase)
        return function.map(len(tau))(states, controls, times, ca.repmat(s, 1, len(tau)))

    inside = X @ ca.DM(tables.state(tables.tau)).T
    closed = ca.horzcat(left, X @ ca.DM(tables.state(tables.stages)).T, right)
    rates = over(phase.dynamics, tables.tau, inside)
    first = ca.kron(left, ca.DM(np.eye(1, tables.order + 2)))
    weak = X @ ca.DM(tables.mass) + 0.5 * h * (rates @ ca.DM(tables.test)) + first
    integrals = 0.5 * h * over(phase.integrands, tables.tau, inside) @ ca.DM(tables.weights)
    paths, equalities = (over(phase.path, tau, closed @ ca.DM(tables.collocation(tau)).T) for tau in (tables.points, tables.exact))
    peaks = over(phase.peaks, tables.dense, closed @ ca.DM(tables.collocation(tables.dense)).T)
    sizes = over(phase.sizes, tables.tau, inside)
    ends = ca.vec(wrapped_controls(law @ ca.DM(tables.control(np.array([-1.0, 1.0]))).T, phase))
    names = ["X", "U", "left", "right", "start", "h", "s"], ["weak", "integrals", "paths", "equalities", "peaks", "ends", "sizes"]
    return ca.Function("element", [X, U, left, right, start, h, s], [weak, integrals, paths, equalities, peaks, ends, sizes], *names)


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
    exact : array (q + 1,)
        Where path constraints are imposed that are equalities: as many Gauss-Legendre nodes as a control has coefficients. At more of them
        the equations would determine more than there is to choose.
    stages : array (l + 1,)
        Gauss-Legendre nodes of the equivalent Runge-Kutta method. Through the states there and at both ends passes its collocation
        polynomial, which is more accurate by one order than the states' own polynomial of degree l.
    state_nodes, control_nodes : arrays (l + 1,), (q + 1,)
        Abscissae of the coefficients of the states and of the controls.
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
        self.state_nodes = polynomials.nodes(self.state_basis, order)
        self.control_nodes = polynomials.nodes(self.control_basis, control_order)
        self.tau, self.weights = polynomials.gauss_legendre(max(order, control_order) + 1)
        self.points = np.array([-1.0, *self.tau, 1.0])
        self.exact = polynomials.gauss_legendre(control_order + 1)[0]
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

    def collocation(self, tau: np.ndarray) -> np.ndarray:
        """Functions of the collocation polynomial at `tau` (k,), for states at the left end, the stages and the right end, (k, l + 3)."""
        return polynomials.basis_matrix("closed-legendre", self.order + 2, tau)

    def control(self, tau: np.ndarray) -> np.ndarray:
        """Control functions at `tau` (k,), shape (k, q + 1)."""
        return polynomials.basis_matrix(self.control_basis, self.control_order, tau)
