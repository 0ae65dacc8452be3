"""Extremes of states, controls, path constraints and peaks along trajectories: at samples, and between them wherever they may be."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Limit, Variable, remembered

from ..numerics.batched import Batched, expanded
from ..numerics.polynomials import lagrange_derivative, lagrange_matrix, lobatto_nodes
from .trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory, wrapped

DENSE = lobatto_nodes(33)
"""Places where an element is sampled, on [-1, 1]."""
GAPS, CLOSER = np.diff(DENSE), 17
"""Distances between them, and samples of one that is looked at closer."""
TWICE = np.concatenate([DENSE, DENSE[:-1] + 0.5 * GAPS])
"""These places and the middles of the gaps between them."""
MIDDLES, SLOPES = lagrange_matrix(DENSE, TWICE[len(DENSE) :]), lagrange_derivative(DENSE, DENSE)
"""Values in the middles, and slopes at the places, of polynomials through values at the places."""
NEGLIGIBLE_EXCESS = 1e-6
"""Excursions up to this, in scales, are those of a feasible point's tolerance."""


def excess(values: np.ndarray, limits: Sequence[Variable | Limit]) -> np.ndarray:
    """The largest scaled amounts by which the columns of `values` (..., k, c) leave their c limits, shape (..., c), 0 where none does."""
    lower, upper, scale = (np.array([getattr(limit, name) for limit in limits]) for name in ("lower", "upper", "scale"))
    return np.maximum(np.maximum(lower - values, values - upper) / scale, 0.0).max(axis=-2, initial=0.0)


