"""Collocation by explicit Euler steps: the smallest method that fulfils the contract, written as a newcomer would write one.

x[j+1] = x[j] + h f(x[j], u[j], t[j], s) on element j, with a constant control; integrals by the same rule. Global errors are of order 1.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from problems import CompiledPhase, CompiledProblem, Problem
from transcription import NLP, Meshed, PhaseTrajectory, PiecewisePolynomial
from transcription.assembly import Assembly
from transcription.phases.layout import Layout
from transcription.phases.mesh import PhaseMesh
from transcription.phases.rows import EndSlots, Rows, Written
from transcription.phases.writer import PhaseWriter


@dataclass(frozen=True)
class Euler(Meshed):
    """Explicit Euler steps.

    Parameters
    ----------
    elements : int
        Number of equal steps of each phase.
    mesh : mapping, optional
        Phases with steps of their own; see `Meshed`.
    """

    elements: int
    mesh: tuple[tuple[str, PhaseMesh], ...] | Mapping[str, Any] | None = None

    order = 1
    highest_order: ClassVar[int] = 1
    most_elements: ClassVar[int] = 1000
    word = "euler"
    examples = "euler:40 (40 steps)"

    def transcribe(self, problem: Problem | CompiledProblem) -> NLP:
        """Write `problem` as an NLP; see `Transcription.transcribe`."""
        compiled = problem.compile()
        self.check_phases(compiled)
        return Assembly(compiled, lambda phase, layout, ends: EulerPhase(self.mesh_of(phase.name), phase, layout, ends)).nlp(self)


class EulerPhase(PhaseWriter):
    """One phase on N elements. Slots: `U` (N, nu) of the controls, `B` (N + 1, nx) of the states at the ends of the elements."""

    def __init__(self, mesh: PhaseMesh, phase: CompiledPhase, layout: Layout, ends: EndSlots) -> None:
        super().__init__(phase, layout, ends)
        self.mesh = mesh
        prefix, n = f"{phase.name}.", mesh.elements
        self.U = layout.add_table(prefix, phase.controls, n, 1, free=True)[:, 0]
        inside = layout.add_table(prefix, [replace(v, name=f"{v.name}[edge]") for v in phase.states], n - 1, 1)[:, 0]
        self.B = np.vstack([ends.initial[None], inside, ends.final[None]])

    def state_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """See `PhaseWriter.state_nodes`."""
        return self.B[1:], np.array(self.mesh.edges[1:])

    def control_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """See `PhaseWriter.control_nodes`."""
        return self.U, self.mesh.inside(np.zeros(1)).ravel()

    def write(self, extended: ca.MX, rows: Rows) -> Written:
        """See `PhaseWriter.write`."""
        phase, pick, n = self.phase, self.layout.pick, self.mesh.elements
        s = pick(extended, self.ends.statics)
        X, U, t = pick(extended, self.B), pick(extended, self.U), s[0] + (s[1] - s[0]) * ca.DM(self.mesh.edges).T
        h = t[1:] - t[:-1]
        begins = X[:, :-1], U, t[:-1], ca.repmat(s, 1, n)
        self.add_dynamics(rows, X[:, 1:] - X[:, :-1] - ca.repmat(h, len(phase.states), 1) * phase.dynamics.map(n)(*begins))
        # A control keeps its last value up to the end, where constraints are looked at as well.
        nodes = X, ca.horzcat(U, U[:, -1]), t, ca.repmat(s, 1, n + 1)
        self.add_paths(rows, phase.path.map(n + 1)(*nodes))
        return Written(U[:, 0], U[:, -1], phase.integrands.map(n)(*begins) @ h.T, phase.peaks.map(n + 1)(*nodes))

    def unpack(self, extended: np.ndarray) -> PhaseTrajectory:
        """See `PhaseWriter.unpack`."""
        values = [extended[self.layout.index(slots)].reshape(slots.shape) for slots in (self.ends.statics, self.B, self.U)]
        s, B, U = values
        time = s[0] + (s[1] - s[0]) * np.array(self.mesh.edges)
        state = PiecewisePolynomial(time, np.stack([B[:-1], B[1:]], axis=1), "lobatto")
        control = PiecewisePolynomial(time, U[:, None], "lobatto")
        return self.trajectory(extended, np.array([-1.0]), state, control)
