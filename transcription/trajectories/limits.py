"""Excursions of values beyond their limits, sampled densely, and closer where a limit may be exceeded between samples."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Limit, Variable, remembered

from ..numerics.batched import Batched, expanded
from ..numerics.polynomials import lobatto_nodes
from .trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory, wrapped

DENSE = lobatto_nodes(33)
"""Places where an element is sampled, on [-1, 1]."""
NEGLIGIBLE_EXCESS = 1e-6
"""Excursions up to this, in scales, are those of a feasible point's tolerance."""


def excess(values: np.ndarray, limits: Sequence[Variable | Limit]) -> np.ndarray:
    """The largest scaled amounts by which the columns of `values` (..., k, c) leave their c limits, shape (..., c), 0 where none does."""
    return np.maximum(_beyond(values, limits), 0.0).max(axis=-2, initial=0.0)


def _beyond(values: np.ndarray, limits: Sequence[Variable | Limit]) -> np.ndarray:
    """By how much the columns of `values` (..., c) are beyond their c limits, scaled: negative inside."""
    lower, upper, scale = (np.array([getattr(limit, name) for limit in limits]) for name in ("lower", "upper", "scale"))
    return np.asarray(np.maximum(lower - values, values - upper) / scale)


def paths_and_peaks(
    phase: CompiledPhase, states: np.ndarray, controls: np.ndarray, times: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Path constraints (k, c) and peaks (k, p) at k places of a trajectory whose times and parameters are `s` (ns,)."""
    paths, peaks = _paths_and_peaks_function(phase)(states, controls, times, np.tile(s, (len(times), 1)))
    return paths, peaks


def largest_on_elements(
    phase: CompiledPhase, state: PiecewisePolynomial, trajectory: PhaseTrajectory, s: np.ndarray, paths: np.ndarray, peaks: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The largest scaled excess of each path constraint (N, c), at least 0, and the largest value of each peak (N, p).

    What is narrower than the gaps between samples is found by its flanks: where the slopes beside the largest sample let something exceed a
    limit, or the phase's peak, the gaps are sampled closer. s (ns,), paths, peaks (N, len(DENSE), ...).
    """
    count = len(phase.paths)
    values = np.concatenate([_beyond(paths, phase.paths), peaks], axis=2)
    largest = values.max(axis=1)
    # Below this nothing is looked for.
    ranges = np.ptp(peaks, axis=(0, 1)) if peaks.size else np.zeros(0)
    floor = np.concatenate([np.zeros(count), largest[:, count:].max(axis=0)]) + NEGLIGIBLE_EXCESS * np.concatenate([np.ones(count), ranges])
    element, place, column = _promising(values, floor)
    left, right = DENSE[np.maximum(place - 1, 0)], DENSE[np.minimum(place + 1, len(DENSE) - 1)]
    each, count_closer = np.arange(len(element)), 17
    for _ in range(3 if len(element) else 0):  # each time about the largest value of the last
        tau = np.linspace(left, right, count_closer, axis=1)
        x, u = state.on(element, tau), wrapped(trajectory.control.on(element, tau), trajectory.control_variables)
        times = state.edges[element, None] + 0.5 * (1.0 + tau) * np.diff(state.edges)[element, None]
        found = paths_and_peaks(phase, x.reshape(tau.size, -1), u.reshape(tau.size, -1), times.ravel(), s)
        closer = np.hstack([_beyond(found[0], phase.paths), found[1]]).reshape(*tau.shape, -1)[each, :, column]
        best = closer.argmax(axis=1)
        np.maximum.at(largest, (element, column), closer[each, best])
        left, right = tau[each, np.maximum(best - 1, 0)], tau[each, np.minimum(best + 1, count_closer - 1)]
    return np.maximum(largest[:, :count], 0.0), largest[:, count:]


def _promising(values: np.ndarray, floor: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Elements, places, columns of local maxima of `values` (N, n, q) beside which, by their slopes, one above `floor` (q,) may be."""
    edge = np.full_like(values[:, :1], -np.inf)
    before, after = np.concatenate([edge, values[:, :-1]], axis=1), np.concatenate([values[:, 1:], edge], axis=1)
    gaps = np.diff(DENSE)
    with np.errstate(invalid="ignore", over="ignore"):  # of what is no number nothing is looked for: it shows by itself
        slopes = np.pad(np.abs(np.diff(values, axis=1)) / gaps[:, None], ((0, 0), (2, 2), (0, 0)))
    steepest = np.max([slopes[:, k : k + values.shape[1]] for k in range(4)], axis=0)
    reach = np.maximum(np.append(gaps, 0.0), np.insert(gaps, 0, 0.0))[:, None] * steepest
    element, place, column = np.nonzero((values >= before) & (values >= after) & (values + reach > floor))
    return element, place, column


@remembered
def _paths_and_peaks_function(phase: CompiledPhase) -> Batched:
    inputs = [ca.MX.sym(name, phase.path.size1_in(i)) for i, name in enumerate("xuts")]
    outputs = [ca.densify(function(*inputs)) for function in (phase.path, phase.peaks)]
    return Batched(expanded(ca.Function("paths_and_peaks", inputs, outputs)))


def excursions(problem: CompiledProblem, trajectory: Trajectory) -> dict[str, float]:
    """Largest excursions of states, controls and path constraints between the nodes, by the transcription's own polynomials."""
    found: dict[str, float] = {}
    parameters = np.array(list(trajectory.parameters.values()))
    for phase in problem.phases:
        for name, amounts in excess_by_element(phase, trajectory[phase.name], parameters).items():
            if amounts.max() > NEGLIGIBLE_EXCESS:
                found[f"{phase.name}.{name}"] = float(amounts.max())
    return found


def excess_by_element(phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray) -> dict[str, np.ndarray]:
    """Excursions (N,) of each state, control that is not periodic, and path constraint on each element, in scales."""
    x, u, times, s = trajectory.sampled(DENSE, parameters)
    shape = len(trajectory.state.edges) - 1, len(DENSE)
    paths = paths_and_peaks(phase, x, u, times, s)[0].reshape(*shape, len(phase.paths))
    beyond = largest_on_elements(phase, trajectory.state, trajectory, s, paths, np.empty((*shape, 0)))[0]
    states, controls = (values.reshape(*shape, values.shape[1]) for values in (x, u))
    amounts = np.hstack([excess(states, phase.states), excess(controls, phase.controls), beyond])
    limits: tuple[Variable | Limit, ...] = (*phase.states, *phase.controls, *phase.paths)
    return {limit.name: amounts[:, i] for i, limit in enumerate(limits) if getattr(limit, "period", None) is None}
