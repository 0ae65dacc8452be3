"""Independent simulation of trajectories: their controls under integrators of scipy, which know nothing of the transcription."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from problems.compiled import CompiledPhase, CompiledProblem, Limit, Variable, remembered, verified_scale

from .arcs import METHODS, Arcs
from .jumps import Jump, jumps
from .limits import DENSE, Course, excess
from .trajectory import PhaseTrajectory, PiecewisePolynomial, Trajectory


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """The result of simulating a trajectory's controls.

    Attributes
    ----------
    defect : mapping
        `defect[phase][state]`: largest difference from the transcription at the ends of its elements, divided by the span of the state's
        bounds; infinite where the integration broke down. Implicit transcriptions stay bounded on elements that are far too long for an
        unstable equation, x' = a x with a large a: its simulation grows as e^(a t), beyond all numbers where a t is above 700.
    violation : float
        Largest scaled residual of bounds of states and controls, final values, path constraints, links and constraints of the simulated
        trajectory, sampled densely.
    violations : mapping
        The same by constraint.
    objectives : mapping
        Re-evaluated, by name, in the user's senses.
    trajectory : Trajectory
        The simulated one.
    quantities : tuple of arrays
        What objectives and constraints see of each phase.
    jumps : tuple of Jump
        Where rates, integrands, path constraints or peaks jump because a state or control crosses something.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> check = front[1].simulate()
    >>> check.max_defect < 1e-3 and check.violation < 1e-3
    True
    """

    defect: Mapping[str, Mapping[str, float]]
    violations: Mapping[str, float]
    objectives: Mapping[str, float]
    trajectory: Trajectory
    quantities: tuple[np.ndarray, ...]
    jumps: tuple[Jump, ...] = ()

    def __repr__(self) -> str:
        objectives = ", ".join(f"'{name}': {value:g}" for name, value in self.objectives.items())
        return f"Simulation(max_defect={self.max_defect:.1e}, violation={self.violation:.1e}, objectives={{{objectives}}})"

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
    """The simulation of a trajectory's controls by an integrator as of scipy; a linked phase starts where the one before it ended."""
    return simulate_all(problem, [trajectory], rtol=rtol, atol=atol, method=method)[0]


def simulate_all(
    problem: CompiledProblem, trajectories: Sequence[Trajectory], *, rtol: float = 1e-9, atol: float = 1e-10, method: str = "DOP853"
) -> list[Simulation]:
    """The simulations of several trajectories; see `simulate`.

    Those whose phases have as many elements and controls of the same degree are simulated side by side, which takes far less time than one
    after the other. Each is simulated within the same tolerances, but by other steps than alone, so that its last digits differ.
    """
    if method not in METHODS:
        raise ValueError(f"unknown integration method {method!r}; there are {', '.join(METHODS)}")
    if not (rtol > 0 and atol > 0):
        raise ValueError(f"rtol and atol must be positive, not {rtol!r} and {atol!r}")
    groups: dict[Hashable, list[int]] = {}
    for k, trajectory in enumerate(trajectories):
        shape = tuple((phase.control.coefficients.shape, phase.control.basis) for phase in trajectory.phases)
        groups.setdefault(shape, []).append(k)
    found: dict[int, Simulation] = {}
    for rows in groups.values():
        found |= zip(rows, _side_by_side(problem, [trajectories[k] for k in rows], rtol, atol, method), strict=True)
    return [found[k] for k in range(len(trajectories))]


def simulate_elements(problem: CompiledProblem, trajectory: Trajectory, *, rtol: float = 1e-9, atol: float = 1e-10) -> Simulation:
    """The simulation of a trajectory's controls on each element by itself, from the state that the trajectory has at its beginning.

    Errors do not grow from element to element, so that it follows dynamics too, which are so unstable that no simulation of the whole can.
    `trajectory` is discontinuous: the end of an element differs from the beginning of the next by the local error. Objectives are those of
    the planned states at the ends of phases, and of the simulated integrals and peaks. See `simulate` for the arguments.
    """
    parameters = np.array([trajectory.parameters[v.name] for v in problem.parameters])
    simulated: dict[int, _SimulatedPhase] = {}
    violations: dict[str, float] = {}
    for i in problem.order_in_time:
        phase = problem.phases[i]
        planned = trajectory[phase.name]
        nx, integrals = len(phase.states), np.zeros((len(planned.state.coefficients), phase.integrands.size1_out(0)))
        tolerances = atol * np.array([*(v.span for v in phase.states), *np.ones(integrals.shape[1])])
        arcs = Arcs.of(phase, [planned], [parameters]).alone()
        (elements,) = arcs.integrate(np.hstack([planned.edge_states[:-1], integrals]), rtol, tolerances, "DOP853")
        elements[1:, :, nx:] += np.cumsum(elements[:-1, -1:, nx:], axis=0)
        simulated[i] = _simulated_phase(phase, planned, elements, parameters)
        violations |= simulated[i].violations(phase)
    return _simulation(problem, simulated, violations, trajectory, parameters)


