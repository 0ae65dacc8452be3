"""How much errors grow along a trajectory that is flown with its controls as they are."""

from __future__ import annotations

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem

from ..trajectories.arcs import Arcs
from ..trajectories.trajectory import PhaseTrajectory, Trajectory
from .scales import state_scales

STEP = 1e-6
"""Change of a state, in scales, for its derivatives: the root of what the integrator resolves."""
RTOL = 1e-11


def growth(problem: CompiledProblem, trajectory: Trajectory) -> float:
    """The largest factor by which an error of a state, in scales, grows from anywhere in a phase to its end, or to any place before, to
    first order; at least 1.

    Open-loop simulation with 16 digits follows nothing that grows by many orders of magnitude, however right each element is.
    """
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    return max(_phase_growth(phase, trajectory[phase.name], parameters) for phase in problem.phases)


def _phase_growth(phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray) -> float:
    transitions = _transitions(phase, trajectory, parameters)
    if not np.isfinite(transitions).all():
        return np.inf
    largest, reached = 1.0, np.eye(transitions.shape[1])[None]
    for one in transitions:
        # From the beginnings of all elements so far to the end of this one.
        reached = one @ reached
        largest = max(largest, float(np.abs(reached).sum(axis=2).max()))
        if largest > 1e100:
            return np.inf
        reached = np.concatenate([reached, np.eye(transitions.shape[1])[None]])
    return largest


def _transitions(phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray) -> np.ndarray:
    """Derivatives (N, nx, nx) of the states at the ends of the elements by those at their beginnings, in scales."""
    elements, nx = len(trajectory.state.coefficients), len(phase.states)
    scales, nothing = state_scales(trajectory), np.zeros((elements * (nx + 1), phase.integrands.size1_out(0)))
    changed = np.vstack([np.zeros(nx), STEP * np.diag(scales)])
    starts = (trajectory.edge_states[:-1, None] + changed).reshape(-1, nx)
    arcs = Arcs.of(phase, [(trajectory, j, parameters) for j in range(elements) for _ in range(nx + 1)])
    tolerances = 0.1 * RTOL * np.concatenate([scales, np.ones(nothing.shape[1])])
    ends = arcs.integrate(np.hstack([starts, nothing]), RTOL, tolerances, "DOP853")[:, -1, :nx].reshape(elements, nx + 1, nx)
    return ((ends[:, 1:] - ends[:, :1]) / (STEP * scales)).swapaxes(1, 2)
