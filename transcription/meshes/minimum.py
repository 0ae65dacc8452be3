"""The violation of Pontryagin's minimum principle along a trajectory: the gain that other controls would bring, on any mesh.

At an optimum, the controls minimise the Hamiltonian H = costates' rates + weighted integrands at every time. Where other values of the
controls lower it by d, using them for a time dt lowers the weighted objectives by d dt (Pontryagin et al., "The Mathematical Theory of
Optimal Processes", 1962, chapter II). If elements are too long for a control to leave its bound for a moment, the solution is a local
optimum of its mesh only, and its own multipliers show that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Limit, Variable, remembered

from ..base import NLP
from ..nlp.optimality import Multipliers, integral_weights
from ..numerics.batched import Batched, expanded
from ..numerics.polynomials import gauss_legendre
from ..trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory

TAU, WEIGHTS = gauss_legendre(24)
"""Where the Hamiltonian is looked at on each element."""
NEAR_LIMIT = 1e-3
"""Where a state, a path constraint or a peak is this near to its limit, in scales, multipliers of that are part of the principle, and
nothing is said."""


@dataclass(frozen=True, eq=False)
class OptimumMultipliers:
    """Costates of an optimum on its mesh by phase, and the multipliers of objectives (m,) and of the problem's constraints."""

    costates: Mapping[str, PiecewisePolynomial]
    of_objectives: np.ndarray
    of_constraints: np.ndarray

    @classmethod
    def of(cls, nlp: NLP, z: np.ndarray, found: Multipliers) -> OptimumMultipliers:
        """From the multipliers of an NLP at its optimum z (n,)."""
        constraints = len(nlp.problem.limits)
        return cls(nlp.costates(z, found.of_rows), found.of_objectives, found.of_rows[len(found.of_rows) - constraints :])


@dataclass(frozen=True, eq=False)
class Gain:
    """The gain of other controls in a phase."""

    # (N,): The integral, over each element, of how much less the Hamiltonian could be: what the weighted objectives could gain there, to
    # first order, in units.
    amounts: np.ndarray
    places: list[np.ndarray]  # where the controls for which it is least jump, on (-1, 1) of each element


def gains(
    problem: CompiledProblem, trajectory: Trajectory, optimum: OptimumMultipliers, quantities: Sequence[np.ndarray], units: np.ndarray
) -> dict[str, Gain]:
    """The gain of other controls in each phase with costates. units (m,)."""
    # The sum of the objectives in which a gain is one unit of each.
    total = float(optimum.of_objectives @ units)
    if not total > 0:
        return {}
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    weights = integral_weights(problem, quantities, parameters, optimum.of_objectives / total, optimum.of_constraints / total)
    found = {}
    for phase in problem.phases:
        costates, flown = optimum.costates.get(phase.name), trajectory[phase.name]
        if costates is not None and phase.controls and flown.tf > flown.t0:
            scaled = replace(costates, coefficients=costates.coefficients / total)
            found[phase.name] = _gain(phase, flown, scaled, weights[phase.name], parameters)
    return found


def _gain(
    phase: CompiledPhase, trajectory: PhaseTrajectory, costates: PiecewisePolynomial, weights: np.ndarray, parameters: np.ndarray
) -> Gain:
    """The gain of other controls in one phase, from its costates and the weights of its integrands."""
    shape = len(trajectory.state.edges) - 1, len(TAU)
    x, u, t, s = trajectory.sampled(TAU, parameters)
    adjoint = costates(t)  # they may have other pieces

    tried = np.stack([u, *_others(phase, u)], axis=1)
    k, p, _ = tried.shape
    (found,) = _comparison(phase, p)(adjoint, np.tile(weights, (k, 1)), x, tried, t, np.tile(s, (k, 1)))
    values, paths, peaks = np.split(found.reshape(k, p, -1), [1, 1 + len(phase.paths)], axis=2)
    highest = peaks[:, 0].max(axis=0)
    clear = _clear(phase, x, paths[:, 0], peaks[:, 0], highest)
    lower, upper = (np.array([getattr(limit, side) for limit in phase.paths]) for side in ("lower", "upper"))
    allowed = ((lower <= paths) & (paths <= upper)).all(axis=2) & (peaks <= highest).all(axis=2)
    less, own = (values[:, :1] - values)[:, :, 0], np.arange(k)
    less[~(allowed & (less > 0.0))] = 0.0  # or no number
    chosen = less.argmax(axis=1)
    best, least = less[own, chosen], tried[own, chosen]
    rates = np.where(clear, best, 0.0).reshape(shape)
    amounts = 0.5 * np.diff(trajectory.state.edges) * (rates @ WEIGHTS)
    jumps = np.abs(np.diff(least.reshape(*shape, -1), axis=1)) > 0.5 * np.array([v.span for v in phase.controls])
    middles = 0.5 * (TAU[1:] + TAU[:-1])
    return Gain(amounts, [middles[one] for one in np.any(jumps, axis=2)])


@remembered
def _comparison(phase: CompiledPhase, p: int) -> Batched:
    """(costates, weights, x, p controls, t, s) -> the Hamiltonian, path constraints and peaks of each control: what depends on the states
    alone is computed once."""
    x, u, t, s = phase.dynamics.mx_in()
    costates, weights, U = ca.MX.sym("l", x.numel()), ca.MX.sym("w", phase.integrands.numel_out()), ca.MX.sym("u", u.numel(), p)
    columns = []
    for given in ((x, U[:, i], t, s) for i in range(p)):
        hamiltonian = ca.dot(costates, phase.dynamics(*given)) + ca.dot(weights, phase.integrands(*given))
        columns.append(ca.densify(ca.vertcat(hamiltonian, phase.path(*given), phase.peaks(*given))))
    function = expanded(ca.Function("comparison", [costates, weights, x, U, t, s], [ca.horzcat(*columns)]))
    if function.is_a("SXFunction"):
        inputs = function.sx_in()
        function = ca.Function("comparison", inputs, [ca.cse(function(*inputs))])
    return Batched(function)


def _others(phase: CompiledPhase, u: np.ndarray) -> list[np.ndarray]:
    """Other controls (k, nu) for comparison: one changed at a time, on a grid and near its value; and all corners of a few controls."""
    lower, upper = (np.array([getattr(v, side) for v in phase.controls]) for side in ("lower", "upper"))
    found = []
    for i in range(len(lower)):
        span = upper[i] - lower[i]
        values = [np.full(len(u), value) for value in np.linspace(lower[i], upper[i], 11)]
        values += [np.clip(u[:, i] + step * span, lower[i], upper[i]) for step in (-0.05, -0.01, 0.01, 0.05)]
        for one in values:
            other = u.copy()
            other[:, i] = one
            found.append(other)
    if 1 < len(lower) <= 4:
        found += [np.tile(corner, (len(u), 1)) for corner in product(*zip(lower, upper, strict=True))]
    return found


def _clear(phase: CompiledPhase, x: np.ndarray, paths: np.ndarray, peaks: np.ndarray, highest: np.ndarray) -> np.ndarray:
    """Mask (k,) of the places at which no state, path constraint or peak is at its limit."""
    clear = np.ones(len(x), dtype=bool)
    limits: tuple[Variable | Limit, ...] = (*phase.states, *phase.paths)
    for limit, column in zip(limits, np.hstack([x, paths]).T, strict=True):
        near = NEAR_LIMIT * limit.scale
        clear &= (column - limit.lower > near) & (limit.upper - column > near)
    sizes = np.where(highest != 0, np.abs(highest), 1.0)
    return clear & (highest - peaks > NEAR_LIMIT * sizes).all(axis=1)
