"""Excursions of values beyond their limits, sampled densely."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Limit, Variable
from problems.derived import remembered

from ..numerics.batched import Batched, expanded
from ..numerics.polynomials import lobatto_nodes
from .trajectory import PhaseTrajectory, Trajectory

DENSE = lobatto_nodes(33)
"""Places where an element is sampled, on [-1, 1]."""
NEGLIGIBLE = 1e-6
"""Excursions up to this, in scales, are those of a feasible point's tolerance."""


def excess(values: np.ndarray, limits: Sequence[Variable | Limit]) -> np.ndarray:
    """The largest scaled amounts by which the columns of `values` (..., k, c) leave their c limits, shape (..., c), 0 where none does."""
    lower, upper, scale = (np.array([getattr(limit, name) for limit in limits]) for name in ("lower", "upper", "scale"))
    return np.maximum(np.maximum(lower - values, values - upper) / scale, 0.0).max(axis=-2, initial=0.0)


def paths_and_peaks(
    phase: CompiledPhase, states: np.ndarray, controls: np.ndarray, times: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Path constraints (k, c) and peaks (k, p) at k places of a trajectory whose times and parameters are `s` (ns,)."""
    paths, peaks = _paths_and_peaks_function(phase)(states, controls, times, np.tile(s, (len(times), 1)))
    return paths, peaks


@remembered
def _paths_and_peaks_function(phase: CompiledPhase) -> Batched:
    inputs = [ca.MX.sym(name, phase.path.size1_in(i)) for i, name in enumerate("xuts")]
    outputs = [ca.densify(function(*inputs)) for function in (phase.path, phase.peaks)]
    return Batched(expanded(ca.Function("paths_and_peaks", inputs, outputs)))


def excursions(problem: CompiledProblem, trajectory: Trajectory) -> dict[str, float]:
    """Largest excursions of states, controls and path constraints between the nodes, by the transcription's own polynomials.

    Parameters
    ----------
    problem : CompiledProblem
    trajectory : Trajectory

    Returns
    -------
    dict
        By name ("phase.variable"), in scales of the variable; without those that stay inside.
    """
    found: dict[str, float] = {}
    parameters = np.array(list(trajectory.parameters.values()))
    for phase in problem.phases:
        for name, amounts in excess_by_element(phase, trajectory[phase.name], parameters).items():
            if amounts.max() > NEGLIGIBLE:
                found[f"{phase.name}.{name}"] = float(amounts.max())
    return found


def excess_by_element(phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray) -> dict[str, np.ndarray]:
    """Excursions of each state, control and path constraint on each element, by name, in its scale: arrays (N,).

    Controls that are periodic never do, and are left out.
    """
    times = trajectory.state.times(DENSE)
    states, controls = trajectory.state.on_elements(DENSE), trajectory.controls_on_elements(DENSE)
    x, u = (values.reshape(times.size, values.shape[2]) for values in (states, controls))
    s = np.array([trajectory.t0, trajectory.tf, *parameters])
    paths = paths_and_peaks(phase, x, u, times.ravel(), s)[0].reshape(*times.shape, len(phase.paths))
    bounded = [i for i, v in enumerate(phase.controls) if v.period is None]
    limits: tuple[Variable | Limit, ...] = (*phase.states, *(phase.controls[i] for i in bounded), *phase.paths)
    amounts = excess(np.concatenate([states, controls[..., bounded], paths], axis=2), limits)
    return {limit.name: amounts[:, i] for i, limit in enumerate(limits)}
