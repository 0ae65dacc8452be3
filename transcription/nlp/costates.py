"""Costates and the Hamiltonian of an optimal vector, from the multipliers of its own conditions of optimality.

They are those of the sum of the objectives, all minimised, that the vector minimises: with the weights w >= 0 of its conditions, scaled so
that sum w = 1 in the objectives' own units. A costate is then how much that sum changes by a unit of the state, and H = costates' rates +
weighted integrands, per unit of the phase's time.
"""

from __future__ import annotations

import numpy as np

from ..base import NLP
from ..trajectories.costates import Costates, PhaseCostates
from .hamiltonian import hamiltonian, integral_weights
from .optimality import Multipliers


def costates(nlp: NLP, z: np.ndarray, found: Multipliers, *, swept: bool = False) -> Costates | None:
    """The costates of a vector (n,) that is optimal, from its multipliers; None where they are no numbers.

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
