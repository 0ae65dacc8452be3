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
from functools import cached_property

import numpy as np
from scipy.optimize import nnls
from scipy.sparse import coo_matrix, csr_matrix, diags, vstack

from ..base import NLP
from ..numerics.polynomials import basis_matrix, gauss_legendre
from ..trajectories.trajectory import Trajectory
from .optimality import DEPENDENT, Conditions, Linearised, steepest, units

TIGHT_SLACK = 1e-6
"""Inequalities with no more slack than this, in their scales, are active."""
CONTROL_STEP = 1e-3
"""By how much coefficients of controls are moved, in spans, to see what they do: controls are linear in them."""
RELEASED = 1e-4
"""Change of what is active, in its scales, by a variation of length one, below which it need not stay so: a hundredth of that length is
still a large step, and points are feasible to 1e-6."""


@dataclass(frozen=True, eq=False)
class TangentProjection:
    """The objectives' gradients at a vector, projected on the tangent space, or cone, of the constraints that are active there."""

    nlp: NLP
    scales: np.ndarray  # (m,): Of the objectives
    # (m,): Multipliers of the objectives in these scales, not negative and of sum 1, that leave the least of their gradients.
    weights: np.ndarray
    # (n, k): Gradients of the objectives, of the inequalities that are held, and of those that may be left, in the metric: variations in
    # units along which the equations stay satisfied, and so does what bounds peaks.
    variations: np.ndarray
    columns: np.ndarray  # (q, k): The same in coordinates in which the metric is Euclid's
    held: int  # how many inequalities are held
    conditions: Conditions  # of optimality, with these scales

    @cached_property
    def free(self) -> np.ndarray:
        """The lengths (m,) of the objectives' gradients without active inequalities, with which remainders are compared."""
        return np.linalg.norm(self.columns[:, : len(self.scales)], axis=0)

    def fall(self, combination: np.ndarray) -> np.ndarray:
        """By how much the objectives fall (m,), in scales, along the steepest descent of a combination (m,), whose length is its slope."""
        return self._nearly[0].T @ _on_cone(combination, self._nearly)[0]

    def descent(self, combination: np.ndarray) -> np.ndarray:
        """The steepest descent of a combination (m,): a variation (n,) of the vector, in the user's units."""
        m, (_, of_loose) = len(self.scales), _on_cone(combination, self._nearly)
        beside = self.columns[:, :m] @ combination - self.columns[:, m + self.held :] @ of_loose
        U, sizes, V = _held(self.columns[:, m : m + self.held], RELEASED)
        of_held = V.T @ ((U.T @ beside) / sizes)
        return -units(self.nlp) * (self.variations @ np.concatenate([combination, -of_held, -of_loose]))

    def slope(self, combination: np.ndarray) -> float:
        """The slope of a combination (m,) along its steepest descent, as a fraction of its longest gradient; 0 if it cannot fall."""
        return self._part(combination, self._nearly)

    def left(self, weights: np.ndarray) -> float:
        """The projected weighted (m,) sum of gradients, as a fraction of the longest gradient: 0 at a Pareto optimum with these weights."""
        return self._part(weights, self._exactly)

    @cached_property
    def _nearly(self) -> tuple[np.ndarray, np.ndarray]:
        return self._beside(RELEASED)

    @cached_property
    def _exactly(self) -> tuple[np.ndarray, np.ndarray]:
        return self._beside(1e-6)

    def _beside(self, released: float) -> tuple[np.ndarray, np.ndarray]:
        """The gradients of the objectives (q, m) and of constraints that may be left (q, l), orthogonal to the active ones."""
        m = len(self.scales)
        U = _held(self.columns[:, m : m + self.held], released)[0]
        others = np.delete(self.columns, slice(m, m + self.held), axis=1)
        left = others - U @ (U.T @ others)
        left -= U @ (U.T @ left)
        loose = np.where(np.linalg.norm(left[:, m:], axis=0) > released, left[:, m:], 0.0)
        return left[:, :m], loose

    def _part(self, combination: np.ndarray, beside: tuple[np.ndarray, np.ndarray]) -> float:
        shares = np.abs(combination)
        # Where the gradients are next to nothing, at an optimum that nothing holds, a part of the others'.
        longest = (shares * self.free).max() + 1e-4 * shares.sum() * self.free.max()
        return float(np.linalg.norm(_on_cone(combination, beside)[0])) / (longest or 1.0)


