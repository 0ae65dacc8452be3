"""How much the Hamiltonian varies along phases in which it is constant at an optimum: what a mesh does not resolve shows there."""

from __future__ import annotations

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, remembered

from .costates import Costates, PhaseCostates, has_length
from .trajectory import PhaseTrajectory, Trajectory

TENTH = 0.1
"""Part of the time at either end of its range in which the Hamiltonian does not count."""


def hamiltonian_variation(problem: CompiledProblem, trajectory: Trajectory, costates: Costates) -> float:
    """The range in which the Hamiltonian is for four fifths of the time, as a part of the mean size of its terms: the largest of all
    autonomous phases, 0 if there is none.

    The tenths of the time in which it is least and greatest do not count: there are jumps of costates at limits of states.

    A phase is autonomous where neither its rates, its integrands, its path constraints nor its peaks depend on time. There the Hamiltonian
    is constant along an optimum, also where limits act (Bryson and Ho, "Applied Optimal Control", 1975, sections 2.3 and 3.8). Its terms
    are costates times rates, one for each state, and the weighted integrands.
    """
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    flown = {phase.name: trajectory[phase.name] for phase in problem.phases if _is_autonomous(phase)}
    found = [
        _variation(phase, flown[phase.name], costates[phase.name], parameters)
        for phase in problem.phases
        if phase.name in flown and has_length(trajectory, flown[phase.name])
    ]
    return max(found, default=0.0)


@remembered
def _is_autonomous(phase: CompiledPhase) -> bool:
    """Whether nothing that holds all along a phase depends on time itself."""
    functions = (phase.dynamics, phase.integrands, phase.path, phase.peaks)
    return not any(function.jac_sparsity(0, function.index_in("t")).nnz() for function in functions if function.size1_out(0))


def _variation(phase: CompiledPhase, flown: PhaseTrajectory, costates: PhaseCostates, parameters: np.ndarray) -> float:
    s = np.array([flown.t0, flown.tf, *parameters])
    rates = np.array(phase.dynamics(flown.states.T, flown.controls.T, flown.time[None], s)).T
    terms, H = costates.at_nodes * rates.reshape(costates.at_nodes.shape), costates.hamiltonian
    sizes = np.abs(terms).sum(axis=1) + np.abs(H - terms.sum(axis=1))
    spans = np.gradient(flown.time)
    # Not the median: after a peak that is all that counts, costates vanish.
    size, (low, high) = np.average(sizes, weights=spans), _quantiles(H, spans, [TENTH, 1.0 - TENTH])
    return float((high - low) / size) if size > 0 else 0.0


def _quantiles(values: np.ndarray, spans: np.ndarray, parts: list[float]) -> np.ndarray:
    """The values (k,) below which the others are for such parts of the time, from values (n,) that last for `spans` (n,)."""
    order = np.argsort(values)
    middles = np.cumsum(spans[order]) - 0.5 * spans[order]
    return np.interp(np.multiply(parts, spans.sum()), middles, values[order])
