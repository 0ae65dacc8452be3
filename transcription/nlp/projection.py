"""Gradients of the objectives on the tangent space of the active constraints, in a metric of the controls that no mesh changes.

Tappeta, Renaud, Messac and Sundararaj, "Interactive physical programming: tradeoff analysis and decision making in multicriteria
optimization", AIAA Journal 38(5), 2000, project in the Euclidean metric of all variables, which depends on their scales and on the mesh.
Here the square of the length of a variation is the sum of

- the mean over its phase of the square of each control's variation, in spans of its bounds, at fixed places of the phase,
- the square of the variation of each free time, free initial state and parameter, in spans of its bounds,
- the square of the variation of each place where a control switches (an edge of the mesh that moves), in durations of its phase;

states follow from these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags, vstack

from ..base import NLP
from ..numerics.polynomials import basis_matrix, gauss_legendre
from ..trajectories.trajectory import Trajectory
from .optimality import DEPENDENT, Conditions, Linearised, steepest, units

TIGHT = 1e-6
"""Inequalities with no more slack than this, in their scales, are active, whatever their multipliers."""
STEP = 1e-3
"""By how much coefficients of controls are moved, in spans, to see what they do: controls are linear in them."""


@dataclass(frozen=True, eq=False)
class Projection:
    """The objectives' gradients at a vector of an NLP, projected on the tangent space of what is active there.

    Attributes
    ----------
    scales : array (m,)
        Of the objectives.
    weights : array (m,)
        Multipliers of the objectives in these scales, not negative and of sum 1, that leave the least of their gradients.
    gram : array (m, m)
        Products of the projected gradients, in these scales: dF_i/dF_j along the steepest descent of F_j is gram_ij / gram_jj.
    descents : array (m, n)
        The steepest descent of each objective: variations of the vector, in the user's units, of squared length gram_ii, along which the
        objective falls by gram_ii of its scales.
    steepest : float
        The length of the longest of the objectives' gradients where only the equations are active: what others are compared with.
    """

    scales: np.ndarray
    weights: np.ndarray
    gram: np.ndarray
    descents: np.ndarray
    steepest: float

    @property
    def slopes(self) -> np.ndarray:
        """How fast each objective can fall (m,), as a part of `steepest`; 0 where none could."""
        return np.sqrt(np.maximum(np.diag(self.gram), 0.0)) / (self.steepest or 1.0)

    def left(self, weights: np.ndarray) -> float:
        """The length of the weighted sum of the gradients, for weights (m,) in the scales, as a part of `steepest`: 0 where the point is a
        least of that sum."""
        return float(np.sqrt(max(weights @ self.gram @ weights, 0.0))) / (self.steepest or 1.0)


def projection(nlp: NLP, z: np.ndarray, F_scales: np.ndarray | None = None) -> Projection | None:
    """The projection at a feasible vector (n,), for objectives in `F_scales` (m,), see `optimality`; None where a derivative is no number,
    or no multipliers are found.

    Active are the equations and those inequalities whose slack, in scales, is at most their multiplier or `TIGHT`.
    """
    conditions = Conditions.of(nlp, z, F_scales)
    if conditions is None or conditions.scaled is None:
        return None
    linear, (weights, multipliers) = conditions.linear, conditions.scaled
    active, lengths, dF = linear.slack <= np.maximum(multipliers, TIGHT), metric(linear), linear.of_objectives
    try:
        free, _ = steepest(lengths, linear.of_equations, dF)
        s, _ = steepest(lengths, vstack([linear.of_equations, csr_matrix(linear.of_inequalities[active])]), dF)
    except RuntimeError:
        return None
    longest = float(np.sqrt(np.diag(dF @ free).max(initial=0.0)))
    return Projection(linear.scales, weights, dF @ s, -(s * units(nlp)[:, None]).T, longest)


def metric(linear: Linearised) -> csc_matrix:
    """The metric (n, n) of variations of a vector in `units`; what follows from the rest has next to none."""
    nlp = linear.nlp
    of_controls = _controls(nlp, linear.z)
    own = np.full(len(nlp.variables), DEPENDENT)
    alone = np.setdiff1d(nlp.free, [nlp.free[column] for profile in nlp.profiles for column in profile.columns])
    edges = tuple(f"{phase.name}.edge[" for phase in nlp.problem.phases)
    # The bounds of an edge are those of its neighbours.
    own[alone] = [nlp.span[k] ** 2 if nlp.variables[k].name.startswith(edges) else 1.0 for k in alone]
    return csc_matrix(of_controls.T @ of_controls + diags(own))


def _controls(nlp: NLP, z: np.ndarray) -> csr_matrix:
    """Matrix (q, n) of all controls, in spans, at Gauss-Legendre nodes of their polynomials, each times the root of its weight in the mean
    over its phase, by the variables in `units`."""
    here, place = nlp.unpack(z), {profile.name: profile.columns for profile in nlp.profiles}
    rows: list[np.ndarray] = []
    columns: list[np.ndarray] = []
    values: list[np.ndarray] = []
    moved = [_moved(nlp, z, k) for k in range(max((len(one) for one in place.values()), default=0))]
    first = 0
    for phase in here.phases:
        control = phase.control
        degree = control.coefficients.shape[1] - 1
        nodes, weights = gauss_legendre(degree + 1)
        basis, shares = basis_matrix(control.basis, degree, nodes), np.diff(control.edges) / (control.edges[-1] - control.edges[0])
        roots = np.sqrt(0.5 * weights * shares[:, None])
        for i, variable in enumerate(phase.control_variables):
            for trajectory, column in zip(moved, place.get(f"{phase.name}.{variable.name}", ()), strict=False):
                change = trajectory[phase.name].control.coefficients[:, :, i] - control.coefficients[:, :, i]
                elements = np.flatnonzero(change.any(axis=1))
                at = roots[elements] * (change[elements] @ basis.T) / (STEP * variable.span)
                rows.append((first + elements[:, None] * len(nodes) + np.arange(len(nodes))).ravel())
                columns.append(np.full(at.size, nlp.free[column]))
                values.append(at.ravel())
            first += roots.size
    i, j, v = (np.concatenate([np.empty(0, kind), *some]) for kind, some in ((int, rows), (int, columns), (float, values)))
    return csr_matrix(coo_matrix((v, (i, j)), shape=(first, len(z))))


def _moved(nlp: NLP, z: np.ndarray, k: int) -> Trajectory:
    """The trajectory with the k-th coefficient of each control moved by a step: each control has its own, so that all move at once."""
    moving = nlp.free[[profile.columns[k] for profile in nlp.profiles if k < len(profile.columns)]]
    other = z.copy()
    other[moving] += STEP * nlp.span[moving]
    return nlp.unpack(other)
