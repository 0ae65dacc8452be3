"""Costates and the Hamiltonian along a trajectory, as data; and how much the Hamiltonian varies where it is constant at an optimum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, remembered

from .trajectory import Named, PhaseTrajectory, PiecewisePolynomial, Trajectory


@dataclass(frozen=True, eq=False, repr=False)
class PhaseCostates(Named[np.ndarray]):
    """The costates of one phase by state, at the trajectory's nodes: after a jump there, and before it at tf."""

    what = "costate of state"
    names: tuple[str, ...]  # the states
    at_nodes: np.ndarray  # (k, nx): At the nodes of the trajectory
    hamiltonian: np.ndarray  # (k,): There
    polynomial: PiecewisePolynomial  # the costates between the nodes
    # Of costates that were integrated backward: the largest difference from what the multipliers say at t0, and at the end of each
    # element where these are costates (DFET, Gauss, Radau), as a part of the largest costate, all in scales of their states. None for
    # those that are multipliers themselves, or follow from these exactly.
    error: float | None = None

    def __repr__(self) -> str:
        return f"PhaseCostates({len(self.at_nodes)} nodes, [{', '.join(self.names)}])"

    @property
    def by_name(self) -> Mapping[str, np.ndarray]:
        return dict(zip(self.names, self.at_nodes.T, strict=True))


@dataclass(frozen=True, eq=False, repr=False)
class Costates(Named[PhaseCostates]):
    """Costates by phase, and the weights (m,) of the minimised objectives in their sum: not negative, of sum 1 in own units."""

    weights: np.ndarray
    phases: Mapping[str, PhaseCostates]

    def __repr__(self) -> str:
        return f"Costates({', '.join(self.phases)}; weights {self.weights})"

    @property
    def by_name(self) -> Mapping[str, PhaseCostates]:
        return self.phases


def has_length(trajectory: Trajectory, phase: PhaseTrajectory) -> bool:
    """Whether a phase lasts for more than a millionth of the whole; all do if none does. Else multipliers are no costates."""
    lengths = [one.tf - one.t0 for one in trajectory.phases]
    whole = max(one.tf for one in trajectory.phases) - min(one.t0 for one in trajectory.phases)
    return phase.tf - phase.t0 > 1e-6 * whole or max(lengths) <= 1e-6 * whole


def hamiltonian_variation(problem: CompiledProblem, trajectory: Trajectory, costates: Costates) -> float:
    """The range of the Hamiltonian as a part of the mean size of its terms: the largest of all autonomous phases, 0 if there is none.

    The tenths of the time in which it is least and greatest do not count: there are jumps of costates at limits of states. Where neither
    rates, integrands, path constraints nor peaks depend on time, it is constant along an optimum, also where limits act (Bryson and Ho,
    "Applied Optimal Control", 1975, sections 2.3 and 3.8). Its terms are costates times rates and the weighted integrands.
    """
    parameters, found = [trajectory.parameters[v.name] for v in problem.parameters], [0.0]
    for phase in problem.phases:
        flown = trajectory[phase.name]
        if not _is_autonomous(phase) or not has_length(trajectory, flown):
            continue
        own = costates[phase.name]
        s = np.array([flown.t0, flown.tf, *parameters])
        rates = np.array(phase.dynamics(flown.states.T, flown.controls.T, flown.time[None], s)).T
        terms, H, spans = own.at_nodes * rates.reshape(own.at_nodes.shape), own.hamiltonian, np.gradient(flown.time)
        # The mean of the sizes, not the median: after a peak that is all that counts, costates vanish.
        size = np.average(np.abs(terms).sum(axis=1) + np.abs(H - terms.sum(axis=1)), weights=spans)
        order = np.argsort(H)
        middles = np.cumsum(spans[order]) - 0.5 * spans[order]
        low, high = np.interp(np.multiply([0.1, 0.9], spans.sum()), middles, H[order])
        found.append(float((high - low) / size) if size > 0 else 0.0)
    return max(found)


@remembered
def _is_autonomous(phase: CompiledPhase) -> bool:
    """Whether nothing that holds all along a phase depends on time itself."""
    functions = (phase.dynamics, phase.integrands, phase.path, phase.peaks)
    return not any(function.jac_sparsity(0, function.index_in("t")).nnz() for function in functions if function.size1_out(0))