def defect_of_elements(problem: CompiledProblem, trajectory: Trajectory, most: int, *, rtol: float, atol: float) -> float:
    """The largest defect of elements that are simulated by themselves, as by `simulate_elements`: of at most so many in each phase."""
    parameters, found = np.array([trajectory.parameters[v.name] for v in problem.parameters]), []
    for phase in problem.phases:
        planned, nx = trajectory[phase.name], len(phase.states)
        known = planned.edge_states
        rows = np.unique(np.linspace(0, len(known) - 2, min(len(known) - 1, most)).astype(int))
        integrals, spans = np.zeros((len(rows), phase.integrands.size1_out(0))), np.array([v.span for v in phase.states])
        arcs = Arcs.of(phase, [planned], [parameters]).alone(rows)
        tolerances = atol * np.append(spans, np.ones(integrals.shape[1]))
        ends = arcs.integrate(np.hstack([known[rows], integrals]), rtol, tolerances, "DOP853")[0, :, -1, :nx]
        found.append((np.abs(ends - known[rows + 1]) / spans).max())
    return float(np.max(found))


def _side_by_side(problem: CompiledProblem, trajectories: Sequence[Trajectory], rtol: float, atol: float, method: str) -> list[Simulation]:
    """Simulations of trajectories of one shape."""
    parameters = [np.array([one.parameters[v.name] for v in problem.parameters]) for one in trajectories]
    simulated: list[dict[int, _SimulatedPhase]] = [{} for _ in trajectories]
    violations: list[dict[str, float]] = [{} for _ in trajectories]
    for i in problem.order_in_time:
        phase = problem.phases[i]
        planned = [one[phase.name] for one in trajectories]
        starts = np.array([_start(problem, i, *one) for one in zip(planned, simulated, violations, strict=True)])
        integrals = np.zeros((len(planned), phase.integrands.size1_out(0)))
        tolerances = atol * np.array([*(v.span for v in phase.states), *np.ones(integrals.shape[1])])
        elements = Arcs.of(phase, planned, parameters).integrate(np.hstack([starts, integrals]), rtol, tolerances, method)
        for k, one in enumerate(zip(planned, elements.swapaxes(0, 1), parameters, strict=True)):
            simulated[k][i] = _simulated_phase(phase, *one)
            violations[k] |= simulated[k][i].violations(phase)
    return [_simulation(problem, *one) for one in zip(simulated, violations, trajectories, parameters, strict=True)]


def _simulation(
    problem: CompiledProblem,
    simulated: Mapping[int, _SimulatedPhase],
    violations: dict[str, float],
    planned: Trajectory,
    parameters: np.ndarray,
) -> Simulation:
    """The simulation of one trajectory, from those of its phases."""
    quantities = [simulated[i].quantities for i in range(len(problem.phases))]
    objectives = np.array(problem.objectives(*quantities, parameters)).ravel() * problem.signs
    constraints = np.array(problem.constraints(*quantities, parameters)).reshape(1, -1)
    for limit, amount in zip(problem.limits, excess(constraints, problem.limits), strict=True):
        violations[f"constraint '{limit.name}'"] = _or_infinite(amount)
    return Simulation(
        defect={phase.name: simulated[i].defect(phase) for i, phase in enumerate(problem.phases)},
        violations=violations,
        objectives={goal.name: float(value) for goal, value in zip(problem.goals, objectives, strict=True)},
        trajectory=Trajectory(tuple(simulated[i].trajectory for i in range(len(problem.phases))), planned.parameters),
        quantities=tuple(quantities),
        jumps=tuple(jump for i in problem.order_in_time for jump in simulated[i].jumps),
    )


@dataclass(frozen=True, eq=False)
class _SimulatedPhase:
    """One phase as planned and as simulated, its quantities q, the excess of its states, controls and paths, and its jumps."""

    planned: PhaseTrajectory
    trajectory: PhaseTrajectory
    quantities: np.ndarray
    excess: np.ndarray
    jumps: list[Jump]

    def defect(self, phase: CompiledPhase) -> dict[str, float]:
        # At an end of two elements the trajectory has two values where each element is simulated by itself.
        both = [self.trajectory.edge_states - self.planned.edge_states, self.trajectory.state.ends()[1] - self.planned.edge_states[1:]]
        difference = np.abs(np.vstack(both)) / np.array([v.span for v in phase.states])
        return {v.name: _or_infinite(amount) for v, amount in zip(phase.states, difference.max(axis=0), strict=True)}

    def violations(self, phase: CompiledPhase) -> dict[str, float]:
        amounts = [self.excess, excess(self.trajectory.states[-1:], _ends(phase))]
        every = zip(_labelled(phase), np.concatenate(amounts), strict=True)
        return {label: _or_infinite(amount) for (label, _), amount in every if label}


