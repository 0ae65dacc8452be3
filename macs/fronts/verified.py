"""Points against an independent simulation: marked by whether it agrees (`verified`), or replaced by what it gives (`simulated`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from problems.checks import check_positive
from problems.compiled import CompiledProblem, Limit, Variable
from problems.sampling import objective_sizes, objective_spreads
from problems.vector import CompiledVectorProblem, without_dynamics
from transcription.stopping import Stopped
from transcription.trajectories.jumps import UNTRUSTED
from transcription.trajectories.limits import excess
from transcription.trajectories.simulate import Simulation, defect_of_elements, simulate, simulate_all, worst_violation
from transcription.trajectories.tables import rough_tables
from transcription.trajectories.trajectory import Trajectory, moment

from ..evaluation.blackbox import evaluated_again
from ..evaluation.evaluator import CONVERGED, FAILED, INFEASIBLE
from ..io.interrupts import spending
from ..io.text import counted
from ..io.workers import each
from ..pareto.dominance import extremes, objective_units, stated_scales, varies
from .points import Points
from .provenance import AnyCompiled

if TYPE_CHECKING:
    from problems import Problem, VectorProblem

Kind = TypeVar("Kind", bound=Points)

VERIFY = 1e-3
"""How much a point may miss by default when it is simulated, in scales."""
INTEGRATOR_SHARE = 1e-4
"""Error of the integrator, as a fraction of what a point may miss."""
MISSES, AGAIN = "simulated, ", "evaluated again, "
"""Beginnings of a note on what a point misses, of a trajectory and of a vector problem."""


class Simulations:
    """Simulations of trajectories of one problem, as exact as `verified` needs them, each made once, and alone: side by side with others it
    would take other steps, so that what a point misses would depend on these."""

    def __init__(self, problem: CompiledProblem, tolerance: float) -> None:
        self.problem, self.tolerance = problem, tolerance
        self._kept: dict[int, tuple[Trajectory, Simulation]] = {}

    def __call__(self, trajectories: Sequence[Trajectory]) -> list[Simulation]:
        """The simulation of each. See `simulate_all` for what it raises."""
        rtol, atol = accuracy(self.tolerance)
        new = list({id(one): one for one in trajectories if id(one) not in self._kept}.values())
        alone = partial(simulate, rtol=rtol, atol=atol)
        for one, simulation in zip(new, each(alone, self.problem, [(one,) for one in new]), strict=True):
            # With the trajectory: as long as it lives, no other has its identity.
            self._kept[id(one)] = one, simulation
        return [self._kept[id(one)][1] for one in trajectories]


class Independent(NamedTuple):
    """What an independent simulation, or another evaluation of a vector problem, gives for n points; NaN for those without any."""

    F: np.ndarray  # (n, m), all minimised
    defect: np.ndarray  # (n,): largest difference of a state, in spans of its bounds
    violation: np.ndarray  # (n,)
    worst: list[str]  # the constraint that each point violates most
    violations: Sequence[Mapping[str, float] | None]  # of all constraints
    diverged: dict[int, str]  # where the simulation of a point has no finite states any more
    jumps: dict[int, str]  # where rates jump, so that derivatives do not say what is optimal
    sizes: np.ndarray  # (n, m): of the terms of each objective, added up


def simulated_independently(points: Points, simulate: Callable[[list[Trajectory]], Sequence[Simulation]]) -> Independent:
    """The points as `simulate` gives them."""
    problem, (n, m) = points.compiled(), points.F.shape
    nothing = np.full(n, np.nan)
    found = Independent(np.full((n, m), np.nan), nothing, nothing.copy(), [""] * n, points.violations, {}, {}, np.zeros((n, m)))
    flown = {i: trajectory for i, trajectory in enumerate(points.trajectories) if trajectory is not None}
    with spending("simulation"):
        simulations = simulate([*flown.values()])
    for i, simulation in zip(flown, simulations, strict=True):
        found.worst[i], found.violation[i] = worst_violation(problem, simulation)
        found.defect[i], found.F[i] = simulation.max_defect, np.array(list(simulation.objectives.values())) * problem.signs
        found.sizes[i] = objective_sizes(problem, simulation.quantities, simulation.trajectory.parameters)
        if not np.isfinite(simulation.max_defect):
            found.diverged[i] = _divergence(simulation)
        if simulation.jumps:
            others = len(simulation.jumps) - 1
            found.jumps[i] = str(simulation.jumps[0]) + (f" ({counted(others, 'more jump')})" if others else "")
    return found


def _divergence(simulation: Simulation) -> str:
    """Text with the element on which the states of a simulation are no longer finite, and the largest of them before, in its span."""
    for phase in simulation.trajectory.phases:
        finite = np.isfinite(phase.states).all(axis=1)
        if not finite.all():
            edges, first = phase.state.edges, int(np.argmin(finite))
            j = int(np.clip(np.searchsorted(edges, phase.time[first], side="right") - 1, 0, len(edges) - 2))
            between = moment(f"{edges[j]:.4g} and {edges[j + 1]:.4g}", phase.time_unit)
            where = f"it diverges in phase '{phase.name}' between {between}"
            last = phase.states[max(first - 1, 0)]
            k = int((np.abs(last) / [v.span or 1.0 for v in phase.state_variables]).argmax())
            v, outside = phase.state_variables[k], excess(last[None], phase.state_variables)[k] > 0.0
            bounds = f", outside of ({v.lower:g}, {v.upper:g}), where tables may end" if outside else ""
            return f"{where}: '{v.name}' is {f'{last[k]:.3g} {v.unit}'.rstrip()} at the node before{bounds}"
    return "its objectives are not finite"


def evaluated_independently(points: Points) -> Independent:
    """The points of a vector problem, evaluated again in one batch."""
    problem = points.stated()
    assert isinstance(problem, CompiledVectorProblem)
    F, violation, violations = evaluated_again(problem, points.decision)
    return Independent(
        F,
        np.zeros(len(F)),
        violation,
        [max(one, key=lambda name: one[name], default="") for one in violations],
        violations,
        {},
        {},
        np.abs(F),
    )


def verified(
    points: Kind,
    tolerance: float | None,
    scales: np.ndarray | None = None,
    remark: bool = True,
    simulations: Callable[[list[Trajectory]], Sequence[Simulation]] | None = None,
) -> Kind:
    """The same points with the columns of a simulation, or of another evaluation, and with a note where it does not agree.

    A point is verified if its simulated states differ from those of the transcription by at most `tolerance` at the ends of elements, in
    spans of their bounds, if the simulated trajectory and its controls violate no constraint by more, in `verified_scale`, and if no
    simulated objective differs by more than its own tolerance. Where a point has none yet, it is `tolerance` times `scales` (m,), by
    default the `objective_scales` of all points. Points of a vector problem may violate as much as the search allowed; their rows are
    counted in `stats["evaluated_again"]`.
    """
    check_verify(tolerance)
    if tolerance is None or points.source is None:
        return points
    vector = points.source.vector
    try:
        if vector:
            found = evaluated_independently(points)
        else:
            found = simulated_independently(points, simulations or Simulations(points.compiled(), tolerance))
    except Stopped:
        return points
    points = points.replace(violations=found.violations, defect=found.defect, simulated_violation=found.violation, simulated_F=found.F)
    own = points.tolerances * (tolerance / points.within)[:, None]
    for known in (scales, objective_scales(points, tolerance, found.sizes)):
        own = own if known is None else np.where(np.isnan(own), tolerance * known, own)
    points = points.replace(tolerances=own, within=np.full(len(points), tolerance))
    off, agrees = missed(points), feasible_as_simulated(points, tolerance)
    agrees &= (off <= 1.0).all(axis=1)  # not of what is no number
    agrees[list(found.jumps)] = False
    allowed, notes = _allowed(points, tolerance), [_without_misses(note) for note in points.notes]
    for i in np.flatnonzero(~agrees & ~np.isnan(found.violation)):
        reasons = _misses(points, int(i), found, off[i], tolerance, allowed, remark)
        if reasons:
            notes[i] = "; ".join([*filter(None, [notes[i]]), (AGAIN if vector else MISSES) + ", ".join(reasons)])
    return points.replace(
        verified=agrees,
        notes=notes,
        stats={**points.stats, "verify": float(tolerance), **(_more_rows(points, len(points)) if vector else {})},
    )


def _allowed(points: Points, tolerance: float) -> float:
    """How much a verified point may violate constraints."""
    return tolerance if points.dynamic else max(tolerance, points.stats["tolerance"])


def _misses(points: Points, i: int, found: Independent, off: np.ndarray, tolerance: float, allowed: float, remark: bool) -> list[str]:
    """In words, what point i misses by more than the tolerance."""
    rough: list[str] = []
    if remark and (trajectory := points.trajectories[i]) is not None:
        with spending("explanation"):
            rough += [str(one) for one in rough_tables(points.compiled(), trajectory)[:1]]
    if points.dynamic and not np.isfinite(found.defect[i]):
        return [found.diverged[i], *rough]
    if not points.dynamic and not np.isfinite(found.F[i]).all():
        return ["it fails"]
    reasons = []
    if not found.defect[i] <= tolerance:
        unstable = _growing(points.compiled(), points.trajectories[i], tolerance) if remark else ""
        reasons.append(f"its states differ by {found.defect[i]:.1e} of their bounds{unstable}")
    if not found.violation[i] <= allowed:
        reasons.append(f"it violates {found.worst[i]} by {found.violation[i]:.1e}")
    if not off.max() <= 1.0:
        k = int(np.where(np.isfinite(off), off, -1.0).argmax())
        reasons.append(f"its '{points.names[k]}' differs by {abs(found.F[i, k] - points.F[i, k]):.2g} {points.goals[k].unit}".rstrip())
    return [*reasons, *rough, *([found.jumps[i]] if i in found.jumps else [])]


def feasible_as_simulated(points: Points, tolerance: float) -> np.ndarray:
    """Mask (n,) of the points that are verified but for what they say of their objectives, whose simulated values take their place."""
    numbers = np.isfinite(points.simulated_F).all(axis=1)
    return (
        (points.status == CONVERGED)
        & numbers
        & (points.defect <= tolerance if points.dynamic else True)
        & (points.simulated_violation <= _allowed(points, tolerance))
    )


def untrusted(points: Points) -> np.ndarray:
    """Mask (n,) of the points with a jump along their trajectories, which no other mesh cures."""
    return np.array([UNTRUSTED in note for note in points.notes], dtype=bool)


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
    """The same points as if they had not been simulated, but for their tolerances."""
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
    rtol = float(np.clip(INTEGRATOR_SHARE * tolerance, 1e-12, 1e-7))
    return rtol, 0.1 * rtol


def objective_scales(points: Points, tolerance: float | None = None, sizes: np.ndarray | None = None) -> np.ndarray:
    """What counts as one in each objective (m,): the `fixed_scales`, else the `objective_units`.

    The range between the best of each objective comes first, of points that are feasible when simulated, within a tolerance; then that of
    all feasible points. `sizes` (n, m) are those of terms. It is at least a small part of how much an objective varies within the bounds.
    """
    known = fixed_scales(points)
    if not np.isnan(known).any():
        return known
    terms = np.nan_to_num(np.zeros(points.F.shape) if sizes is None else sizes, posinf=0.0).max(axis=0, initial=0.0)
    found = objective_units(_judging(points, tolerance), stated_scales(points.goals), _round_off(points), terms)
    return np.where(np.isnan(known), found, known)


def fixed_scales(points: Points) -> np.ndarray:
    """What counts as one in each objective (m,) by the tolerances of points, the least if there are several; NaN where none has any."""
    return np.fmin.reduce(points.tolerances / points.within[:, None], axis=0, initial=np.nan)


def missed(points: Points) -> np.ndarray:
    """Differences (n, m) between simulated objectives and those of the points, in their tolerances."""
    return np.abs(points.simulated_F - points.F) / points.tolerances


def with_tolerances(points: Kind) -> Kind:
    """Points that were marked before points had tolerances of their own, with those of objectives for which all of them together have
    some, so that it does not matter which of them are marked again."""
    within = points.stats.get("verify", np.nan)
    fits = varies(_judging(points, within)[0]) | (stated_scales(points.goals) > 0.0)
    own = np.where(points.was_simulated[:, None] & fits, within * objective_scales(points, within), np.nan)
    return points.replace(tolerances=own, within=np.where(points.was_simulated, within, np.nan))


def constant_objectives(points: Points) -> np.ndarray:
    """Mask (m,) of the objectives that are the same at all feasible points, but for what no solver can tell apart."""
    F = _judging(points, None)[-1]
    return ~varies(F) | (np.ptp(F, axis=0) <= _round_off(points))


def _judging(points: Points, tolerance: float | None) -> list[np.ndarray]:
    """Objectives (k, m) of sets of points, best first, whose ranges say what counts as one: the best of each objective, as simulated, of
    those that are feasible so; with several objectives all of these, and all that are feasible on their meshes."""
    good = feasible_as_simulated(points, np.inf if tolerance is None else tolerance)
    feasible = (points.status == CONVERGED) & np.isfinite(points.F).all(axis=1)
    several = [F for F in (points.simulated_F[good], points.F[feasible]) if len(F)] or [np.zeros((1, len(points.goals)))]
    best = several[0][extremes(several[0])]
    return [best, *several] if len(points.goals) > 1 else [best]


def _round_off(points: Points) -> np.ndarray:
    """The smallest scale (m,) that each objective may have: a millionth of how much it varies within the bounds of the problem."""
    problem = points.problem
    return 1e-6 * objective_spreads(problem) if isinstance(problem, CompiledProblem) else np.zeros(len(points.goals))


def largest_miss(problem: CompiledProblem, simulation: Simulation, F: np.ndarray, scales: np.ndarray) -> float:
    """The largest of all that a feasible point with objectives F (m,), all minimised, misses when it is simulated; see `verified`."""
    off = np.abs(np.array(list(simulation.objectives.values())) * problem.signs - F) / scales
    return max(simulation.max_defect, worst_violation(problem, simulation)[1], float(np.where(np.isfinite(off), off, np.inf).max()))


@spending("explanation")
def _growing(problem: CompiledProblem, trajectory: Trajectory | None, tolerance: float) -> str:
    """A remark if each element by itself is right, so that small errors grow until the end: then no finer mesh can help."""
    assert trajectory is not None
    rtol, atol = accuracy(INTEGRATOR_SHARE * tolerance)
    try:
        # Of most points that are only inexact, a few elements tell.
        for most in (8, 10**9):
            own = defect_of_elements(problem, trajectory, most, rtol=rtol, atol=atol)
            if not own <= INTEGRATOR_SHARE * tolerance:
                return ""
    except Stopped:
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
    given = stated if problem is None else problem.compile()
    check_alike(stated, given)
    columns: dict[str, Any] = {}
    violations: Sequence[Mapping[str, float]]
    if isinstance(given, CompiledVectorProblem):
        F, violation, violations = evaluated_again(given, front.decision)
        otherwise = np.where(np.isfinite(violation), INFEASIBLE, FAILED)
    else:
        planned = [trajectory for trajectory in front.trajectories if trajectory is not None]
        if len(planned) < len(front):
            index = front.trajectories.index(None)
            raise ValueError(f"point {index} has no trajectory to simulate: its status is '{front[index].status}'")
        found = simulate_all(given, planned, rtol=rtol, atol=atol, method=method)
        F = np.array([list(one.objectives.values()) for one in found]).reshape(len(front), len(given.signs)) * given.signs
        violations = [_larger(one.violations, _decided(plan, given)) for one, plan in zip(found, planned, strict=True)]
        violation, otherwise = np.array([max(one.values(), default=0.0) for one in violations]), np.full(len(front), INFEASIBLE)
        columns = {"trajectories": [one.trajectory for one in found], "optimality": None, "costates": None, "weighted_gain": None}
    plain = unmarked(front)
    return plain.replace(
        F=F,
        violation=violation,
        violations=violations,
        status=np.where((violation <= tolerance) & np.isfinite(F).all(axis=1), CONVERGED, otherwise),
        problem=given,
        stats={**plain.stats, "tolerance": float(tolerance)},
        **columns,
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
    vector = isinstance(known, CompiledVectorProblem)
    place = f"points of '{known.name}' cannot be {'evaluated' if vector else 'simulated'}"
    if vector != isinstance(other, CompiledVectorProblem):
        raise ValueError(
            f"{place} with '{other.name}': that is no vector problem" if vector else f"{place}: {without_dynamics(other.name)}"
        )
    ours, theirs = _parts(known), _parts(other)
    for what, names in ours.items():
        if theirs.get(what) != names:
            there, here = (", ".join(listed) or "none" for listed in (theirs.get(what, []), names))
            raise ValueError(f"{place} with '{other.name}': its {what} are {there}, not {here}")


def _parts(problem: AnyCompiled) -> dict[str, list[str]]:
    """Names of all that two problems need to share."""
    objectives = {"objectives": [f"{goal.sense} {goal.name} [{goal.unit}]" for goal in problem.goals]}
    if isinstance(problem, CompiledVectorProblem):
        return {"variables": [v.name for v in problem.variables], **objectives}
    named = {
        f"{kind} of phase '{phase.name}'": [v.name for v in variables]
        for phase in problem.phases
        for kind, variables in (("states", phase.states), ("controls", phase.controls))
    }
    phases, parameters = [phase.name for phase in problem.phases], [v.name for v in problem.parameters]
    return {"phases": phases, "parameters": parameters, **objectives, **named}
