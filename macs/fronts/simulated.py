"""Points re-evaluated by independent simulation, optionally with other problem data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import CompiledProblem, Limit, Variable
from problems.vector import CompiledVectorProblem, without_dynamics
from transcription.trajectories.limits import excess
from transcription.trajectories.simulate import simulate_all

from ..evaluation.evaluator import CONVERGED, FAILED, INFEASIBLE
from ..evaluation.reevaluated import check_same_vectors, evaluated_again
from .points import Points
from .provenance import AnyCompiled
from .verified import unmarked

if TYPE_CHECKING:
    from problems import Problem, VectorProblem
    from transcription.trajectories.trajectory import Trajectory


def simulated(
    front: Points,
    problem: Problem | VectorProblem | AnyCompiled | None,
    tolerance: float,
    rtol: float,
    atol: float,
    method: str,
) -> Points:
    """The points in the same order with simulated objectives and violations; see `Front.simulate`."""
    if not (tolerance >= 0):
        raise ValueError(f"tolerance must not be negative, not {tolerance!r}")
    stated = front.stated()
    if isinstance(stated, CompiledVectorProblem):
        other = stated if problem is None else check_same_vectors(stated, problem.compile())
        return _evaluated(front, other, tolerance)
    known = front.compiled()
    if problem is None:
        compiled = known
    else:
        given = problem.compile()
        check_alike(known, given)
        assert isinstance(given, CompiledProblem)
        compiled = given
    missing = [point for point in front if point.trajectory is None]
    if missing:
        raise ValueError(f"point {missing[0].index} has no trajectory to simulate: its status is '{missing[0].status}'")
    planned = [trajectory for trajectory in front.trajectories if trajectory is not None]
    found = simulate_all(compiled, planned, rtol=rtol, atol=atol, method=method)
    violations = [_larger(one.violations, _decided(plan, compiled)) for one, plan in zip(found, planned, strict=True)]
    F = np.array([list(one.objectives.values()) for one in found]).reshape(len(front), len(compiled.signs)) * compiled.signs
    violation = np.array([max(one.values(), default=0.0) for one in violations])
    plain = unmarked(front)
    return plain.replace(
        F=F,
        violation=violation,
        violations=violations,
        status=np.where((violation <= tolerance) & np.isfinite(F).all(axis=1), CONVERGED, INFEASIBLE),
        trajectories=[one.trajectory for one in found],
        optimality=[None] * len(front),
        costates=[None] * len(front),
        problem=compiled,
        stats={**plain.stats, "tolerance": float(tolerance)},
    )


def _evaluated(front: Points, problem: CompiledVectorProblem, tolerance: float) -> Points:
    """The points of a vector problem, evaluated again with this one."""
    F, violation, violations = evaluated_again(problem, front.decision)
    plain = unmarked(front)
    failed = ~np.isfinite(violation)
    return plain.replace(
        F=F,
        violation=violation,
        violations=violations,
        status=np.where(failed, FAILED, np.where(violation <= tolerance, CONVERGED, INFEASIBLE)),
        problem=problem,
        stats={**plain.stats, "tolerance": float(tolerance)},
    )


def _larger(one: Mapping[str, float], other: Mapping[str, float]) -> dict[str, float]:
    """The entries of both; the larger where both have one: a control may leave its bounds at the nodes, or between them."""
    return {**one, **{label: max(amount, one.get(label, 0.0)) for label, amount in other.items()}}


def _decided(planned: Trajectory, problem: CompiledProblem) -> dict[str, float]:
    """Excess, scaled, of a trajectory's times, initial states, controls at the nodes and parameters over the bounds of a problem."""
    found: dict[str, float] = {}

    def look(values: Any, limits: Sequence[Variable | Limit], where: str) -> None:
        amounts = excess(np.atleast_2d(values), limits)
        found.update({f"{where}{v.name}": float(amount) for v, amount in zip(limits, amounts, strict=True)})

    for phase in problem.phases:
        trajectory = planned[phase.name]
        duration = Limit("duration", *phase.duration, phase.tf.scale)
        look([trajectory.t0, trajectory.tf, trajectory.tf - trajectory.t0], [phase.t0, phase.tf, duration], f"bounds of {phase.name}.")
        starts = [Variable(v.name, *limits, v.unit, v.scale) for v, limits in zip(phase.states, phase.initial, strict=True)]
        look(trajectory.edge_states[0], starts, f"initial value of {phase.name}.")
        free = [k for k, v in enumerate(phase.controls) if not v.period]
        look(trajectory.controls[:, free], [phase.controls[k] for k in free], f"bounds of {phase.name}.")
    look([planned.parameters[v.name] for v in problem.parameters], problem.parameters, "bounds of ")
    return found


def check_alike(known: AnyCompiled, other: AnyCompiled) -> None:
    """Raise ValueError unless points of the known problem can be simulated, or evaluated again, with the other."""
    if isinstance(known, CompiledVectorProblem):
        check_same_vectors(known, other)
        return
    if isinstance(other, CompiledVectorProblem):
        raise ValueError(f"points of '{known.name}' cannot be simulated: {without_dynamics(other.name)}")

    def parts(problem: CompiledProblem) -> dict[str, list[str]]:
        named = {
            f"{kind} of phase '{phase.name}'": [v.name for v in variables]
            for phase in problem.phases
            for kind, variables in (("states", phase.states), ("controls", phase.controls))
        }
        phases, parameters = [phase.name for phase in problem.phases], [v.name for v in problem.parameters]
        objectives = [f"{goal.sense} {goal.name} [{goal.unit}]" for goal in problem.goals]
        return {"phases": phases, "parameters": parameters, "objectives": objectives, **named}

    ours, theirs = parts(known), parts(other)
    for what, names in ours.items():
        if theirs.get(what) != names:
            there, here = (", ".join(listed) or "none" for listed in (theirs.get(what, []), names))
            raise ValueError(f"points of '{known.name}' cannot be simulated with '{other.name}': its {what} are {there}, not {here}")
