"""Basis functions and coefficients of an element on [-1, 1]: what tells one method on elements from another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..numerics import polynomials


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
