"""Finite elements in time: what is evaluated at their points, and their basis functions there."""

from __future__ import annotations

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase

from ..numerics import polynomials


def rates_and_integrands(phase: CompiledPhase) -> ca.Function:
    """(x, u, place, share, s) -> (rates and integrands, times half of the length of the element; sizes), at one point.

    The place is that of the point and the share that of its element, relative to the phase.
    """
    x, u, place, share, s = _symbols(phase)
    half, along = 0.5 * share * (s[1] - s[0]), (x, u, s[0] + place * (s[1] - s[0]), s)
    values = [half * phase.dynamics(*along), half * phase.integrands(*along), phase.sizes(*along)]
    return ca.Function("inside", [x, u, place, share, s], values)


def at_place(function: ca.Function, chosen: list[int], phase: CompiledPhase) -> ca.Function:
    """(x, u, place, s) -> some rows of what a Function of a phase returns at this place, relative to the phase."""
    x, u, place, _, s = _symbols(phase)
    return ca.Function(function.name(), [x, u, place, s], [function(x, u, s[0] + place * (s[1] - s[0]), s)[chosen]])


def times_half_length(phase: CompiledPhase, size: int) -> ca.Function:
    """(values, share, s) -> values times half of the length of an element with this share of the phase."""
    values, (_, _, _, share, s) = ca.MX.sym("values", size), _symbols(phase)
    return ca.Function("weighted", [values, share, s], [0.5 * share * (s[1] - s[0]) * values])


def _symbols(phase: CompiledPhase) -> list[ca.MX]:
    """Symbols of x, u, place, share and s at one point."""
    sizes = {"x": len(phase.states), "u": len(phase.controls), "place": 1, "share": 1, "s": phase.dynamics.size1_in(3)}
    return [ca.MX.sym(name, size) for name, size in sizes.items()]


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
