"""Costates of a phase by the adjoint equation, integrated backward along a trajectory: p' = -(df/dx)'p - (dL/dx)'w.

At the nodes of states whose limits have multipliers, costates jump by these (Hartl, Sethi and Vickson, "A survey of the maximum principles
for optimal control problems with state constraints", SIAM Review 37(2), 1995). Between them the equation is linear, and Gauss-Legendre
collocation solves it to order 2 STAGES.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, remembered

from ..numerics.batched import Batched, expanded
from ..numerics.polynomials import gauss_legendre, lagrange_integrals, lobatto_nodes
from ..trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, wrapped

STAGES = 5
"""Of the collocation, on each piece between two nodes or ends of elements."""


@dataclass(frozen=True, eq=False)
class PhaseMultipliers:
    """The multipliers of one phase, positive at upper limits."""

    dynamics: np.ndarray  # (k,): Of its rows of dynamics
    # paths, peaks, states, sizes: Of the samples of each path constraint and each peak, of the hidden states that have bounds, and of what
    # keeps variables from being less than absolute values.
    paths: Sequence[np.ndarray]
    peaks: Sequence[np.ndarray]
    states: Sequence[np.ndarray]
    sizes: Sequence[np.ndarray]
    integrals: np.ndarray  # (nq,): What a unit of each integral counts
    variables: np.ndarray  # (n,): Of the bounds of all variables of the NLP


@dataclass(frozen=True, eq=False)
class Adjoint:
    """Costates of a phase, and their largest error where it is known, as a part of the largest costate, in scales of states."""

    costates: PiecewisePolynomial
    error: float | None = None

    def beside(self, known: PiecewisePolynomial, units: np.ndarray) -> Adjoint:
        """The same with its error beside the method's own costates, which at ends of elements have a jump: any value in it is right."""
        begin, end = self.costates.ends()
        k = np.abs(self.costates.edges[:, None] - known.edges[1:-1]).argmin(axis=0)
        before, after, own = end[k - 1], begin[k], known.ends()[1][:-1]
        apart = np.maximum(np.minimum(before, after) - own, own - np.maximum(before, after))
        return Adjoint(self.costates, max(self.error or 0.0, _part(np.maximum(apart, 0.0), self.costates.coefficients, units)))


@dataclass(frozen=True, eq=False)
class Ending:
    """What multipliers say of costates: values (nx,) at tf and t0; falls (k, nx) at places (k,) in [0, 1], sharp and spread."""

    final: np.ndarray
    initial: np.ndarray
    places: np.ndarray
    jumps: np.ndarray
    spread: np.ndarray


def swept(phase: CompiledPhase, trajectory: PhaseTrajectory, s: np.ndarray, weights: np.ndarray, ending: Ending) -> Adjoint:
    """The costates of a trajectory, backward from its end. weights (nq,)."""
    t0, length, nx = trajectory.t0, trajectory.tf - trajectory.t0, len(phase.states)
    cells, densities = _cells(t0 + length * ending.places, ending.spread, trajectory)
    edges, jumps = _pieces(trajectory, t0 + length * ending.places, ending.jumps, cells)
    nodes, _ = gauss_legendre(STAGES)
    h, tau = 0.5 * np.diff(edges), lobatto_nodes(STAGES + 1)
    times = edges[:-1, None] + h[:, None] * (1.0 + nodes)
    x = trajectory.state(times).reshape(times.size, -1)
    u = wrapped(trajectory.control(times), phase.controls).reshape(times.size, -1 if phase.controls else 0)
    by_x, own = slopes(phase, x, u, times.ravel(), s, weights)
    by_x, own = by_x.reshape(*times.shape, nx, nx), own.reshape(*times.shape, nx)
    middles = 0.5 * (edges[1:] + edges[:-1])
    own += densities[np.clip(np.searchsorted(cells, middles) - 1, 0, len(densities) - 1)][:, None]
    # Integrals of the Lagrange functions of the stages from the right end to the stages, and to where the results are kept.
    to_stages, to_kept = (lagrange_integrals(nodes, places) - lagrange_integrals(nodes, np.ones(1)) for places in (nodes, tau))
    kept, p = np.empty((len(h), STAGES + 1, nx)), ending.final + jumps[-1]
    for j in range(len(h) - 1, -1, -1):
        # Rates r_i = -(A_i'p_i + l_i) at the stages, where p_i = p + h sum_j to_stages_ij r_j.
        A = h[j] * np.einsum("iab,ij->iajb", by_x[j], to_stages).reshape(STAGES * nx, STAGES * nx)
        right = -(by_x[j] @ p + own[j]).ravel()
        rates = np.linalg.solve(np.eye(STAGES * nx) + A, right).reshape(STAGES, nx)
        kept[j] = p + h[j] * to_kept @ rates
        p = kept[j, 0] + jumps[j]
    units = np.array([v.scale for v in phase.states])
    return Adjoint(PiecewisePolynomial(edges, kept, "lobatto"), _part(p - ending.initial, kept, units))


