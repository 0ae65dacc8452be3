"""Controls on nodes of their own: piecewise constant, linear, or a cubic spline, as polynomials on the steps of an integrator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
from scipy.sparse import csc_matrix

from problems.compiled import CompiledPhase

from ..numerics.periodic import unwrapped_law
from ..numerics.polynomials import lobatto_nodes

DEGREES = {"constant": 0, "linear": 1, "spline": 3}


@dataclass(frozen=True)
class ControlLaw:
    """A control by its values at equally spaced nodes.

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
        """Number of values of each control."""
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
            values = ca.horzcat(law, spline_slopes(self.nodes).map(law.shape[0])(law.T).T) if law.numel() else ca.MX(0, 2 * self.nodes)
        else:
            values = U
        return values @ _sparse(self._on_steps(steps))

    def _on_steps(self, steps: np.ndarray) -> np.ndarray:
        """Matrix (descriptions, N (degree + 1)) of the coefficients on the steps by what describes the pieces between two nodes."""
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


@cache
def spline_slopes(nodes: int) -> ca.Function:
    """(values (nodes,)) -> slopes (nodes,) of a cubic spline at its equally spaced nodes, per distance of two of these.

    The slopes m satisfy m[k-1] + 4 m[k] + m[k+1] = 3 (u[k+1] - u[k-1]) inside and, where the first two pieces are one cubic,
    m[0] + 2 m[1] = (u[2] + 4 u[1] - 5 u[0]) / 2, which Gaussian elimination solves; the same at the other end.
    """
    u = ca.SX.sym("u", nodes)
    if nodes == 2:
        return ca.Function("slopes", [u], [ca.repmat(u[1] - u[0], 2, 1)])
    inside = [3.0 * (u[k + 1] - u[k - 1]) for k in range(1, nodes - 1)]
    first, last = 0.5 * (u[2] + 4.0 * u[1] - 5.0 * u[0]), -0.5 * (u[-3] + 4.0 * u[-2] - 5.0 * u[-1])
    if nodes == 3:
        # The conditions at both ends are the same: a parabola.
        middle = 0.5 * (u[2] - u[0])
        return ca.Function("slopes", [u], [ca.vertcat(first - 2.0 * middle, middle, last - 2.0 * middle)])
    below, diagonal, above = ([1.0] * (nodes - 2) + [2.0], [1.0] + [4.0] * (nodes - 2) + [1.0], [2.0] + [1.0] * (nodes - 2))
    pivot, right = [diagonal[0]], [first]
    for k, known in enumerate([*inside, last]):
        factor = below[k] / pivot[k]
        pivot.append(diagonal[k + 1] - factor * above[k])
        right.append(known - factor * right[k])
    slopes = [right[-1] / pivot[-1]]
    for k in range(nodes - 2, -1, -1):
        slopes.append((right[k] - above[k] * slopes[-1]) / pivot[k])
    return ca.Function("slopes", [u], [ca.vertcat(*reversed(slopes))])


def _sparse(matrix: np.ndarray) -> ca.DM:
    return ca.DM(csc_matrix(matrix))


def _turns(phase: CompiledPhase) -> bool:
    return any(v.period for v in phase.controls)
