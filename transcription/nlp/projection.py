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
from scipy.optimize import nnls
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags, vstack

from ..base import NLP
from ..numerics.polynomials import basis_matrix, gauss_legendre
from ..trajectories.trajectory import Trajectory
from .optimality import DEPENDENT, Conditions, Linearised, steepest, units

TIGHT, CLOSE = 1e-6, 1e-4
"""Inequalities with no more slack than the first, in their scales, are active; held are those with a multiplier larger than this and their
slack, and no more slack than the second: where limits nearly depend on each other, multipliers are found for others nearby, too."""
STEP = 1e-3
"""By how much coefficients of controls are moved, in spans, to see what they do: controls are linear in them."""
FLOOR = 1e-4
"""Part of the longest of all gradients that every gradient is taken to have."""
FOLLOWS = 1e-8
"""Change of an inequality, by a variation of length one of what is not held, below which it follows from what is held."""
DEPENDENT_ON_HELD = 1e-9
"""Part of the largest eigenvalue below which others, of products of the gradients of what may be left, are round-off."""


@dataclass(frozen=True, eq=False)
class Projection:
    """The objectives' gradients at a vector of an NLP, projected on what is active there: a tangent space where all of that has a
    multiplier, else a cone, since what has none may be left.

    Attributes
    ----------
    nlp : NLP
    scales : array (m,)
        Of the objectives.
    weights : array (m,)
        Multipliers of the objectives in these scales, not negative and of sum 1, that leave the least of their gradients.
    s : array (n, m + k)
        The gradients of the objectives, and of the k inequalities c >= 0 that are active and may be left, projected on the tangent space of
        what is held, as variations in units.
    gram : array (m + k, m + k)
        The products of these.
    free : array (m,)
        The lengths of the objectives' gradients where only the equations are held, and what bounds peaks: what others are compared with.
    """

    nlp: NLP
    scales: np.ndarray
    weights: np.ndarray
    s: np.ndarray
    gram: np.ndarray
    free: np.ndarray

    def fall(self, combination: np.ndarray) -> np.ndarray:
        """By how much the objectives fall (m,), in their scales, along the steepest descent of a combination (m,) of them, of which the
        length is its slope."""
        return self.gram[: len(self.scales)] @ self._steepest(combination)

    def descent(self, combination: np.ndarray) -> np.ndarray:
        """That descent: a variation (n,) of the vector, in the user's units."""
        return -units(self.nlp) * (self.s @ self._steepest(combination))

    def slope(self, combination: np.ndarray) -> float:
        """How fast a combination (m,) of the objectives can fall: its slope along its steepest descent, as a part of the longest of the
        gradients that it combines; 0 where it cannot."""
        x, shares = self._steepest(combination), np.abs(combination)
        # Where that is next to nothing, at an optimum that nothing holds, the others'.
        longest = (shares * self.free).max() + FLOOR * shares.sum() * self.free.max()
        return float(np.sqrt(max(x @ self.gram @ x, 0.0))) / (longest or 1.0)

    def _steepest(self, combination: np.ndarray) -> np.ndarray:
        """The coefficients (m + k,) of its gradient projected on the cone, of which multipliers of the inequalities, not negative, leave
        least."""
        m = len(self.scales)
        if self.gram.shape[0] == m:
            return np.asarray(combination, dtype=float)
        values, vectors = np.linalg.eigh(self.gram[m:, m:])
        some = values > DEPENDENT_ON_HELD * max(values.max(), self.free.max() ** 2)
        roots, across = np.sqrt(values[some]), vectors[:, some].T
        right = across @ (self.gram[m:, :m] @ combination) / roots
        multipliers = nnls(roots[:, None] * across, right, maxiter=10 * len(values))[0] if some.any() else np.zeros(len(values))
        return np.concatenate([combination, -multipliers])


def projection(nlp: NLP, z: np.ndarray, F_scales: np.ndarray | None = None) -> Projection | None:
    """The projection at a feasible vector (n,), for objectives in `F_scales` (m,), see `optimality`; None where a derivative is no number,
    or no multipliers are found.

    The equations are held, and so are inequalities with a multiplier, and what bounds peaks and absolute values; other inequalities
    without slack may be left.
    """
    conditions = Conditions.of(nlp, z, F_scales)
    if conditions is None or conditions.scaled is None:
        return None
    linear, (weights, multipliers) = conditions.linear, conditions.scaled
    dF, sides, measure = linear.of_objectives, linear.of_inequalities, metric(linear)
    tight = linear.slack <= TIGHT
    bounding = tight & sides[:, np.isinf(nlp.span)].any(axis=1)
    held = ((multipliers > np.maximum(linear.slack, TIGHT)) & (linear.slack <= CLOSE)) | bounding

    def along(active: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        return steepest(measure, vstack([linear.of_equations, csr_matrix(sides[active])]), gradients)[0]

    try:
        free = along(bounding, dF)
        # Most of what may be left follows from what is held, as a mass does from a thrust that is off: a variation at random shows that.
        anywhere = np.random.default_rng(0).normal(size=(1, len(z)))
        anywhere[:, ~np.isin(np.arange(len(z)), nlp.free)] = 0.0
        s = along(held, np.vstack([dF, anywhere]))
        loose = tight & ~held
        loose[loose] = np.abs(sides[loose] @ s[:, -1]) > FOLLOWS * np.sqrt(max(anywhere[0] @ s[:, -1], 0.0))
        every = np.vstack([dF, sides[loose]])
        s = np.hstack([s[:, : len(dF)], along(held, sides[loose])]) if loose.any() else s[:, : len(dF)]
    except RuntimeError:
        return None
    gram = every @ s
    lengths = np.sqrt(np.maximum(np.diag(dF @ free), 0.0))
    return Projection(nlp, linear.scales, weights, s, 0.5 * (gram + gram.T), lengths)


def metric(linear: Linearised) -> csc_matrix:
    """The metric (n, n) of variations of a vector in `units`; what follows from the rest has next to none."""
    nlp = linear.nlp
    of_controls = _controls(nlp, linear.z)
    own = np.full(len(nlp.variables), DEPENDENT)
    alone = np.setdiff1d(nlp.free, [nlp.free[column] for profile in nlp.profiles for column in profile.columns])
    edges = tuple(f"{phase.name}.edge[" for phase in nlp.problem.phases)
    # The bounds of an edge are those of its neighbours.
    own[alone] = [nlp.span[one] ** 2 if nlp.variables[one].name.startswith(edges) else 1.0 for one in alone]
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
        basis, lengths = basis_matrix(control.basis, degree, nodes), np.diff(control.edges)
        # In a phase of no duration all elements are alike.
        shares = lengths / lengths.sum() if lengths.sum() > 0 else np.full(len(lengths), 1.0 / len(lengths))
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
    at, by, value = (np.concatenate([np.empty(0, kind), *some]) for kind, some in ((int, rows), (int, columns), (float, values)))
    return csr_matrix(coo_matrix((value, (at, by)), shape=(first, len(z))))


def _moved(nlp: NLP, z: np.ndarray, k: int) -> Trajectory:
    """The trajectory with the k-th coefficient of each control moved by a step: each control has its own, so that all move at once."""
    moving = nlp.free[[profile.columns[k] for profile in nlp.profiles if k < len(profile.columns)]]
    other = z.copy()
    other[moving] += STEP * nlp.span[moving]
    return nlp.unpack(other)
