"""Costates and the Hamiltonian of an optimal vector, from the multipliers of its own conditions of optimality.

They belong to the weighted sum of the objectives, all minimised, that the vector minimises: with the weights w >= 0 of its conditions,
scaled so that sum w = 1 in the objectives' own units. A costate is the derivative of that sum by the state, and H = costates' rates +
weighted integrands, per unit of the phase's time.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, remembered

from ..base import NLP
from ..trajectories.costates import Costates, PhaseCostates
from .optimality import Multipliers


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
    """The weight of each integral (nq,) in the sum of objectives and constraints, each times its multiplier; by phase. quantities: a column
    q for each phase, as in `NLP.quantities`."""
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


def costates(nlp: NLP, z: np.ndarray, found: Multipliers, *, swept: bool = False) -> Costates | None:
    """The costates of an optimal vector (n,), from its multipliers; None if they are not finite.

    The weights of the objectives are those multipliers over their sum, so that they are of the objectives' own units.
    `swept`: by the adjoint equation, backward from tf, also where the multipliers of the method are costates themselves.
    """
    z = np.asarray(z, dtype=float)
    problem, trajectory, total = nlp.problem, nlp.unpack(z), found.of_objectives.sum()
    of_objectives, of_rows, of_bounds = (one / total for one in (found.of_objectives, found.of_rows, found.of_bounds))
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    quantities = [np.array(q).ravel() for q in nlp.quantities.call([z])]
    of_constraints = of_rows[len(of_rows) - len(problem.limits) :]
    weights = integral_weights(problem, quantities, parameters, of_objectives, of_constraints)
    adjoints, phases = nlp.adjoint(z, of_rows, of_bounds, weights, swept=swept), {}
    for phase in problem.phases:
        name, flown, adjoint = phase.name, trajectory[phase.name], adjoints[phase.name]
        values = adjoint.costates(flown.time)
        s = np.array([flown.t0, flown.tf, *parameters])
        H = hamiltonian(phase, values, weights[name], flown.states, flown.controls, flown.time, s)
        if not (np.isfinite(values).all() and np.isfinite(H).all()):
            return None
        phases[name] = PhaseCostates(tuple(v.name for v in phase.states), values, H, adjoint.costates, adjoint.error)
    return Costates(of_objectives, phases)