def _ends(phase: CompiledPhase) -> list[Variable]:
    """The final values of the states, as variables with their limits."""
    return [replace(v, lower=low, upper=high) for v, (low, high) in zip(phase.states, phase.final, strict=True)]


def _labelled(phase: CompiledPhase) -> list[tuple[str, Variable | Limit]]:
    """What is limited in a phase, by label; empty for periodic controls and final values with the bounds of their state."""
    return [
        *((f"bounds of {phase.name}.{v.name}", v) for v in phase.states),
        *(("" if v.period else f"bounds of {phase.name}.{v.name}", v) for v in phase.controls),
        *((f"path '{limit.name}' of '{phase.name}'", limit) for limit in phase.paths),
        *(
            ("" if (end.lower, end.upper) == (v.lower, v.upper) else f"final value of {phase.name}.{v.name}", end)
            for v, end in zip(phase.states, _ends(phase), strict=True)
        ),
    ]


def worst_violation(problem: CompiledProblem, simulation: Simulation) -> tuple[str, float]:
    """The constraint that a simulated trajectory violates most where it is to be verified, and by how much, in `verified_scale`."""
    parts = _stricter(problem)
    amounts = {label: parts.get(label, 1.0) * amount for label, amount in simulation.violations.items()}
    label = max(amounts, key=lambda label: amounts[label], default="")
    return label, amounts.get(label, 0.0)


@remembered
def limits_by_label(problem: CompiledProblem) -> dict[str, Variable | Limit]:
    """What is limited in a problem, but for times and links, by its label in `Simulation.violations`."""
    limits = {label: limit for phase in problem.phases for label, limit in _labelled(phase) if label}
    return limits | {f"constraint '{limit.name}'": limit for limit in problem.limits}


@remembered
def _stricter(problem: CompiledProblem) -> dict[str, float]:
    """The scale of each constraint as a part of its `verified_scale`, by its label in `Simulation.violations`, where they differ."""
    parts = {label: limit.scale / verified_scale(limit) for label, limit in limits_by_label(problem).items()}
    return {label: part for label, part in parts.items() if part < 1.0}


def _start(
    problem: CompiledProblem, i: int, planned: PhaseTrajectory, simulated: dict[int, _SimulatedPhase], violations: dict[str, float]
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
        violations[f"{place}: t0"] = _or_infinite(abs(simulated[link.first].planned.tf - planned.t0) / before.tf.scale)
        end = dict(zip((v.name for v in before.states), simulated[link.first].trajectory.edge_states[-1], strict=True))
        for name in link.states:
            j = names.index(name)
            if name in taken:
                violations[f"{place}: {name}"] = _or_infinite(abs(end[name] - start[j]) / problem.phases[i].states[j].scale)
            else:
                start[j] = end[name]
                taken.add(name)
    return start


def _simulated_phase(phase: CompiledPhase, planned: PhaseTrajectory, elements: np.ndarray, parameters: np.ndarray) -> _SimulatedPhase:
    """A simulated phase from states and integrals (N, len(DENSE), ny) on its elements."""
    nx, nu = len(phase.states), len(phase.controls)
    state = PiecewisePolynomial(planned.state.edges, elements[:, :, :nx], "lobatto")
    course = Course(phase, planned, parameters, state)
    beyond, highest = course.largest()
    # Where a control jumps, an end of two elements has two values of a path constraint: both are checked, the second is kept.
    kept = np.append(np.arange(elements.shape[0] * len(DENSE) - 1) % len(DENSE) != len(DENSE) - 1, True)
    times, values = state.times(DENSE).ravel()[kept], course.values.reshape(len(kept), -1)[kept]
    states, controls, paths, _ = np.split(values, np.cumsum([nx, nu, len(phase.paths)]), axis=1)
    trajectory = replace(planned, time=times, states=states, controls=controls, paths=paths, state=state)
    initials = np.array(phase.initials(states[0], controls[0], times[0], course.s)).ravel()
    finals = np.array(phase.finals(states[-1], controls[-1], times[-1], course.s)).ravel()
    quantities = np.concatenate([course.s[:2], initials, finals, elements[-1, -1, nx:], highest.max(axis=0)])
    return _SimulatedPhase(planned, trajectory, quantities, beyond.max(axis=0), jumps(phase, course))


def _or_infinite(value: float) -> float:
    return float(value) if np.isfinite(value) else float("inf")
