"""Controls on nodes of their own: piecewise constant, linear, or a cubic spline, as polynomials on the steps of an integrator."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.sparse import csc_matrix

from problems.compiled import CompiledPhase

from ..numerics.polynomials import lobatto_nodes
from ..phases.mesh import PhaseMesh
from ..phases.writer import unwrapped_law

DEGREES = {"constant": 0, "linear": 1, "spline": 3}


@dataclass(frozen=True)
class ControlLaw:
    """A control by its values at nodes.

    "constant": a value for each interval between two nodes; "linear": straight lines through a value at each node; "spline": the cubic
    spline through them that has a continuous third derivative at the second node and the last but one (de Boor, "A Practical Guide to
    Splines", IV: not-a-knot), which may leave the bounds between nodes.
    """

    kind: str
    pieces: PhaseMesh  # what lies between two nodes each: its edges are the nodes, both ends of the phase among them

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
        """Values at the Gauss-Lobatto nodes of each step; periodic controls go the short way round. steps (N + 1,)."""
        if self.kind == "linear":
            values = ca.horzcat(U[:, :-1], U[:, 1:])
            if any(v.period for v in phase.controls):
                right = [unwrapped_law(U[:, k : k + 2], phase)[:, 1] for k in range(self.pieces.elements)]
                values = ca.horzcat(U[:, :-1], *right)
        else:
            values = unwrapped_law(U, phase) if self.kind == "spline" else U
        return values @ ca.DM(self._on_steps(steps))

    def _on_steps(self, steps: np.ndarray) -> csc_matrix:
        """Sparse matrix (descriptions, N (degree + 1)) of the coefficients on the steps by what describes the pieces between two nodes."""
        nodes, last = self.pieces.places, self.pieces.elements
        middle = 0.5 * (steps[1:] + steps[:-1])
        piece = np.clip(np.searchsorted(nodes, middle * last, side="right") - 1, 0, last - 1)[:, None]
        tau = 0.5 * (1.0 + lobatto_nodes(self.degree + 1))
        place = ((steps[:-1, None] + tau * np.diff(steps)[:, None]) * last - nodes[piece]) / np.diff(nodes)[piece]
        place = np.where(np.abs(place - np.round(place)) < 1e-12, np.round(place), place).ravel()
        piece = np.repeat(piece, self.degree + 1)
        if self.kind == "spline":
            return _spline_weights(nodes, piece, place)
        column = np.arange(len(piece))
        if self.kind == "constant":
            return _without_zeros(np.ones(len(piece)), piece, column, (last, len(piece)))
        # The values at the left ends of all pieces, then those at their right ends.
        both = np.concatenate([piece, last + piece])
        return _without_zeros(np.concatenate([1.0 - place, place]), both, np.tile(column, 2), (2 * last, len(piece)))


def _spline_weights(nodes: np.ndarray, piece: np.ndarray, place: np.ndarray) -> csc_matrix:
    """Sparse matrix (nodes, k) of the values of a spline by those at its nodes, in these pieces and at these places in them, (k,).

    Some pieces at a time, by the nodes near them: weights fall by 3.7 a node, over 48 of them below 1e-20; less than 1e-17 counts as 0.
    """
    from scipy.interpolate import CubicSpline  # slow to import

    last, pieces, near, found = len(nodes) - 1, 512, 48, []
    for first in np.unique(piece // pieces) * pieces:
        column = np.flatnonzero((piece >= first) & (piece < first + pieces))
        low, high = max(first - near, 0), min(first + pieces + near, last) + 1
        spline = CubicSpline(nodes[low:high], np.eye(high - low))
        own = piece[column]
        weights = spline(nodes[own] + place[column] * np.diff(nodes)[own])
        row, node = np.nonzero(np.abs(weights) >= 1e-17)
        found.append((weights[row, node], low + node, column[row]))
    weights, node, column = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return _without_zeros(weights, node, column, (len(nodes), len(piece)))


def _without_zeros(values: np.ndarray, row: np.ndarray, column: np.ndarray, shape: tuple[int, int]) -> csc_matrix:
    """A sparse matrix of entries (k,), without those that are 0."""
    matrix = csc_matrix((values, (row, column)), shape=shape)
    matrix.eliminate_zeros()
    return matrix
