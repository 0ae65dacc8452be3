"""Errors of a trajectory element by element, independent of the transcription, in units of the ranges of its states and controls.

The bounds of a variable may be many times as wide as its range along the trajectory. An error that is small against the bounds may be as
large as the solution.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Variable

from ..base import NLP
from ..numerics.polynomials import gauss_legendre, legendre_coefficients
from ..trajectories.limits import DENSE, Course, paths_and_peaks
from ..trajectories.simulate import Simulation
from ..trajectories.trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory

FLAT_ON_ELEMENT = 1e-4
"""A quantity that varies by less than this on an element, in scales, counts as constant: its rate of decay means nothing."""


def own_scales(low: np.ndarray, high: np.ndarray, span: np.ndarray) -> np.ndarray:
    """Units of quantities (k,) between the values `low` and `high` of a trajectory, with bounds of these spans: their ranges there, at
    least a thousandth of their size and a millionth of the span (for constant ones), and never more than the span."""
    size = np.maximum(np.abs(low), np.abs(high))
    return np.minimum(span, np.max([high - low, 1e-3 * size, 1e-6 * span], axis=0))


def _of(piece: PiecewisePolynomial, variables: Sequence[Variable]) -> np.ndarray:
    values = piece.on_elements(DENSE)
    return own_scales(values.min(axis=(0, 1)), values.max(axis=(0, 1)), np.array([v.span for v in variables]))


def state_scales(trajectory: PhaseTrajectory) -> np.ndarray:
    """The unit of each state (nx,) of a phase."""
    return _of(trajectory.state, trajectory.state_variables)


def control_scales(trajectory: PhaseTrajectory) -> np.ndarray:
    """The unit of each control (nu,) of a phase."""
    return _of(trajectory.control, trajectory.control_variables)


def objective_variations(nlp: NLP, z: np.ndarray) -> np.ndarray:
    """Changes of the objectives (m,) for random changes of a vector (n,) by parts of the ranges of its entries: the median of 31.

    This size of the objectives does not vanish where they vanish, and does not depend on the width of bounds.
    """
    ranges = np.minimum(nlp.span, _ranges(nlp, z))
    rng = np.random.default_rng(0)
    changed = np.clip(z + ranges * rng.standard_normal((31, len(z))), nlp.lower, nlp.upper)
    F, _ = nlp.evaluate(np.vstack([z, changed]))
    change = np.abs(F[1:] - F[0])
    return np.median(np.where(np.isfinite(change), change, 0.0), axis=0)


def _ranges(nlp: NLP, z: np.ndarray) -> np.ndarray:
    """The ranges (n,) of the quantities of the entries of a vector: entries of one quantity have the same name up to brackets."""
    names = np.array([re.split(r"[\[(]", v.name)[0] for v in nlp.variables])
    _, member = np.unique(names, return_inverse=True)
    low, high = np.full(member.max() + 1, np.inf), np.full(member.max() + 1, -np.inf)
    np.minimum.at(low, member, z)
    np.maximum.at(high, member, z)
    finite = np.where(np.isfinite(nlp.span), nlp.span, 1.0)
    return own_scales(low[member], high[member], finite)


@dataclass(frozen=True, eq=False)
class PhaseErrors:
    """Errors of one phase of N elements. Scales are those of `state_scales` and `control_scales`."""

    # (N,): Largest difference between the state at the end of an element and the state that an integrator reaches from its beginning with
    # its controls, in scales; infinite where the integration breaks down.
    defect: np.ndarray
    # (N,): Share of each element in the error of integrals, as a quadrature with a node more than the degree of the states would have it,
    # or in that of peaks, by which these are higher between the nodes than at any node; 0 where there is none.
    sums: np.ndarray
    excess: np.ndarray  # (N,): How far states and path constraints leave their limits between nodes, in the scales of these
    leaving: np.ndarray  # (N,): The same for controls
    # (N,): How well polynomials of this degree describe the controls: the last two Legendre coefficients, in scales. Of constant
    # controls: the larger of the jumps to the neighbours.
    tail: np.ndarray
    weight: np.ndarray  # (N,): Share of each element in what happens: in the time, or in the way of a state, whichever is larger
    # rate, control_rate: (N,): How fast Legendre coefficients of the states, and of the controls, decay: by a factor exp(-rate) with each
    # degree, at the slowest.
    rate: np.ndarray
    control_rate: np.ndarray
    # (N,): The same for integrands; 0 where a peak is higher between the nodes: there elements are to be shorter.
    integrand_rate: np.ndarray
    # (N,): Where a control is steepest or leaves a bound, in (-1, 1), if it does so much more than elsewhere on the element; else NaN.
    steep: np.ndarray


def phase_errors(problem: CompiledProblem, trajectory: Trajectory, simulated: Simulation) -> list[PhaseErrors]:
    """The errors of each phase, from the simulation of each element by itself (`simulate_elements`)."""
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    return [_errors(phase, trajectory[phase.name], simulated.trajectory[phase.name], parameters) for phase in problem.phases]


def _errors(phase: CompiledPhase, trajectory: PhaseTrajectory, simulated: PhaseTrajectory, parameters: np.ndarray) -> PhaseErrors:
    course = Course(phase, trajectory, parameters)
    excess, highest = course.largest()
    is_control = np.arange(len(phase.states), len(phase.states) + len(phase.controls))
    values, scales = trajectory.control.on_elements(DENSE), control_scales(trajectory)
    controls, states = _coefficients(trajectory)
    share, integrand_rate = _quadrature(phase, trajectory, parameters)
    peaks = _peak_shares(phase, trajectory, course.s, highest)
    defect = (np.abs(simulated.state.ends()[1] - trajectory.edge_states[1:]) / state_scales(trajectory)).max(axis=1)
    return PhaseErrors(
        defect=np.where(np.isfinite(defect), defect, np.inf),
        sums=np.maximum(share, peaks),
        excess=np.delete(excess, is_control, axis=1).max(axis=1, initial=0.0),
        leaving=excess[:, is_control].max(axis=1, initial=0.0),
        tail=_tails(controls),
        weight=_weights(trajectory),
        rate=decay_rates(states),
        control_rate=decay_rates(controls),
        integrand_rate=np.where(peaks > 0.0, 0.0, integrand_rate),
        steep=np.array([_steepest(one, phase.controls, scales) for one in values]),
    )


def _quadrature(phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares (N,) in the error of integrals, and `PhaseErrors.integrand_rate`."""
    nodes = trajectory.state.coefficients.shape[1]
    (few, _), (many, values) = (_integrals(phase, trajectory, parameters, count) for count in (nodes, 2 * nodes + 4))
    total = np.abs(many).sum(axis=0)
    error = (np.abs(few - many) / np.where(total > 0, total, 1.0)).max(axis=1, initial=0.0)
    error = np.where(np.isfinite(error), error, 0.0)
    size = np.abs(values).max(axis=(0, 1))
    rate = decay_rates(legendre_coefficients(np.nan_to_num(values / np.where(size > 0, size, 1.0))))
    return _shares(error), rate


