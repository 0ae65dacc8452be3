"""How far values leave their limits, looked at densely."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from problems.compiled import CompiledProblem, Limit, Variable

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
        flown = trajectory[phase.name]
        states, controls, paths = _dense(phase.path, flown, parameters)
        bounded = tuple(v for v in phase.controls if v.period is None)
        columns = [i for i, v in enumerate(phase.controls) if v.period is None]
        groups: list[tuple[np.ndarray, Sequence[Variable | Limit]]]
        groups = [(states, phase.states), (controls[:, columns], bounded), (paths, phase.paths)]
        for values, limits in groups:
            for limit, amount in zip(limits, excess(values, limits), strict=True):
                if amount > NEGLIGIBLE:
                    found[f"{phase.name}.{limit.name}"] = float(amount)
    return found


def _dense(path: object, flown: PhaseTrajectory, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    edges = flown.state.edges
    elements = range(len(edges) - 1)
    times = np.concatenate([edges[j] + 0.5 * (1.0 + DENSE) * (edges[j + 1] - edges[j]) for j in elements])
    states = np.concatenate([flown.state.on_element(j, DENSE) for j in elements])
    controls = np.concatenate([flown.controls_on(j, DENSE) for j in elements])
    s = np.concatenate([[flown.t0, flown.tf], parameters])
    paths = np.array(path(states.T, controls.T, times[None], s)).T  # type: ignore[operator]
    return states, controls, paths.reshape(len(times), -1)
