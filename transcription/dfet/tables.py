"""An element of DFET: basis functions of states, tests and controls."""

from __future__ import annotations

import numpy as np

from ..elements.tables import Tables
from ..numerics import polynomials


def dfet_tables(order: int, control_order: int, basis: str) -> Tables:
    """The element of states of degree l = `order` and controls of degree q, tested with functions of degree l + 1.

    Dynamics are evaluated at max(l, q) + 1 Gauss-Legendre nodes. The first l + 1 tests, solved for the states' coefficients, give these
    from the rates there. The trajectory is the collocation polynomial of the (l + 1)-stage Gauss-Legendre Runge-Kutta method that is
    equivalent for q <= l: through the states at its stages and at both ends. It is more accurate by one order than the states' own
    polynomial of degree l.
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