def paths_and_peaks(
    phase: CompiledPhase, states: np.ndarray, controls: np.ndarray, times: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Path constraints (k, c) and peaks (k, p) at k places of a trajectory whose times and parameters are `s` (ns,)."""
    if not phase.path.numel_out() + phase.peaks.numel_out():
        return np.empty((len(times), 0)), np.empty((len(times), 0))
    paths, peaks = _paths_and_peaks_function(phase)(states, controls, times, np.tile(s, (len(times), 1)))
    return paths, peaks


class Course:
    """All that is limited along one phase of N elements, and its peaks: q columns of states, controls, path constraints and peaks.

    The states are those of the trajectory, or of other polynomials `state`; `values` (N, len(DENSE), q) are those at the samples, `between`
    (N, len(GAPS), q) in the middle of the gaps between them.
    """

    def __init__(
        self, phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray, state: PiecewisePolynomial | None = None
    ) -> None:
        self.phase, self.trajectory, self.s = phase, trajectory, np.array([trajectory.t0, trajectory.tf, *parameters])
        self.state = state = trajectory.state if state is None else state
        x, u = state.on_elements(TWICE), trajectory.controls_on_elements(TWICE)
        values = self._columns(x, u, state.times(TWICE))
        self.values, self.between = values[:, : len(DENSE)], values[:, len(DENSE) :]
        limits: tuple[Variable | Limit, ...] = (*phase.states, *phase.controls, *phase.paths)
        self.free = np.array([getattr(limit, "period", None) is not None for limit in limits])
        self.lower, self.upper, self.scale = (np.array([getattr(one, name) for one in limits]) for name in ("lower", "upper", "scale"))

    def at(self, elements: np.ndarray, tau: np.ndarray, first: int) -> np.ndarray:
        """Values (n, p, first) of the first columns on `elements` (n,) at local coordinates `tau` (n, p) of each."""
        x, u = self.state.on(elements, tau), wrapped(self.trajectory.control.on(elements, tau), self.trajectory.control_variables)
        if first <= x.shape[2] + u.shape[2]:
            return np.concatenate([x, u], axis=2)[..., :first]
        times = self.state.edges[elements, None] + 0.5 * (1.0 + tau) * np.diff(self.state.edges)[elements, None]
        return self._columns(x, u, times)[..., :first]

    def _columns(self, x: np.ndarray, u: np.ndarray, times: np.ndarray) -> np.ndarray:
        """All columns (n, p, q) at states (n, p, nx), controls (n, p, nu) and times (n, p)."""
        if not self.phase.path.size1_out(0) + self.phase.peaks.size1_out(0):
            return np.concatenate([x, u], axis=2)
        further = paths_and_peaks(self.phase, x.reshape(times.size, -1), u.reshape(times.size, -1), times.ravel(), self.s)
        return np.concatenate([x, u, *(each.reshape(*times.shape, -1) for each in further)], axis=2)

    def largest(self) -> tuple[np.ndarray, np.ndarray]:
        """The largest scaled excess of each state, control and path constraint (N, c), at least 0, and the largest value of each peak
        (N, p). Periodic controls have no limits."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):  # what is no number shows by itself
            values = self._beyond(self.values)
            largest, count = np.maximum(values.max(axis=1), self._beyond(self.between).max(axis=1)), len(self.scale)
            peaks = self.values[..., count:]
            ranges = np.maximum(np.ptp(peaks, axis=(0, 1)), NEGLIGIBLE_EXCESS * np.abs(peaks).max(axis=(0, 1)))
            # Below this nothing is looked for.
            floor = np.concatenate([np.full(count, NEGLIGIBLE_EXCESS), largest[:, count:].max(axis=0) + NEGLIGIBLE_EXCESS * ranges])
            units = np.concatenate([self.scale, ranges])
            found = np.hstack([self._rising(values, largest, np.maximum(largest, floor)), self._unresolved(units)])
        element, place, column = found[:, ~np.append(self.free, np.zeros(len(ranges), dtype=bool))[found[2]]]
        left, right = DENSE[place], DENSE[place + 1]
        for _ in range(5):  # each time about the largest value of the last
            if not len(element):
                break
            tau, each = np.linspace(left, right, CLOSER, axis=1), np.arange(len(element))
            closer = self._beyond(self.at(element, tau, 1 + column.max()))[each, :, column]
            best = closer.argmax(axis=1)
            top, beside = closer[each, best], np.array([np.maximum(best - 1, 0), np.minimum(best + 1, CLOSER - 1)])
            np.maximum.at(largest, (element, column), top)
            hope = 0.5 * (top - closer[each, beside].min(axis=0))
            kept = (top + hope > np.maximum(largest[element, column], floor[column])) & (hope > 0.01 * NEGLIGIBLE_EXCESS * units[column])
            left, right = tau[each, beside][:, kept]
            element, column = element[kept], column[kept]
        largest[:, np.flatnonzero(self.free)] = 0.0
        return np.maximum(largest[:, :count], 0.0), largest[:, count:]

    def _beyond(self, values: np.ndarray) -> np.ndarray:
        """By how much values (..., q) are beyond their limits, scaled: negative inside. Peaks are as they are."""
        count = min(len(self.scale), values.shape[2])
        limited, lower, upper = values[..., :count], self.lower[:count], self.upper[:count]
        beyond = np.maximum(lower - limited, limited - upper) / self.scale[:count]
        return np.concatenate([beyond, values[..., count:]], axis=-1)

    def _rising(self, values: np.ndarray, largest: np.ndarray, level: np.ndarray) -> np.ndarray:
        """Elements, gaps and columns (3, k) into which `values` rise from both ends so that they may be above `level` (N, q) between them.

        A cubic with the values and slopes of the ends is higher than these by 4/27 of what the slopes make of the gap at most.
        """
        scale = np.append(self.scale, np.ones(values.shape[2] - len(self.scale)))
        every = SLOPES @ self.values
        reach = 0.25 * GAPS.max() / scale * np.abs(every).max(axis=1)
        element, column = np.nonzero(largest + reach > level)
        slopes = every[element, :, column] / scale[column, None]
        limited = column < len(self.scale)
        i = column[limited]
        slopes[limited] *= np.where(2.0 * self.values[element[limited], :, i] >= (self.lower + self.upper)[i, None], 1.0, -1.0)
        rise = np.maximum(slopes[:, :-1], 0.0) + np.maximum(-slopes[:, 1:], 0.0)
        near = values[element, :, column]
        pair, gap = np.nonzero(np.maximum(near[:, :-1], near[:, 1:]) + 0.25 * GAPS * rise > level[element, column, None])
        return np.array([element[pair], gap, column[pair]])

    def _unresolved(self, units: np.ndarray) -> np.ndarray:
        """Elements, gaps and columns (3, k) about which values are not those of polynomials through the samples, in units (q,), more than
        about the next gaps."""
        # Polynomials of no higher degree are those through their samples.
        first = self.state.coefficients.shape[2]
        if self.trajectory.control.coefficients.shape[1] <= len(DENSE):
            first += self.trajectory.control.coefficients.shape[2]
        apart = np.abs(self.between[..., first:] - MIDDLES @ self.values[..., first:]) / units[first:]
        if not (apart > NEGLIGIBLE_EXCESS).any():
            return np.empty((3, 0), dtype=int)
        around = np.pad(apart, ((0, 0), (1, 1), (0, 0)))
        most = (apart > NEGLIGIBLE_EXCESS) & (apart >= around[:, :-2]) & (apart >= around[:, 2:])
        beside = np.pad(most, ((0, 0), (1, 1), (0, 0)))
        element, gap, column = np.nonzero(most | beside[:, :-2] | beside[:, 2:])
        return np.array([element, gap, column + first])


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
        amounts, _ = Course(phase, trajectory[phase.name], parameters).largest()
        limits: tuple[Variable | Limit, ...] = (*phase.states, *phase.controls, *phase.paths)
        for limit, amount in zip(limits, amounts.max(axis=0), strict=True):
            if amount > NEGLIGIBLE_EXCESS:
                found[f"{phase.name}.{limit.name}"] = float(amount)
    return found