def _peak_shares(phase: CompiledPhase, trajectory: PhaseTrajectory, s: np.ndarray, highest: np.ndarray) -> np.ndarray:
    """Shares (N,) in the error of peaks, which are `highest` (N, p)."""
    nodes = paths_and_peaks(phase, trajectory.states, trajectory.controls, trajectory.time, s)[1]
    higher = np.maximum(highest - nodes.max(axis=0), 0.0) / np.maximum(np.abs(nodes).max(axis=0), np.finfo(float).tiny)
    return _shares(np.nan_to_num(higher.max(axis=1, initial=0.0)))


def _shares(errors: np.ndarray) -> np.ndarray:
    return errors / max(errors.sum(), np.finfo(float).tiny)


def _integrals(phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray, nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Integrals (N, k) over each element by Gauss-Legendre's rule, and the integrands (N, nodes, k) there."""
    lengths = np.diff(trajectory.state.edges)
    tau, weights = gauss_legendre(nodes)
    x, u, times, s = trajectory.sampled(tau, parameters)
    values = np.array(phase.integrands(x.T, u.T, times[None], s)).reshape(-1, len(lengths), nodes)
    return (0.5 * lengths[:, None] * values @ weights).T, np.moveaxis(values, 0, 2)


def _tails(controls: np.ndarray) -> np.ndarray:
    """See `PhaseErrors.tail`, from Legendre coefficients (N, k, nu)."""
    if controls.shape[1] > 1:
        return np.abs(controls[:, 1:][:, -2:]).max(axis=(1, 2), initial=0.0)
    jumps = np.abs(np.diff(controls[:, 0], axis=0)).max(axis=1, initial=0.0)
    return np.maximum(np.append(jumps, 0.0), np.append(0.0, jumps))


def _weights(trajectory: PhaseTrajectory) -> np.ndarray:
    lengths = np.diff(trajectory.state.edges)
    ways = np.abs(np.diff(trajectory.state.on_elements(DENSE), axis=1)).sum(axis=1)
    # The way of a state that hardly moves is noise.
    ways /= np.maximum(ways.sum(axis=0), state_scales(trajectory))
    return np.maximum(lengths / max(lengths.sum(), np.finfo(float).tiny), ways.max(axis=1))


def decay_rates(coefficients: np.ndarray) -> np.ndarray:
    """Exponential rates (N,) at which Legendre coefficients (N, k, columns) decay, from the largest of the first to that of the last ones.

    The slope of a line through the logarithms of the coefficients from the second on, each taken as large as the largest one after it. The
    slowest column counts, of those that are not `FLAT_ON_ELEMENT`. Infinite where all of them are, or where there are too few to tell.
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
    return np.where(size[:, 0] > FLAT_ON_ELEMENT, found, np.inf).min(axis=1, initial=np.inf)


def _coefficients(trajectory: PhaseTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Legendre coefficients (N, k, columns) of the controls and of the states on each element, in scales."""
    found = []
    for piece, scales in ((trajectory.control, control_scales(trajectory)), (trajectory.state, state_scales(trajectory))):
        tau = gauss_legendre(piece.coefficients.shape[1])[0]
        found.append(legendre_coefficients(piece.on_elements(tau)) / scales)
    # Through stages and both ends of an element pass polynomials whose degree, by collocation, is one less: the last is always 0.
    return found[0], found[1][:, :-1] if trajectory.state.basis == "closed-legendre" else found[1]


def _steepest(values: np.ndarray, variables: Sequence[Variable], scales: np.ndarray) -> float:
    """Where, on one element, a control leaves a bound or changes three times faster than on average; else NaN. values (len(DENSE), nu)."""
    for i, v in enumerate(variables):
        if v.period is None and not np.isnan(place := _switch(values[:, i], v, scales[i])):
            return place
    if not values.size:
        return np.nan
    middle = 0.5 * (DENSE[1:] + DENSE[:-1])
    change = np.abs(np.diff(values / scales, axis=0))
    # Polynomials are steeper towards the ends, by this much (Bernstein's inequality), in any case.
    slopes = change / np.diff(DENSE)[:, None] * np.sqrt(1.0 - middle[:, None] ** 2)
    mean = change.sum(axis=0) / 2.0
    ratio = np.where(mean > FLAT_ON_ELEMENT, slopes.max(axis=0) / np.where(mean > 0, mean, 1.0), 0.0)
    column = int(np.argmax(ratio))
    return float(middle[np.argmax(slopes[:, column])]) if ratio[column] >= 3.0 else np.nan


def _switch(values: np.ndarray, bounds: Variable, scale: float) -> float:
    """The place where a control, given at `DENSE`, leaves or reaches a bound; between two bounds, half way; NaN if it does not.

    It is on a bound where it is nearer than a thousandth of the span, and only counts if it does ten times as much.
    """
    on = np.minimum(np.abs(values - bounds.lower), np.abs(values - bounds.upper)) < 1e-3 * bounds.span
    changes = 0.5 * (DENSE[1:] + DENSE[:-1])[on[1:] != on[:-1]]
    if not len(changes) or np.ptp(values) < 1e-2 * scale:
        return np.nan
    if on[0] and on[-1]:
        return float(0.5 * (changes[0] + changes[-1]))
    return float(changes[-1] if on[0] else changes[0])
