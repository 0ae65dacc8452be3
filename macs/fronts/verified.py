"""Points against an independent simulation: marked by whether it agrees (`verified`), or replaced by what it gives (`simulated`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from problems.checks import check_positive
from problems.compiled import CompiledProblem, Limit, Variable
from problems.sampling import objective_spreads
from problems.vector import CompiledVectorProblem, without_dynamics
from transcription.stopping import Stopped
from transcription.trajectories.limits import excess
from transcription.trajectories.simulate import Simulation, simulate_all, simulate_elements, worst_violation
from transcription.trajectories.trajectory import Trajectory

from ..evaluation.blackbox import check_same_vectors, evaluated_again
from ..evaluation.evaluator import CONVERGED, FAILED, INFEASIBLE
from ..pareto.dominance import CONSTANT, objective_units, stated_scales
from .points import Points
from .provenance import AnyCompiled

if TYPE_CHECKING:
    from problems import Problem, VectorProblem

Kind = TypeVar("Kind", bound=Points)

VERIFY = 1e-3
"""How much a point may miss by default when it is simulated, in scales."""
PART = 1e-4
"""Error of the integrator, as a fraction of what a point may miss."""
COARSEST, FINEST = 1e-7, 1e-12
"""Relative tolerances of the integrator."""
NOTHING = 1e-6
"""Smallest scale of an objective, as a fraction of how much it varies within the bounds of the problem."""
MISSES, AGAIN = "simulated, ", "evaluated again, "
"""Beginnings of a note on what a point misses, of a trajectory and of a vector problem."""


class Simulations:
    """Simulations of trajectories of one problem, as exact as `verified` needs them, each made once."""

    def __init__(self, problem: CompiledProblem, tolerance: float) -> None:
        self.problem, self.tolerance = problem, tolerance
        self._kept: dict[int, tuple[Trajectory, Simulation]] = {}

    def __call__(self, trajectories: Sequence[Trajectory]) -> list[Simulation]:
        """The simulation of each; those that are missing are made side by side. See `simulate_all` for what it raises."""
        rtol, atol = accuracy(self.tolerance)
        missing = [one for one in trajectories if id(one) not in self._kept]
        for trajectory, simulation in zip(missing, simulate_all(self.problem, missing, rtol=rtol, atol=atol), strict=True):
            self.keep(trajectory, simulation)
        return [self._kept[id(one)][1] for one in trajectories]

    def keep(self, trajectory: Trajectory, simulation: Simulation) -> None:
        """Keep one that is as exact, by whomever it was made."""
        # With the trajectory: as long as it lives, no other has its identity.
        self._kept[id(trajectory)] = trajectory, simulation


def verified(
    points: Kind,
    tolerance: float | None,
    scales: np.ndarray | None = None,
    remark: bool = True,
    simulations: Simulations | None = None,
) -> Kind:
    """The same points with the columns of a simulation, and with a note where it does not agree.

    A point is verified if its simulated states differ from those of the transcription by at most `tolerance` at the ends of elements, in
    spans of their bounds, if the simulated trajectory and its controls violate no constraint by more, in `verified_scale`, and if no
    simulated objective differs by more, in `objective_scales`. scales (m,).
    """
    check_verify(tolerance)
    if tolerance is None or points.source is None:
        return points
    if points.source.vector:
        return _verified_rows(points, tolerance)
    rows = np.array([i for i, trajectory in enumerate(points.trajectories) if trajectory is not None], dtype=int)
    problem, planned = points.compiled(), [trajectory for trajectory in points.trajectories if trajectory is not None]
    try:
        made = (simulations or Simulations(problem, tolerance))(planned)
    except Stopped:
        return points
    scales = objective_scales(points) if scales is None else scales
    n, m = points.F.shape
    defect, violation, F, agrees = np.full(n, np.nan), np.full(n, np.nan), np.full((n, m), np.nan), np.zeros(n, dtype=bool)
    notes = [_without_misses(note) for note in points.notes]
    for i, trajectory, simulation in zip(rows, planned, made, strict=True):
        worst, violation[i] = worst_violation(problem, simulation)
        defect[i], F[i] = simulation.max_defect, np.array(list(simulation.objectives.values())) * problem.signs
        off = missed(simulation, points[int(i)].objectives, scales)
        agrees[i] = points.status[i] == CONVERGED and max(defect[i], violation[i], off) <= tolerance
        if not agrees[i]:
            apart = np.abs(F[i] - points.F[i])
            k = int(np.where(np.isfinite(apart), apart / scales, np.inf).argmax())
            other = "" if off <= tolerance else f"its '{points.names[k]}' differs by {apart[k]:.2g} {points.goals[k].unit}".rstrip()
            reasons = _misses(problem, trajectory, defect[i], (worst, violation[i]), other, tolerance, remark)
            notes[i] = "; ".join([*filter(None, [notes[i]]), *reasons])
    return points.replace(
        defect=defect,
        simulated_violation=violation,
        simulated_F=F,
        verified=agrees,
        notes=notes,
        stats={**points.stats, "verify": float(tolerance)},
    )


def _verified_rows(points: Kind, tolerance: float) -> Kind:
    """Points of a vector problem, marked by an evaluation of all of them again, in one batch.

    A point is verified if none of its objectives differs by more than `tolerance`, in `objective_scales`, and it violates nothing by more
    than that or what the search allowed. The rows are counted in `stats["evaluated_again"]`.
    """
    problem = points.stated()
    assert isinstance(problem, CompiledVectorProblem)
    F, violation, violations = evaluated_again(problem, points.decision)
    scales = objective_scales(points)
    apart = np.abs(F - points.F) / scales
    off = np.where(np.isfinite(apart), apart, np.inf)
    allowed = max(tolerance, points.stats["tolerance"])
    agrees = (points.status == CONVERGED) & (off <= tolerance).all(axis=1) & (violation <= allowed)
    notes = [_without_misses(note) for note in points.notes]
    for i in np.flatnonzero(~agrees):
        found = []
        if not np.isfinite(F[i]).all():
            found.append("it fails")
        elif not (off[i] <= tolerance).all():
            k = int(off[i].argmax())
            found.append(f"its '{points.names[k]}' differs by {off[i, k] * scales[k]:.2g} {points.goals[k].unit}".rstrip())
        if allowed < violation[i] < np.inf:
            worst = max(violations[i], key=lambda name: violations[i][name])
            found.append(f"it violates {worst} by {violation[i]:.1e}")
        notes[i] = "; ".join(filter(None, [notes[i], AGAIN + ", ".join(found) if found else ""]))
    return points.replace(
        violations=violations,
        defect=np.zeros(len(points)),
        simulated_violation=violation,
        simulated_F=F,
        verified=agrees,
        notes=notes,
        stats={**points.stats, "verify": float(tolerance), **_more_rows(points, len(points))},
    )


def feasible_when_simulated(points: Points, tolerance: float) -> np.ndarray:
    """Mask (n,) of the points that are verified but for what they say of their objectives, whose simulated values take their place."""
    if not points.dynamic:
        tolerance = max(tolerance, points.stats["tolerance"])
    numbers = np.isfinite(points.simulated_F).all(axis=1)
    return (points.status == CONVERGED) & numbers & (points.defect <= tolerance) & (points.simulated_violation <= tolerance)


def with_nearest(points: Kind) -> Kind:
    """Points of a vector problem; if there are none, with the constraint in the message that the least infeasible one violates most."""
    nearest = points.closest
    if len(points) or nearest is None or not np.isfinite(nearest.violation):
        return points
    problem = points.stated()
    assert isinstance(problem, CompiledVectorProblem)
    violations = evaluated_again(problem, nearest.decision[None])[2]
    closest = nearest.alone().replace(violations=violations)[0]
    name = max(violations[0], key=lambda name: violations[0][name])
    limit = next((one for one in problem.limits or () if one.name == name), Limit(name, -np.inf, 0.0))
    before = points.message.rpartition("; ")[0]
    message = f"{before}; the nearest violates {name} by {closest.violation:.2g} of its scale, {limit.scale:g} {limit.unit}".rstrip()
    return points.replace(closest=closest, message=message, stats={**points.stats, **_more_rows(points, 1)})


def _more_rows(points: Points, count: int) -> dict[str, int]:
    """The number of rows of a vector problem that were evaluated again, so many more included."""
    return {"evaluated_again": points.stats.get("evaluated_again", 0) + count}


def unmarked(points: Kind) -> Kind:
    """The same points as if they had not been simulated."""
    nothing = np.full(len(points), np.nan)
    return points.replace(
        defect=nothing,
        simulated_violation=nothing,
        simulated_F=np.full(points.F.shape, np.nan),
        verified=np.zeros(len(points), dtype=bool),
        notes=[_without_misses(note) for note in points.notes],
        stats={key: value for key, value in points.stats.items() if key != "verify"},
    )


def check_verify(tolerance: float | None) -> None:
    """Raise ValueError if what points may miss is neither None nor positive."""
    if tolerance is not None:
        check_positive("verify", tolerance)


def accuracy(tolerance: float) -> tuple[float, float]:
    """Tolerances rtol and atol of an integrator that is to detect an error of `tolerance`."""
    rtol = float(np.clip(PART * tolerance, FINEST, COARSEST))
    return rtol, 0.1 * rtol


def objective_scales(points: Points) -> np.ndarray:
    """What counts as one in each objective (m,): the scale that was stated, or the range over the feasible points; the size of one that
    hardly varies; and at least a small part of how much it varies within the bounds of the problem, if that is known."""
    F, least = _variation(points)
    return objective_units(F, stated_scales(points.goals), least)


def constant_objectives(points: Points) -> np.ndarray:
    """Mask (m,) of the objectives that are the same at all feasible points, but for what no solver can tell apart."""
    F, least = _variation(points)
    return np.ptp(F, axis=0) <= np.maximum(CONSTANT * np.abs(F).max(axis=0), least)


def _variation(points: Points) -> tuple[np.ndarray, np.ndarray]:
    """The objectives (k, m) of the feasible points, and the smallest scale (m,) that each may have."""
    good = (points.status == CONVERGED) & np.isfinite(points.F).all(axis=1)
    F = points.F[good] if good.any() else np.zeros((1, len(points.goals)))
    least = NOTHING * objective_spreads(points.problem) if isinstance(points.problem, CompiledProblem) else np.zeros(F.shape[1])
    return F, least


def missed(simulation: Simulation, objectives: Mapping[str, float], scales: np.ndarray) -> float:
    """The largest difference between a point's objectives, by name, and those of its simulation, divided by `scales` (m,)."""
    difference = np.abs([simulation.objectives[name] - value for name, value in objectives.items()])
    return float(np.where(np.isfinite(difference), difference / scales, np.inf).max())


