"""The Hamiltonian of a phase, H = costates' rates + weighted integrands, and what its integrands weigh."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, remembered


def hamiltonian(
    phase: CompiledPhase, costates: np.ndarray, weights: np.ndarray, x: np.ndarray, u: np.ndarray, t: np.ndarray, s: np.ndarray
) -> np.ndarray:
    """H (k,) at k places, from costates and states (k, nx), weights of the integrals (nq,), controls (k, nu), times (k,) and s (ns,)."""
    inputs = x.T, u.T, t[None], s
    rates, integrands = (np.array(function(*inputs)).reshape(-1, len(t)) for function in (phase.dynamics, phase.integrands))
    return np.asarray(np.einsum("ki,ik->k", costates, rates) + weights @ integrands)


def integral_weights(
    problem: CompiledProblem,
    quantities: Sequence[np.ndarray],
    parameters: np.ndarray,
    of_objectives: np.ndarray,
    of_constraints: np.ndarray,
) -> dict[str, np.ndarray]:
    """What a unit of each integral (nq,) counts, by phase: its slope in the sum of objectives and constraints, each times its
    multiplier."""
    slopes = _slopes(problem).call([*quantities, parameters, of_objectives, of_constraints])
    found = {}
    for phase, slope in zip(problem.phases, slopes, strict=True):
        first = 2 + phase.initials.size1_out(0) + phase.finals.size1_out(0)
        found[phase.name] = np.array(slope).ravel()[first : first + phase.integrands.size1_out(0)]
    return found


@remembered
def _slopes(problem: CompiledProblem) -> ca.Function:
    """(q of each phase, parameters, multipliers of objectives and of constraints) -> gradient of their sum by each q."""
    inputs = problem.objectives.mx_in()
    of_objectives, of_constraints = ca.MX.sym("f", len(problem.goals)), ca.MX.sym("c", len(problem.limits))
    total = ca.dot(problem.objectives(*inputs), of_objectives) + ca.dot(problem.constraints(*inputs), of_constraints)
    outputs = [ca.densify(ca.gradient(total, q)) for q in inputs[:-1]]
    return ca.Function("slopes", [*inputs, of_objectives, of_constraints], outputs)
