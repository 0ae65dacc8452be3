"""The independent check of a trajectory: its controls, flown by an integrator that knows nothing of the transcription."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from problems.compiled import CompiledPhase, CompiledProblem, Variable

from .base import expanded
from .sampling import DENSE, excess
from .trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory

METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
MOST_CALLS = 200_000
"""Evaluations of the dynamics on one element after which the integration counts as broken down."""


@dataclass(frozen=True, eq=False)
class Simulation:
    """What came of flying a trajectory's controls.

    Attributes
    ----------
    defect : mapping
        `defect[phase][state]`: largest difference from the transcription at the ends of its elements, divided by the span of the state's
        bounds; infinite where the integration broke down.
    violation : float
        Largest scaled residual of state bounds, final values, path constraints, links and constraints of the flown trajectory, looked at
        densely. Bounds of the controls between nodes are the same as in the transcription: see `Point.excursions`.
    violations : mapping
        The same by constraint.
    objectives : mapping
        Re-evaluated, by name, in the user's senses.
    trajectory : Trajectory
        What was flown.
    """

    defect: Mapping[str, Mapping[str, float]]
    violations: Mapping[str, float]
    objectives: Mapping[str, float]
    trajectory: Trajectory

    @property
    def max_defect(self) -> float:
        """The largest defect of any state of any phase."""
        return max(value for states in self.defect.values() for value in states.values())

    @property
    def violation(self) -> float:
        """See the class."""
        return max(self.violations.values(), default=0.0)


def simulate(
    problem: CompiledProblem, trajectory: Trajectory, *, rtol: float = 1e-9, atol: float = 1e-10, method: str = "DOP853"
) -> Simulation:
    """Fly a trajectory's controls, phase after phase, with an integrator of scipy.

    Each phase starts where the phases linked to it ended in this simulation; what is not linked starts where the trajectory says.

    Parameters
    ----------
    problem : CompiledProblem
    trajectory : Trajectory
    rtol, atol : float
        Of the integrator; `atol` in spans of the states' bounds.
    method : str
        Of `scipy.integrate.solve_ivp`; "Radau" or "LSODA" for stiff dynamics.

    Returns
    -------
    Simulation

    Raises
    ------
    ValueError
        For an unknown method or a tolerance that is not positive.
    """
    if method not in METHODS:
        raise ValueError(f"unknown integration method {method!r}; there are {', '.join(METHODS)}")
    if not (rtol > 0 and atol > 0):
        raise ValueError(f"rtol and atol must be positive, not {rtol!r} and {atol!r}")
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    flights: dict[int, _Flight] = {}
    violations: dict[str, float] = {}
    for i in problem.order_in_time:
        phase, planned = problem.phases[i], trajectory[problem.phases[i].name]
        start = _start(problem, i, planned, flights, violations)
        flights[i] = _fly(phase, planned, start, parameters, rtol, atol, method)
        violations |= flights[i].violations(phase)
    quantities = [flights[i].quantities for i in range(len(problem.phases))]
    objectives = np.array(problem.objectives(*quantities, parameters)).ravel() * problem.signs
    constraints = np.array(problem.constraints(*quantities, parameters)).reshape(1, -1)
    for limit, amount in zip(problem.limits, excess(constraints, problem.limits), strict=True):
        violations[f"constraint '{limit.name}'"] = _or_infinite(amount)
    return Simulation(
        defect={phase.name: flights[i].defect(phase) for i, phase in enumerate(problem.phases)},
        violations=violations,
        objectives={goal.name: float(value) for goal, value in zip(problem.goals, objectives, strict=True)},
        trajectory=Trajectory(tuple(flights[i].trajectory for i in range(len(problem.phases))), trajectory.parameters),
    )


@dataclass(frozen=True, eq=False)
class _Flight:
    """One flown phase: what was planned and what was flown, the quantities q for objectives and constraints, what its paths exceed."""

    planned: PhaseTrajectory
    trajectory: PhaseTrajectory
    quantities: np.ndarray
    path_excess: np.ndarray

    def defect(self, phase: CompiledPhase) -> dict[str, float]:
        difference = np.abs(self.trajectory.edge_states - self.planned.edge_states) / np.array([v.span for v in phase.states])
        return {v.name: _or_infinite(amount) for v, amount in zip(phase.states, difference.max(axis=0), strict=True)}

    def violations(self, phase: CompiledPhase) -> dict[str, float]:
        states = self.trajectory.states
        found = {f"bounds of {phase.name}.{v.name}": a for v, a in zip(phase.states, excess(states, phase.states), strict=True)}
        found |= {f"path '{v.name}' of '{phase.name}'": a for v, a in zip(phase.paths, self.path_excess, strict=True)}
        ends = [Variable(v.name, *limits, v.unit, v.scale) for v, limits in zip(phase.states, phase.final, strict=True)]
        for v, end, amount in zip(phase.states, ends, excess(states[-1:], ends), strict=True):
            if (end.lower, end.upper) != (v.lower, v.upper):
                found[f"final value of {phase.name}.{v.name}"] = amount
        return {label: _or_infinite(amount) for label, amount in found.items()}


def _start(
    problem: CompiledProblem, i: int, planned: PhaseTrajectory, flights: dict[int, _Flight], violations: dict[str, float]
) -> np.ndarray:
    """Initial states of phase i; a state into which several phases lead follows the first link, the others are checked."""
    start = planned.edge_states[0].copy()
    names = [v.name for v in problem.phases[i].states]
    taken: set[str] = set()
    for link in problem.links:
        if link.second != i:
            continue
        before = problem.phases[link.first]
        place = f"link from '{before.name}' to '{problem.phases[i].name}'"
        violations[f"{place}: t0"] = _or_infinite(abs(flights[link.first].planned.tf - planned.t0) / before.tf.scale)
        end = dict(zip((v.name for v in before.states), flights[link.first].trajectory.edge_states[-1], strict=True))
        for name in link.states:
            j = names.index(name)
            if name in taken:
                violations[f"{place}: {name}"] = _or_infinite(abs(end[name] - start[j]) / problem.phases[i].states[j].scale)
            else:
                start[j] = end[name]
                taken.add(name)
    return start


def _fly(
    phase: CompiledPhase, planned: PhaseTrajectory, start: np.ndarray, parameters: np.ndarray, rtol: float, atol: float, method: str
) -> _Flight:
    edges, nx = planned.state.edges, len(phase.states)
    s = np.concatenate([[planned.t0, planned.tf], parameters])
    span = np.array([v.span for v in phase.states])
    y = np.concatenate([start, np.zeros(phase.integrands.size1_out(0))])
    tolerances = atol * np.concatenate([span, np.ones(len(y) - nx)])
    elements = []
    for j in range(len(edges) - 1):
        dense = fly_element(phase, planned, j, y, s, rtol, tolerances, method)
        y = dense[-1]
        elements.append(dense[:, :nx])
    times = np.concatenate([edges[j] + 0.5 * (1.0 + DENSE) * (edges[j + 1] - edges[j]) for j in range(len(elements))])
    states = np.concatenate(elements)
    controls = np.concatenate([planned.controls_on(j, DENSE) for j in range(len(elements))])
    inputs = states.T, controls.T, times[None], s
    paths = np.array(phase.path(*inputs)).T.reshape(len(times), len(phase.paths))
    # Where a control jumps, an end of two elements has two values of a path constraint: both are checked, the second is kept.
    kept = np.append(np.arange(len(times) - 1) % len(DENSE) != len(DENSE) - 1, True)
    trajectory = replace(
        planned,
        time=times[kept],
        states=states[kept],
        controls=controls[kept],
        paths=paths[kept],
        state=PiecewisePolynomial(edges, np.array(elements), "lobatto"),
    )
    peaks = np.array(phase.peaks(*inputs)).max(axis=1, initial=-np.inf) if phase.peaks.size1_out(0) else []
    initials = np.array(phase.initials(states[0], controls[0], times[0], s)).ravel()
    finals = np.array(phase.finals(states[-1], controls[-1], times[-1], s)).ravel()
    quantities = np.concatenate([s[:2], initials, finals, y[nx:], peaks])
    return _Flight(planned, trajectory, quantities, excess(paths, phase.paths))


def fly_element(
    phase: CompiledPhase, planned: PhaseTrajectory, j: int, y: np.ndarray, s: np.ndarray, rtol: float, atol: np.ndarray, method: str
) -> np.ndarray:
    """Fly element j of a phase.

    Parameters
    ----------
    phase : CompiledPhase
    planned : PhaseTrajectory
        Whose controls are flown.
    j : int
    y : array (ny,)
        States and integrals at the beginning of the element.
    s : array
        t0, tf and the parameters.
    rtol : float
    atol : array (ny,)
    method : str
        Of `scipy.integrate.solve_ivp`.

    Returns
    -------
    array (len(DENSE), ny)
        States and integrals at the local coordinates `DENSE`; NaN if the integration breaks down.
    """
    t0, t1 = planned.state.edges[j], planned.state.edges[j + 1]
    times = t0 + 0.5 * (1.0 + DENSE) * (t1 - t0)
    times[-1] = t1
    if not (np.diff(times) > 0).all():
        # An element of no length, or of one that rounding swallows.
        return np.broadcast_to(y, (len(DENSE), len(y)))
    nowhere = np.full((len(DENSE), len(y)), np.nan)
    right_hand_side = _right_hand_side(phase, planned, j, s)
    if not (np.isfinite(y).all() and np.isfinite(right_hand_side(t0, y)).all()):
        return nowhere
    try:
        solution = solve_ivp(right_hand_side, (t0, t1), y, method=method, rtol=max(rtol, 3e-14), atol=atol, t_eval=times)
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        # The implicit methods raise where rates are no numbers; so do ours where an integrator gets nowhere.
        return nowhere
    return solution.y.T if solution.success else nowhere


def _right_hand_side(phase: CompiledPhase, planned: PhaseTrajectory, j: int, s: np.ndarray) -> Callable[[float, np.ndarray], np.ndarray]:
    """Rates of states and integrals on element j, called through buffers: some thousand calls a trajectory."""
    t0, t1 = planned.state.edges[j], planned.state.edges[j + 1]
    nx, function = len(phase.states), _rates(phase)
    calls = 0
    x, u, time, out = np.zeros(nx), np.zeros(len(phase.controls)), np.zeros(1), np.zeros(function.size1_out(0))
    arguments = x, u, time, np.array(s, dtype=float)
    buffer, trigger = function.buffer()
    for i, argument in enumerate(arguments):
        buffer.set_arg(i, memoryview(argument))  # type: ignore[arg-type,call-arg]
    buffer.set_res(0, memoryview(out))  # type: ignore[arg-type,call-arg]

    def rates(t: float, y: np.ndarray, _alive: object = (buffer, arguments)) -> np.ndarray:
        # The buffer holds bare addresses: `_alive` keeps what they point to as long as this function lives.
        nonlocal calls
        calls += 1
        if calls > MOST_CALLS:
            raise ArithmeticError("the integrator gets nowhere")
        x[:], time[0] = y[:nx], t
        u[:] = planned.controls_on(j, np.array([2.0 * (t - t0) / (t1 - t0) - 1.0]))[0]
        trigger()
        return out.copy()

    return rates


@lru_cache(maxsize=64)
def _rates(phase: CompiledPhase) -> ca.Function:
    """(x, u, t, s) -> rates of the states and of the integrals."""
    inputs = [ca.MX.sym(name, phase.dynamics.size1_in(i)) for i, name in enumerate("xuts")]
    rates = ca.vertcat(phase.dynamics(*inputs), phase.integrands(*inputs))
    return expanded(ca.Function("rates", inputs, [ca.densify(rates)]))


def _or_infinite(value: float) -> float:
    return float(value) if np.isfinite(value) else float("inf")