def _part(difference: np.ndarray, costates: np.ndarray, units: np.ndarray) -> float:
    """The largest difference, as a part of the largest costate where one is not 0; states are in these units."""
    size = float(np.abs(costates * units).max(initial=0.0))
    return float(np.abs(difference * units).max(initial=0.0)) / (size if size > 0 else 1.0)


def slopes(
    phase: CompiledPhase, x: np.ndarray, u: np.ndarray, times: np.ndarray, s: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The transposed derivatives (k, nx, nx) of the rates by the states at k places, and those (k, nx) of the integrands, weighted, or
    of integrands and sizes: weights (nq,) or (k, nq + sizes)."""
    nx, k = len(phase.states), len(times)
    every = np.zeros((k, phase.integrands.size1_out(0) + len(phase.sized)))
    every[:, : weights.shape[-1]] = weights
    by_x, own = _slopes(phase)(x, u, times, np.tile(s, (k, 1)), every)
    # Column by column, as CasADi stores them: that of a state has the derivatives by it.
    return by_x.reshape(k, nx, nx), own


@remembered
def _slopes(phase: CompiledPhase) -> Batched:
    """(x, u, t, s, weights) -> the derivatives of `slopes`."""
    inputs = [ca.MX.sym(name, phase.dynamics.size1_in(i)) for i, name in enumerate("xuts")]
    weighed = ca.vertcat(phase.integrands(*inputs), phase.sizes(*inputs))
    weights = ca.MX.sym("w", weighed.numel())
    values = ca.jacobian(phase.dynamics(*inputs), inputs[0]), ca.gradient(ca.dot(weighed, weights), inputs[0])
    return Batched(expanded(ca.Function("slopes", [*inputs, weights], [ca.densify(one) for one in values])))


def _cells(times: np.ndarray, falls: np.ndarray, trajectory: PhaseTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Ends of cells (k + 1,) about these times, and how steeply (k, nx) costates fall in each; one cell where nothing falls."""
    whole = np.array([trajectory.t0, trajectory.tf])
    if not falls.any():
        return whole, np.zeros((1, falls.shape[1]))
    nodes = np.unique(times)
    total = np.zeros((len(nodes), falls.shape[1]))
    np.add.at(total, np.searchsorted(nodes, times), falls)
    cells = np.concatenate([whole[:1], 0.5 * (nodes[1:] + nodes[:-1]), whole[1:]])
    widths = np.diff(cells)[:, None]
    return cells, np.where(widths > 0, total / np.where(widths > 0, widths, 1.0), 0.0)


def _pieces(trajectory: PhaseTrajectory, times: np.ndarray, jumps: np.ndarray, further: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The ends of pieces (N + 1,) within which states, controls and costates are smooth, and the jumps (N + 1, nx) there."""
    every = np.sort(np.concatenate([trajectory.state.edges, trajectory.control.edges, times, further]))
    every = np.clip(every, trajectory.t0, trajectory.tf)
    # Times that are nearer to each other, in durations of the phase, are one.
    apart = np.diff(every) > 1e-10 * (trajectory.tf - trajectory.t0)
    edges = every[np.append(True, apart)]
    edges = edges if len(edges) > 1 else np.array([trajectory.t0, trajectory.tf])
    edges[[0, -1]] = trajectory.t0, trajectory.tf
    total = np.zeros((len(edges), jumps.shape[1]))
    np.add.at(total, np.abs(times[:, None] - edges).argmin(axis=1), jumps)
    return edges, total
