"""Tables of states that go up and down so often that meshes do not follow them, as tables of measured values do."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.ndimage import gaussian_filter1d

from problems.compiled import CompiledPhase, CompiledProblem, remembered
from problems.switching import called, inlined, nodes

from ..numerics.batched import Batched
from .trajectory import PhaseTrajectory, Trajectory, moment

TABLES = ("LinearInterpolant", "BSplineInterpolant")
FINE = np.linspace(-1.0, 1.0, 257)
"""Places of an element at which tables are looked at."""
MOST_TURNS = 33
"""How often a table may turn, from up to down or back, along a phase: a mesh needs about an element for each."""


@dataclass(frozen=True)
class Rough:
    """A table of a state that turns more often than a mesh can follow."""

    phase: str
    table: str
    state: str
    unit: str | None  # None where the table is of an expression of the state
    time: float  # where it turns most often
    time_unit: str
    turns: int
    grows: bool  # whether the state hardly turns itself
    width: float  # width, change: Smoothed by a Gaussian of this standard deviation, it turns seldom enough, and differs by that part
    change: float

    def __str__(self) -> str:
        of = f"'{self.state}'" if self.unit is not None else f"an expression of '{self.state}'"
        when = f"most often near {moment(f'{self.time:.4g}', self.time_unit)}"
        width = f"{self.width:.2g} of that" if self.unit is None else f"{self.width:.2g} {self.unit}".rstrip()
        other = f", or make '{self.state}' the independent variable, so that elements can end at values of the table" if self.grows else ""
        return (
            f"its mesh does not follow table '{self.table}' of {of}, which goes up and down {self.turns} times along phase '{self.phase}', "
            f"{when}: smooth it, at even places, by a Gaussian of deviation {width} (it then differs by at most "
            f"{100 * self.change:.2g} % of its range){other}"
        )


def rough_tables(problem: CompiledProblem, trajectory: Trajectory) -> list[Rough]:
    """The tables that turn more than `MOST_TURNS` times along a trajectory, between the least and the greatest of their arguments."""
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    return [one for phase in problem.phases for one in _rough(phase, trajectory[phase.name], parameters)]


def _rough(phase: CompiledPhase, trajectory: PhaseTrajectory, parameters: np.ndarray) -> list[Rough]:
    """Those of one phase."""
    names, looked = _tables(phase)
    if not names or not np.isfinite(trajectory.states).all():
        return []
    x, u, t = trajectory.state.on_elements(FINE), trajectory.controls_on_elements(FINE), trajectory.state.times(FINE)
    s = np.tile([trajectory.t0, trajectory.tf, *parameters], (t.size, 1))
    values = looked(x.reshape(t.size, -1), u.reshape(t.size, -1), t.ravel(), s)[0].reshape(*t.shape, len(names), 2)
    found = []
    for k, (name, state) in enumerate(names):
        own, arguments, variable = values[..., k, 0], values[..., k, 1], phase.states[state]
        places, first = np.unique(arguments, return_index=True)
        if len(places) < 2 or not np.isfinite(own).all():
            continue
        table = np.interp(even := np.linspace(places[0], places[-1], 4 * len(FINE) + 1), places, own.ravel()[first])
        if (turns := _turns(table)) <= MOST_TURNS:
            continue
        width = 1.0
        while _turns(smooth := gaussian_filter1d(table, width, mode="nearest")) > MOST_TURNS:
            width *= 1.2
        found.append(
            Rough(
                phase.name,
                name,
                variable.name,
                variable.unit if np.array_equal(arguments, x[..., state]) else None,
                float(t[int(np.argmax([_turns(one) for one in own])), 0]),
                phase.time_unit,
                turns,
                bool(np.abs(np.diff(x[..., state].ravel())).sum() <= 1.1 * np.ptp(x[..., state])),
                float(width * (even[1] - even[0])),
                float(np.abs(smooth - table).max() / np.ptp(table)),
            )
        )
    return found


def _turns(values: np.ndarray) -> int:
    """How often values turn from up to down or back; round-off does not count."""
    steps = np.diff(values)
    steps = steps[np.abs(steps) > 1e-6 * np.ptp(values) + 1e-9 * np.abs(values).max()]
    return int((steps[1:] * steps[:-1] < 0.0).sum())


@remembered
def _tables(phase: CompiledPhase) -> tuple[list[tuple[str, int]], Batched]:
    """Tables of one argument that is of one state alone: names and states, and a Function of their values and arguments (k, 2)."""
    one = phase.dynamics
    inputs = [ca.MX.sym(one.name_in(i), *one.size_in(i)) for i in range(one.n_in())]
    rows = [function(*inputs) for function in (phase.dynamics, phase.path, phase.integrands, phase.peaks)]
    names, found = list[tuple[str, int]](), list[ca.MX]()
    for node in nodes(inlined(ca.vertcat(*rows))):
        call = called(node)
        if call is not None and call.which_function().class_name() in TABLES and call.dep(0).numel() == node.numel() == 1:
            states = np.flatnonzero(ca.which_depends(call.dep(0), inputs[0], 1, False))
            name = call.which_function().name()
            if len(states) == 1 and (name, int(states[0])) not in names:
                names.append((name, int(states[0])))
                found += [ca.vertcat(node), call.dep(0)]
    return names, Batched(ca.Function("tables", inputs, [ca.vertcat(*found)]))
