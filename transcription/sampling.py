"""How far values leave their limits, looked at densely."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Limit, Variable

from .polynomials import lobatto_nodes
from .trajectory import PhaseTrajectory, Trajectory

DENSE = lobatto_nodes(33)
"""Where an element is looked at, on [-1, 1]."""
NEGLIGIBLE = 1e-6
"""Excursions up to this, in scales, are those of a feasible point's tolerance."""


def excess(values: np.ndarray, limits: Sequence[Variable | Limit]) -> np.ndarray:
    """The largest scaled amount by which the columns of `values` (k, c) leave their limits (c of them), shape (c,), 0 where none does."""
    lower, upper, scale = (np.array([getattr(limit, name) for limit in limits]) for name in ("lower", "upper", "scale"))
    if not len(limits):
        return np.zeros(0)
    return np.maximum(np.maximum(lower - values, values - upper) / scale, 0.0).max(axis=0, initial=0.0)


def excursions(problem: CompiledProblem, trajectory: Trajectory) -> dict[str, float]:
    """How far states, controls and path constraints leave their limits between the nodes, by the transcription's own polynomials.

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


def excess_by_element(phase: CompiledPhase, flown: PhaseTrajectory, parameters: np.ndarray) -> dict[str, np.ndarray]:
    """How far each state, control and path constraint leaves its limits on each element, by name, in its scale: arrays (N,).

    Controls that are periodic never do, and are left out.
    """
    states, controls, paths = _dense(phase.path, flown, parameters)
    bounded = [i for i, v in enumerate(phase.controls) if v.period is None]
    limits: tuple[Variable | Limit, ...] = (*phase.states, *(phase.controls[i] for i in bounded), *phase.paths)
    values = np.hstack([states, controls[:, bounded], paths]).reshape(-1, len(DENSE), len(limits))
    amounts = np.array([excess(element, limits) for element in values])
    return {limit.name: amounts[:, i] for i, limit in enumerate(limits)}


def _dense(path: object, flown: PhaseTrajectory, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    edges = flown.state.edges
    elements = range(len(edges) - 1)
    times = np.concatenate([edges[j] + 0.5 * (1.0 + DENSE) * (edges[j + 1] - edges[j]) for j in elements])
    states = np.concatenate([flown.state.on_element(j, DENSE) for j in elements])
    controls = np.concatenate([flown.controls_on(j, DENSE) for j in elements])
    s = np.concatenate([[flown.t0, flown.tf], parameters])
    paths = np.array(path(states.T, controls.T, times[None], s)).T  # type: ignore[operator]
    return states, controls, paths.reshape(len(times), -1)
