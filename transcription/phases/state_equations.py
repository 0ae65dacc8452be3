"""The states of a phase as the solution of its rows of dynamics: how they follow from the rest, and their derivatives."""

from __future__ import annotations

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase

from ..numerics.batched import expanded
from .layout import Layout

ITERATIONS, TOLERANCE = 100, 1e-14
"""Of Newton's method; the tolerance is that of scaled residuals and states."""


class StateEquations:
    """G(y, e) = 0 for the scaled states y of one phase, where e is the rest of an extended vector. slots (k, nx), final (nx,)."""

    def __init__(
        self, phase: CompiledPhase, layout: Layout, extended: ca.MX, residual: ca.MX, slots: np.ndarray, final: np.ndarray
    ) -> None:
        if residual.numel() != slots.size:
            raise ValueError(f"phase '{phase.name}': {residual.numel()} rows of dynamics do not determine {slots.size} states")
        self._layout, self._slots, self._final = layout, slots.ravel(), final
        self._scales = ca.DM(np.tile([v.scale for v in phase.states], len(slots)))
        self._initial = np.tile(np.arange(len(phase.states)), len(slots))
        y = ca.MX.sym("y", slots.size)
        rows = ca.Function("rows", [extended], [residual])(layout.replaced(extended, self._slots, y * self._scales, constants=True))
        self._residual = expanded(ca.Function("equations", [y, extended], [ca.densify(rows)], ["x", "p"], ["g"]))
        options = {"error_on_fail": False, "max_iter": ITERATIONS, "abstol": TOLERANCE, "abstolStep": TOLERANCE}
        self._newton = ca.rootfinder("newton", "fast_newton", self._residual, options)
        x, p = self._residual.mx_in()
        g = self._residual(x, p)
        self._jacobians = expanded(ca.Function("jacobians", [x, p], [ca.jacobian(g, x), ca.jacobian(g, p)]))
        index = layout.index(self._slots)
        self._rows_of_final = [int(np.flatnonzero(index == i)[0]) for i in layout.index(final)]

    def propagate(self, extended: ca.MX, initial: np.ndarray) -> tuple[ca.MX, ca.MX, ca.MX]:
        """See `PhaseWriter.propagate`; `initial` (nx,) are the slots of the initial states, from which all others begin."""
        y = self._newton(extended[self._layout.index(initial)[self._initial].tolist()] / self._scales, extended)
        x = y * self._scales
        return self._layout.replaced(extended, self._slots, x), x[self._rows_of_final], self._residual(y, extended)

    def sensitivity(self, extended: ca.MX, S: ca.MX) -> tuple[ca.MX, ca.MX]:
        """See `PhaseWriter.sensitivity`."""
        y = extended[self._layout.index(self._slots).tolist()] / self._scales
        if (self._final < 0).any():
            # An extended vector has the imposed values, not those that propagation gives.
            y = self._newton(y, extended)
        by_states, by_rest = self._jacobians(y, extended)
        of_states = ca.solve(by_states, -(by_rest @ S), "qr") * ca.repmat(self._scales, 1, S.shape[1])
        return self._layout.replaced(S, self._slots, of_states), of_states[self._rows_of_final, :]
