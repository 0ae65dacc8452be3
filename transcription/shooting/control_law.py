"""Controls on nodes of their own: piecewise constant, linear, or a cubic spline, as polynomials on the steps of an integrator."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.sparse import csc_matrix

from problems.compiled import CompiledPhase

from ..numerics.periodic import unwrapped_law
from ..numerics.polynomials import lobatto_nodes
from ..phases.mesh import PhaseMesh

FORGOTTEN = 1e-17
"""Weights of a spline by its values, where the largest are 1, that count as 0: they fall by a factor of 3.7 a node."""
DEGREES = {"constant": 0, "linear": 1, "spline": 3}


@dataclass(frozen=True)
class ControlLaw:
    """A control by its values at nodes.

    "constant": a value for each interval between two nodes; "linear": straight lines through a value at each node; "spline": the
    cubic spline through them that has a continuous third derivative at the second node and the last but one (de Boor, "A Practical Guide
    to Splines", IV: not-a-knot), which may leave the bounds between nodes.

    Parameters
    ----------
    kind : "constant", "linear" or "spline"
    pieces : PhaseMesh
        What lies between two nodes each: its edges are the nodes, both ends of the phase among them.
    """

    kind: str
    pieces: PhaseMesh

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
        return np.array(self.pieces.edges)

    @property
    def count(self) -> int:
        """Number of values of each control."""
        return self.pieces.elements if self.jumps else self.pieces.elements + 1

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
            values = ca.horzcat(U[:, :-1], U[:, 1:])
            if any(v.period for v in phase.controls):
                right = [unwrapped_law(U[:, k : k + 2], phase)[:, 1] for k in range(self.pieces.elements)]
                values = ca.horzcat(U[:, :-1], *right)
        else:
            values = unwrapped_law(U, phase) if self.kind == "spline" else U
        return values @ ca.DM(csc_matrix(self._on_steps(steps)))

    def _on_steps(self, steps: np.ndarray) -> np.ndarray:
        """Matrix (descriptions, N (degree + 1)) of the coefficients on the steps by what describes the pieces between two nodes."""
        nodes, last = self.pieces.places, self.pieces.elements
        middle = 0.5 * (steps[1:] + steps[:-1])
        piece = np.clip(np.searchsorted(nodes, middle * last, side="right") - 1, 0, last - 1)[:, None]
        tau = 0.5 * (1.0 + lobatto_nodes(self.degree + 1))
        place = ((steps[:-1, None] + tau * np.diff(steps)[:, None]) * last - nodes[piece]) / np.diff(nodes)[piece]
        place = np.where(np.abs(place - np.round(place)) < 1e-12, np.round(place), place).ravel()
        piece = np.repeat(piece, self.degree + 1)
        if self.kind == "spline":
            from scipy.interpolate import CubicSpline  # slow to import

            weights = CubicSpline(nodes, np.eye(last + 1))(nodes[piece] + place * np.diff(nodes)[piece]).T
            return np.where(np.abs(weights) < FORGOTTEN, 0.0, weights)
        inside = np.arange(last)[:, None] == piece
        return inside * 1.0 if self.kind == "constant" else np.vstack([inside * (1.0 - place), inside * place])
