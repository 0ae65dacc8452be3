"""Errors of a trajectory element by element, independent of the transcription."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Variable

from ..numerics.polynomials import gauss_legendre, legendre_coefficients
from ..trajectories.arcs import Arcs
from ..trajectories.limits import DENSE, excess_by_element
from ..trajectories.trajectory import PhaseTrajectory, Trajectory

STEEP = 3.0
"""A control is steep where it changes so many times faster than on average over its element."""
ON_BOUND = 1e-3
"""A control is on a bound if it is nearer than this, in spans."""
FLAT = 1e-4
"""A quantity that varies by less than this on an element, in spans of its bounds, counts as constant: its rate of decay means nothing."""


@dataclass(frozen=True, eq=False)
class PhaseErrors:
    """Of one phase of N elements.

    Attributes
    ----------
    defect : array (N,)
        Largest difference between the state at the end of an element and the state that an integrator reaches from its beginning with its
        controls, in spans of the states' bounds; infinite where the integration breaks down.
    integral : array (N,)
        The same for integrals, of which the transcription has a quadrature at its nodes, in sizes of their sums over all elements.
    excess : array (N,)
        How far states and path constraints leave their limits between nodes, in their scales.
    leaving : array (N,)
        The same for controls.
    tail : array (N,)
        How well polynomials of this degree describe the controls: the last two Legendre coefficients, in spans of the controls' bounds.
    rate : array (N,)
        How fast Legendre coefficients of states and controls decay: by a factor exp(-rate) with each degree, at the slowest.
    steep : array (N,)
        Where a control is steepest or leaves a bound, in (-1, 1), if it does so much more than elsewhere on the element; else NaN.
    """

    defect: np.ndarray
    integral: np.ndarray
    excess: np.ndarray
    leaving: np.ndarray
    tail: np.ndarray
    rate: np.ndarray
    steep: np.ndarray


def phase_errors(problem: CompiledProblem, trajectory: Trajectory, *, rtol: float, atol: float) -> list[PhaseErrors]:
    """The errors of each phase.

    Parameters
    ----------
    problem : CompiledProblem
    trajectory : Trajectory
    rtol, atol
        Of the integrator; see `simulate`.
    """
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    return [_errors(phase, trajectory[phase.name], parameters, rtol, atol) for phase in problem.phases]


def _errors(phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray, rtol: float, atol: float) -> PhaseErrors:
    excess = excess_by_element(phase, trajectory, parameters)
    names = {v.name for v in phase.controls}
    values = trajectory.control.on_elements(DENSE) / np.array([v.span for v in phase.controls])
    nothing = np.zeros(len(values))
    controls, states = _coefficients(trajectory)
    defect, integral = _local_defects(phase, trajectory, parameters, rtol, atol)
    return PhaseErrors(
        defect=defect,
        integral=integral,
        excess=np.max([nothing, *(amount for name, amount in excess.items() if name not in names)], axis=0),
        leaving=np.max([nothing, *(amount for name, amount in excess.items() if name in names)], axis=0),
        tail=np.abs(controls[:, 1:][:, -2:]).max(axis=(1, 2), initial=0.0),
        rate=np.minimum(decay_rates(states), decay_rates(controls)),
        steep=np.array([_steepest(one, phase.controls) for one in values]),
    )


def _local_defects(
    phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray, rtol: float, atol: float
) -> tuple[np.ndarray, np.ndarray]:
    """See `PhaseErrors.defect` and `PhaseErrors.integral`."""
    elements, span = len(trajectory.state.coefficients), np.array([v.span for v in phase.states])
    nothing = np.zeros((elements, phase.integrands.size1_out(0)))
    tolerances = atol * np.concatenate([span, np.ones(nothing.shape[1])])
    arcs = Arcs.of(phase, [(trajectory, j, parameters) for j in range(elements)])
    reached = arcs.integrate(np.hstack([trajectory.edge_states[:-1], nothing]), rtol, tolerances, "DOP853")[:, -1]
    defect = np.abs(reached[:, : len(span)] - trajectory.edge_states[1:]) / span
    integrals = _quadrature(phase, trajectory, np.array([trajectory.t0, trajectory.tf, *parameters]))
    sizes = np.abs(integrals).sum(axis=0)
    difference = np.abs(reached[:, len(span) :] - integrals) / np.where(sizes > 0, sizes, 1.0)
    worst = np.array([defect.max(axis=1), difference.max(axis=1, initial=0.0)])
    worst[~np.isfinite(worst)] = np.inf
    return worst[0], worst[1]


def _quadrature(phase: CompiledPhase, trajectory: PhaseTrajectory, s: np.ndarray) -> np.ndarray:
    """Integrals (N, k) over each element by Gauss-Legendre's rule on as many nodes as the trajectory has inside it."""
    lengths = np.diff(trajectory.state.edges)
    tau, weights = gauss_legendre(max(1, (len(trajectory.time) - 1) // len(lengths) - 1))
    times = trajectory.state.times(tau)
    x, u = (values.reshape(times.size, -1) for values in (trajectory.state.on_elements(tau), trajectory.controls_on_elements(tau)))
    values = np.array(phase.integrands(x.T, u.T, times.reshape(1, -1), s)).reshape(-1, *times.shape)
    return (0.5 * lengths[:, None] * values @ weights).T


def decay_rates(coefficients: np.ndarray) -> np.ndarray:
    """Exponential rates (N,) at which Legendre coefficients (N, k, columns) decay, from the largest of the first to that of the last ones.

    The slope of a line through the logarithms of the coefficients from the second on, each taken as large as the largest one after it. The
    slowest column counts, of those that are not `FLAT`. Infinite where all of them are, or where there are too few to tell.
    """
    count, k, _ = coefficients.shape
    if k < 3:
        # Two coefficients are no series: nothing speaks against a higher degree.
        return np.full(count, np.inf)
    size = np.maximum.accumulate(np.abs(coefficients[:, :0:-1]), axis=1)[:, ::-1]
    if k > 3:
        # Of an even or odd function every other coefficient is 0, and so might be the last.
        size = size[:, :-1]
    degree = np.arange(size.shape[1])
    slope = degree - degree.mean()
    logarithms = np.log(np.maximum(size, 1e-14))
    found = -np.einsum("k,nkc->nc", slope, logarithms) / (slope**2).sum()
    return np.where(size[:, 0] > FLAT, found, np.inf).min(axis=1, initial=np.inf)


def _coefficients(trajectory: PhaseTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Legendre coefficients (N, k, columns) of the controls and of the states on each element, in spans of their bounds."""
    found = []
    for piece, variables in ((trajectory.control, trajectory.control_variables), (trajectory.state, trajectory.state_variables)):
        k = piece.coefficients.shape[1]
        tau = gauss_legendre(k)[0]
        found.append(legendre_coefficients(piece.on_elements(tau)) / np.array([v.span for v in variables]))
    # Through stages and both ends of an element pass polynomials whose degree, by collocation, is one less: the last is always 0.
    return found[0], found[1][:, :-1] if trajectory.state.basis == "closed-legendre" else found[1]


def _steepest(values: np.ndarray, variables: Sequence[Variable]) -> float:
    """See `PhaseErrors.steep`, on one element, from its controls (len(DENSE), nu) in spans."""
    for i, v in enumerate(variables):
        if v.period is None and not np.isnan(place := _switch(values[:, i], v.lower / v.span)):
            return place
    if not values.size:
        return np.nan
    middle = 0.5 * (DENSE[1:] + DENSE[:-1])
    change = np.abs(np.diff(values, axis=0))
    # Polynomials are steeper towards the ends, by this much (Bernstein's inequality), in any case.
    slopes = change / np.diff(DENSE)[:, None] * np.sqrt(1.0 - middle[:, None] ** 2)
    mean = change.sum(axis=0) / 2.0
    ratio = np.where(mean > FLAT, slopes.max(axis=0) / np.where(mean > 0, mean, 1.0), 0.0)
    column = int(np.argmax(ratio))
    return float(middle[np.argmax(slopes[:, column])]) if ratio[column] >= STEEP else np.nan


def _switch(values: np.ndarray, lower: float) -> float:
    """The place where a control, given at `DENSE` in spans, leaves or reaches a bound; between two bounds, half way; NaN if it does not."""
    on = np.minimum(np.abs(values - lower), np.abs(values - lower - 1.0)) < ON_BOUND
    changes = 0.5 * (DENSE[1:] + DENSE[:-1])[on[1:] != on[:-1]]
    if not len(changes) or np.ptp(values) < 10.0 * ON_BOUND:
        return np.nan
    if on[0] and on[-1]:
        return float(0.5 * (changes[0] + changes[-1]))
    return float(changes[-1] if on[0] else changes[0])
