"""Controls on nodes of their own: piecewise constant, linear, or a cubic spline, as polynomials on the steps of an integrator."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.sparse import csc_matrix

from problems.compiled import CompiledPhase

from .dfet_element import unwrapped_law
from .polynomials import lobatto_nodes

DEGREES = {"constant": 0, "linear": 1, "spline": 3}
NEGLIGIBLE = 1e-17
"""Weights below this, where the largest are near 1, are left out: the slopes of a spline forget values that are far away, by a factor of
3.7 a node."""


@dataclass(frozen=True)
class ControlLaw:
    """What the values of a control at equally spaced nodes mean in between.

    "constant": a value for each interval between two nodes; "linear": straight lines through a value at each node; "spline": the
    cubic spline through them that has a continuous third derivative at the second node and the last but one (de Boor, "A Practical Guide
    to Splines", IV: not-a-knot), which may leave the bounds between nodes.

    Parameters
    ----------
    kind : "constant", "linear" or "spline"
    nodes : int
        At least 2, both ends of the phase among them.
    """

    kind: str
    nodes: int

    @property
    def degree(self) -> int:
        """Of the polynomials."""
        return DEGREES[self.kind]

    @property
    def jumps(self) -> bool:
        """Whether controls jump at nodes."""
        return self.kind == "constant"

    @property
    def edges(self) -> np.ndarray:
        """The nodes (nodes,), relative to the phase."""
        return np.linspace(0.0, 1.0, self.nodes)

    @property
    def count(self) -> int:
        """How many values there are of each control."""
        return self.nodes - 1 if self.jumps else self.nodes

    @property
    def places(self) -> np.ndarray:
        """Where, relative to the phase, the values are those of the control, (count,)."""
        return 0.5 * (self.edges[1:] + self.edges[:-1]) if self.jumps else self.edges

    def coefficients(self, U: ca.MX, steps: np.ndarray, phase: CompiledPhase) -> ca.MX:
        """The polynomials on each step: their values at its Gauss-Lobatto nodes ("lobatto" in `polynomials.basis_matrix`).

        Periodic controls follow each other the short way round, beyond their bounds where need be.

        Parameters
        ----------
        U : MX (nu, count)
        steps : array (N + 1,)
            Where, relative to the phase, steps begin and end that follow each other; no node lies inside one.
        phase : CompiledPhase

        Returns
        -------
        MX (nu, N (degree + 1))
        """
        if self.kind == "linear":
            left, right = U[:, :-1], U[:, 1:]
            pairs = [unwrapped_law(ca.horzcat(left[:, k], right[:, k]), phase) for k in range(self.nodes - 1)] if _turns(phase) else []
            values = ca.horzcat(left, ca.horzcat(*(pair[:, 1] for pair in pairs)) if pairs else right)
        elif self.kind == "spline":
            law = unwrapped_law(U, phase)
            values = ca.horzcat(law, law @ _sparse(spline_slopes(self.nodes).T))
        else:
            values = U
        return values @ _sparse(self._on_steps(steps))

    def _on_steps(self, steps: np.ndarray) -> np.ndarray:
        """How the coefficients on the steps follow from what describes the pieces between two nodes, (descriptions, N (degree + 1))."""
        middle, last = 0.5 * (steps[1:] + steps[:-1]), self.nodes - 1
        piece = np.minimum((middle * last).astype(int), last - 1)
        tau = 0.5 * (1.0 + lobatto_nodes(self.degree + 1))
        place = (steps[:-1, None] + tau * np.diff(steps)[:, None]) * last - piece[:, None]
        place = np.where(np.abs(place - np.round(place)) < 1e-12, np.round(place), place).ravel()
        piece, columns = np.repeat(piece, self.degree + 1), np.arange(len(place))
        if self.kind == "constant":
            parts = [(piece, np.ones(len(place)))]
        elif self.kind == "linear":
            parts = [(piece, 1.0 - place), (last + piece, place)]
        else:
            t, r = place, 1.0 - place
            ends = [(piece, (1.0 + 2.0 * t) * r**2), (piece + 1, (1.0 + 2.0 * r) * t**2)]
            parts = [*ends, (self.nodes + piece, t * r**2), (self.nodes + piece + 1, -r * t**2)]
        table = np.zeros(({"constant": last, "linear": 2 * last, "spline": 2 * self.nodes}[self.kind], len(place)))
        for rows, weights in parts:
            table[rows, columns] += weights
        return table


def spline_slopes(nodes: int) -> np.ndarray:
    """The slopes of a cubic spline at its equally spaced nodes are this matrix (nodes, nodes) times its values, per distance of two."""
    if nodes == 2:
        return np.array([[-1.0, 1.0], [-1.0, 1.0]])
    left, right = np.zeros((nodes, nodes)), np.zeros((nodes, nodes))
    for k in range(1, nodes - 1):
        left[k, k - 1 : k + 2] = 1.0, 4.0, 1.0
        right[k, [k - 1, k + 1]] = -3.0, 3.0
    # The same cubic on both sides of the second node, and of the last but one.
    left[0, [0, 2]], right[0, :3] = (1.0, -1.0), (-2.0, 4.0, -2.0)
    left[-1, [-3, -1]], right[-1, -3:] = (1.0, -1.0), (-2.0, 4.0, -2.0)
    if nodes == 3:
        # The two are one condition: a parabola.
        left[1], right[1] = (0.0, 1.0, 0.0), (-0.5, 0.0, 0.5)
        left[2], right[2] = (1.0, 4.0, 1.0), (-3.0, 0.0, 3.0)
    slopes = np.linalg.solve(left, right)
    return np.where(np.abs(slopes) < NEGLIGIBLE, 0.0, slopes)


def _sparse(matrix: np.ndarray) -> ca.DM:
    return ca.DM(csc_matrix(matrix))


def _turns(phase: CompiledPhase) -> bool:
    return any(v.period for v in phase.controls)
