"""One phase as finite elements in time: its variables, its rows, its propagation and its trajectory."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, Variable

from ..numerics.batched import expanded
from ..numerics.periodic import unwrapped, wrapped
from ..numerics.polynomials import gauss_legendre
from ..phases.layout import Layout
from ..phases.mesh import PhaseMesh
from ..phases.writer import Ends, PhaseWriter, Rows, Written
from ..trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial
from .element import Tables, element_function
from .propagation import Propagation


class DFETPhase(PhaseWriter):
    """One phase on the N elements of its mesh.

    Slots: `X` (N, l + 1, nx) coefficients of the states, `U` (N, q + 1, nu) of the controls, `B` (N + 1, nx) states at the ends of the
    elements, which are unknowns of their own.
    """

    def __init__(self, mesh: PhaseMesh, tables: Tables, phase: CompiledPhase, layout: Layout, ends: Ends) -> None:
        super().__init__(phase, layout, ends)
        self.mesh, self.tables = mesh, tables
        self.n = elements = mesh.elements
        self.places, self.widths = mesh.places, np.diff(mesh.places)
        prefix = f"{phase.name}."
        self.U = layout.add_table(prefix, phase.controls, elements, tables.control_order + 1, free=True)
        self.X = layout.add_table(prefix, phase.states, elements, tables.order + 1)
        at_edges = [replace(v, name=f"{v.name}[edge]") for v in phase.states]
        self.interior = self.X.ravel()
        edges = layout.add_table(prefix, at_edges, 1, elements - 1)[0]
        self.B = np.vstack([ends.initial[None], edges, ends.final[None]])
        self._sizes = [Variable(f"size[{k}]", -np.inf, np.inf, "", scale) for k, scale in enumerate(phase.size_scales)]
        self.S = layout.add_table(prefix, self._sizes, elements, len(tables.tau))
        self.magnitudes = self.S.ravel()
        self._element = expanded(element_function(tables, phase))

    @cached_property
    def _propagation(self) -> Propagation:
        # Only where something is propagated: gradient solves of few starts never need what takes seconds to write out.
        return Propagation(self.n, self.tables, self.phase)

    @property
    def compilable(self) -> bool:  # type: ignore[override]
        """See `PhaseWriter.compilable`."""
        return self._propagation.quick

    def write(self, extended: ca.MX, rows: Rows) -> Written:
        """See `PhaseWriter.write`."""
        n, tables, phase, pick = self.n, self.tables, self.phase, self.layout.pick
        left, right, (U, *times) = pick(extended, self.B[:-1]), pick(extended, self.B[1:]), self._inputs(extended)
        weak, integrals, paths, equalities, peaks, ends, sizes = self._element.map(n)(pick(extended, self.X), U, left, right, *times)
        tests = tables.order + 2
        residual = weak - ca.kron(right, ca.DM(np.eye(1, tests, tests - 1)))
        self.add_dynamics(rows, residual)
        self.add_paths(rows, paths, equalities)
        nu, totals = len(phase.controls), ca.sum2(integrals)
        if self._sizes:
            totals = self._with_sizes(totals, pick(extended, self.S), sizes, times[1], rows)
        return Written(ends[:nu, 0], ends[nu:, -1], totals, peaks, ca.vec(ca.fabs(sizes)))

    def _with_sizes(self, totals: ca.MX, S: ca.MX, sizes: ca.MX, lengths: ca.MX, rows: Rows) -> ca.MX:
        """The integrals, those of absolute values as sums of the variables S (sizes, n k), which are not to be less than these."""
        scales = np.tile([v.scale for v in self._sizes], sizes.shape[1])
        for sign in (1.0, -1.0):
            rows.add(sign * sizes - S, -np.inf, 0.0, scales, f"absolute values in '{self.phase.name}'", propagated=True)
        entries = ca.vertsplit(totals)
        for row, one in zip(self.phase.sized, ca.vertsplit(S), strict=True):
            on_elements = ca.DM(self.tables.weights).T @ ca.reshape(one, -1, self.n)
            entries[row] = ca.sum2(0.5 * lengths * on_elements)
        return ca.vertcat(*entries)

    def state_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """See `PhaseWriter.state_nodes`."""
        inside = self.mesh.inside(self.tables.state_nodes).ravel()
        slots = np.vstack([self.B[1:], self.X.reshape(len(inside), -1)])
        return slots, np.concatenate([self.mesh.edges[1:], inside])

    def control_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """See `PhaseWriter.control_nodes`."""
        share = self.mesh.inside(self.tables.control_nodes).ravel()
        return self.U.reshape(len(share), len(self.phase.controls)), share

    def propagate(self, extended: ca.MX, *, robust: bool) -> tuple[ca.MX, ca.MX, ca.MX]:
        """See `PhaseWriter.propagate`."""
        initial = self.layout.pick(extended, self.ends.initial)
        right, X, residual = self._propagation.elements(robust)(initial, *self._inputs(extended))
        extended = self.layout.replaced(extended, np.concatenate([self.X.ravel(), self.B[1:].ravel()]), ca.veccat(X, right))
        return extended, right[:, -1], residual.T

    def sensitivity(self, extended: ca.MX, S: ca.MX, *, interior: bool) -> tuple[ca.MX, ca.MX]:
        """See `PhaseWriter.sensitivity`."""
        n, nx, pick = self.n, len(self.phase.states), self.layout.pick
        left, X = pick(extended, self.B[:-1]), pick(extended, self.X)
        blocks = ca.horzsplit(self._propagation.derivatives(interior)(X, left, *self._inputs(extended)), self._propagation.inputs)
        edges, inside = [S[(self.ends.initial % S.shape[0]).tolist(), :]], []
        for j, D in enumerate(blocks):
            out = D[:, :nx] @ edges[-1] + D[:, nx:] @ self._outer(j)
            edges.append(out[:nx, :])
            inside.append(out[nx:, :])
        slots, values = [self.B[1:].ravel()], edges[1:]
        if interior:
            slots, values = [*slots, self.X.ravel()], [*values, *inside]
        return self.layout.replaced(S, np.concatenate(slots), ca.vertcat(*values)), edges[n]

    def _inputs(self, extended: ca.MX) -> tuple[ca.MX, ...]:
        """The other inputs of the elements, side by side: controls, starts, lengths, and s."""
        s = self.layout.pick(extended, self.ends.statics)
        mean = (s[1] - s[0]) / self.n
        starts, lengths = s[0] + mean * ca.DM(self.places[:-1]).T, mean * ca.DM(self.widths).T
        return self.layout.pick(extended, self.U), starts, lengths, ca.repmat(s, 1, self.n)

    def _outer(self, j: int) -> ca.DM:
        """Derivatives (nu (q + 1) + 2 + len(s), d) of the controls, the start, the length and s of element j, which never change: these
        are free variables or constants."""
        seeds = self.layout.seeds()
        controls, statics = (seeds[(slots.ravel() % seeds.shape[0]).tolist(), :] for slots in (self.U[j], self.ends.statics))
        mean = (statics[1, :] - statics[0, :]) / self.n
        return ca.vertcat(controls, statics[0, :] + mean * self.places[j], mean * self.widths[j], statics)

    def interpolate(self, extended: np.ndarray, trajectory: PhaseTrajectory) -> None:
        """See `PhaseWriter.interpolate`."""
        phase, tables, t0, length = self.phase, self.tables, trajectory.t0, trajectory.tf - trajectory.t0
        # Between the ends of this mesh's elements, where a control may jump: Gauss-Legendre nodes never meet them.
        nodes_of_states, nodes_of_controls = gauss_legendre(tables.order + 1)[0], gauss_legendre(tables.control_order + 1)[0]
        states = trajectory.state(t0 + length * self.mesh.inside(nodes_of_states))
        controls = unwrapped(trajectory.control(t0 + length * self.mesh.inside(nodes_of_controls)), phase.controls)
        at_edges = trajectory.state(t0 + length * np.array(self.mesh.edges[1:-1]))
        self.layout.write(extended, self.X, np.linalg.solve(tables.state(nodes_of_states), states)[None])
        self.layout.write(extended, self.U, wrapped(np.linalg.solve(tables.control(nodes_of_controls), controls), phase.controls)[None])
        self.layout.write(extended, self.B[1:-1], at_edges[None])

    def unpack(self, extended: np.ndarray) -> PhaseTrajectory:
        """See `PhaseWriter.unpack`."""
        phase, tables = self.phase, self.tables
        s = extended[self.ends.statics]
        edges = s[0] + (s[1] - s[0]) * self.places / self.n
        control = PiecewisePolynomial(edges, unwrapped(extended[self.U], phase.controls), tables.control_basis)
        B = extended[self.B]
        closed = np.concatenate([B[:-1, None], tables.state(tables.stages) @ extended[self.X], B[1:, None]], axis=1)
        return self.trajectory(extended, tables.points[:-1], PiecewisePolynomial(edges, closed, "closed-legendre"), control)
