"""What a front's points turn out to be when somebody flies them: as they are stated, or under other data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from problems.compiled import CompiledProblem
from transcription.simulate import simulate_all

from .dominance import nondominated
from .evaluation import CONVERGED, INFEASIBLE
from .front import Front
from .rows import frozen
from .source import Source

if TYPE_CHECKING:
    from problems import Problem


def flown(front: Front, problem: Problem | CompiledProblem | None, tolerance: float, rtol: float, atol: float, method: str) -> Front:
    """The front as flown, in the same order; see `Front.flown`."""
    if not (tolerance >= 0):
        raise ValueError(f"tolerance must not be negative, not {tolerance!r}")
    known = front.compiled()
    if problem is None:
        compiled = known
    else:
        compiled = problem if isinstance(problem, CompiledProblem) else problem.compile()
        check_alike(known, compiled)
    missing = [point.index for point in front if point.trajectory is None]
    if missing:
        raise ValueError(f"point {missing[0]} has no trajectory to fly: its status is '{front[missing[0]].status}'")
    flights = simulate_all(compiled, [p.trajectory for p in front if p.trajectory is not None], rtol=rtol, atol=atol, method=method)
    signs = compiled.signs
    F = np.array([list(flight.objectives.values()) for flight in flights]).reshape(len(front), len(signs)) * signs
    found = judged(front, F, np.array([flight.violation for flight in flights]), tolerance)
    found._violations = [dict(flight.violations) for flight in flights]
    found._trajectories = [flight.trajectory for flight in flights]
    found._problem, found.source = compiled, Source.of(compiled)
    return found


def judged(front: Front, F: np.ndarray, violation: np.ndarray, tolerance: float) -> Front:
    """The front with other objectives (n, m), all minimised, and violations (n,); a point converged if it violates nothing by more."""
    found = front[:]
    found.F, found.violation = frozen(F), frozen(violation)
    found.status = frozen(np.where((violation <= tolerance) & np.isfinite(F).all(axis=1), CONVERGED, INFEASIBLE))
    found._optimality = [None] * len(front)
    found.stats["tolerance"] = float(tolerance)
    return found


def best(front: Front) -> np.ndarray:
    """Which points (k,) converged and are not dominated by others that did, by the first objective."""
    converged = np.flatnonzero(front.status == CONVERGED)
    kept = converged[nondominated(front.F[converged])]
    return kept[np.argsort(front.objectives[kept, 0], kind="stable")]


def check_alike(known: CompiledProblem, other: CompiledProblem) -> None:
    """Raise ValueError unless what one problem decides can be flown under the other."""

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
            raise ValueError(
                f"points of '{known.name}' cannot be flown under '{other.name}': {what} are {', '.join(theirs.get(what, [])) or 'none'} "
                f"there and {', '.join(names) or 'none'} here"
            )