def _on_cone(combination: np.ndarray, beside: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The remainder (q,) of a combination's gradient after projection on the cone, and the multipliers (l,) >= 0 of the projection."""
    objectives, loose = beside
    target, lengths = objectives @ combination, np.linalg.norm(loose, axis=0)
    used, multipliers = lengths > 0, np.zeros(len(lengths))
    if used.any():
        multipliers[used] = nnls(loose[:, used] / lengths[used], target, maxiter=10 * len(lengths))[0] / lengths[used]
    return target - loose @ multipliers, multipliers


def projection(nlp: NLP, z: np.ndarray, F_scales: np.ndarray | None = None) -> TangentProjection | None:
    """The projection at a feasible vector (n,), for objectives in `F_scales` (m,), see `optimality`; None where a derivative is no number,
    or no multipliers are found.

    The equations are held, and so are inequalities with a multiplier, and what bounds peaks and absolute values; other inequalities
    without slack may be left.
    """
    conditions = Conditions.of(nlp, z, F_scales)
    if conditions is None or conditions.scaled is None:
        return None
    linear, (weights, multipliers) = conditions.linear, conditions.scaled
    dF, sides, roots = linear.of_objectives, linear.of_inequalities, metric_roots(linear)
    tight = linear.slack <= TIGHT_SLACK
    bounding = tight & sides[:, np.isinf(nlp.span)].any(axis=1)
    # Where limits nearly depend on each other, multipliers are found for others nearby, too: up to a hundred times the slack.
    held = (multipliers > np.maximum(linear.slack, TIGHT_SLACK)) & (linear.slack <= 1e-4) & ~bounding
    loose = tight & ~held & ~bounding
    every = np.vstack([dF, sides[held], sides[loose]])
    try:
        # Next to no length is given to what follows from the rest.
        measure, equations = roots.T @ roots + diags(np.full(len(z), DEPENDENT)), vstack([linear.of_equations, csr_matrix(sides[bounding])])
        s, _ = steepest(measure, equations, every)
    except RuntimeError:
        return None
    return TangentProjection(nlp, linear.scales, weights, s, roots @ s, int(np.count_nonzero(held)), conditions)


def _held(columns: np.ndarray, released: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The singular vectors (q, r), values (r,) and vectors (r, k) of the active gradients, without negligible singular values."""
    U, sizes, V = np.linalg.svd(columns, full_matrices=False)
    some = sizes > released
    return U[:, some], sizes[some], V[some]


def metric_roots(linear: Linearised) -> csr_matrix:
    """Matrix (q, n) of which the product with a variation of a vector, in `units`, has the length of that variation."""
    nlp = linear.nlp
    alone = np.setdiff1d(nlp.free, [nlp.free[column] for profile in nlp.profiles for column in profile.columns])
    edges = tuple(f"{phase.name}.edge[" for phase in nlp.problem.phases)
    # The bounds of an edge are those of its neighbours.
    own = [nlp.span[one] if nlp.variables[one].name.startswith(edges) else 1.0 for one in alone]
    of_others = csr_matrix((own, (np.arange(len(alone)), alone)), shape=(len(alone), len(nlp.variables)))
    return csr_matrix(vstack([_controls(nlp, linear.z), of_others]))


def _controls(nlp: NLP, z: np.ndarray) -> csr_matrix:
    """Matrix (q, n): controls in spans at Gauss-Legendre nodes, times the root of their weight in the phase's mean, by the variables."""
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
                at = roots[elements] * (change[elements] @ basis.T) / (CONTROL_STEP * variable.span)
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
    other[moving] += CONTROL_STEP * nlp.span[moving]
    return nlp.unpack(other)