def largest_miss(problem: CompiledProblem, simulation: Simulation, F: np.ndarray, scales: np.ndarray) -> float:
    """The largest of all that a feasible point with objectives F (m,), all minimised, misses when it is simulated; see `verified`."""
    values = {goal.name: float(value) for goal, value in zip(problem.goals, F * problem.signs, strict=True)}
    return max(simulation.max_defect, worst_violation(problem, simulation)[1], missed(simulation, values, scales))


def _misses(
    problem: CompiledProblem, trajectory: Trajectory, defect: float, worst: tuple[str, float], other: str, tolerance: float, remark: bool
) -> list[str]:
    """In words, what a point misses by more than the tolerance; `other` of its objectives."""
    label, violation = worst
    if not np.isfinite(defect):
        return [f"{MISSES}its states grow beyond all numbers, or their rates are no numbers somewhere along it"]
    found = []
    if not defect <= tolerance:
        found.append(f"its states differ by {defect:.1e} of their bounds{_growing(problem, trajectory, tolerance) if remark else ''}")
    if not violation <= tolerance:
        found.append(f"it violates {label} by {violation:.1e}")
    if other:
        found.append(other)
    return [MISSES + ", ".join(found)] if found else []


def _growing(problem: CompiledProblem, trajectory: Trajectory, tolerance: float) -> str:
    """A remark if each element by itself is right, so that small errors grow until the end: then no finer mesh can help."""
    rtol, atol = accuracy(PART * tolerance)
    try:
        own = simulate_elements(problem, trajectory, rtol=rtol, atol=atol).max_defect
    except Stopped:
        return ""
    if not own <= PART * tolerance:
        return ""
    return f", though on each element by at most {own:.0e}: the dynamics are unstable, and no simulation without feedback can follow them"


def _without_misses(note: str) -> str:
    """A note without what an earlier simulation said."""
    return "; ".join(part for part in note.split("; ") if part and not part.startswith((MISSES, AGAIN)))


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
        return _simulated_rows(front, other, tolerance)
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


def _simulated_rows(front: Points, problem: CompiledVectorProblem, tolerance: float) -> Points:
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
