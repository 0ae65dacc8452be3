"""Gradient polish of a finished front on another transcription, with back-off until its points are feasible when simulated.

A search needs a transcription whose candidates are evaluated quickly, gradient solves need a sparse one. A point that exceeds a limit
between its nodes is solved again with that limit tightened by the excess. A finer mesh would help too, at many times the cost; and where
the excess is small, so is the loss in the objectives. This tightening of constraints by their known excess is called back-off: Figueroa,
Bahri, Bandoni and Romagnoli, "Economic impact of disturbances and uncertain parameters in chemical processes - a dynamic back-off
analysis", Computers and Chemical Engineering 20(4), 1996.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from problems.checks import check_count, check_positive
from problems.sampling import refuse_peaks
from transcription.base import NLP, Transcription, check_problem
from transcription.inner import Propagate
from transcription.stopping import Stopped
from transcription.trajectories.simulate import simulate_all

from ..evaluation.bilevel import Bilevel
from ..evaluation.evaluator import CONVERGED, Counts
from ..fronts.builders import certified, from_vectors, merge
from ..fronts.point import Point
from ..fronts.points import Points
from ..fronts.provenance import more_costs
from ..fronts.verified import simulated, unmarked
from ..io.console import working
from ..pareto.archive import Archive
from ..pareto.dominance import ranges
from ..pareto.spread import Guide, spread
from .polish import BudgetedSolves, polish

KEPT_INSIDE = "kept inside its limits, so that it is feasible when simulated"
"""Note of a point that was solved with tightened limits."""


def polished(
    front: Points,
    transcription: Transcription,
    solves: int | None,
    limit: int | None,
    verify: float | None,
    time_limit: float | None,
    progress: bool | None,
    guide: Guide | None = None,
) -> Points:
    """The polished points; see `Front.polished`. A guide sets their density along the front."""
    problem = front.compiled()
    check_problem(problem, transcription)
    # Compared with new points by the objectives on their meshes: no new point has been simulated yet.
    front = unmarked(front)
    known = front[[point.index for point in front if point.status == CONVERGED and point.trajectory is not None]]
    count = max(len(known), 1)
    solves, limit = count if solves is None else solves, count if limit is None else limit
    check_count("solves", solves, 0)
    check_count("limit", limit, min(len(front.goals), count))
    if verify is not None:
        check_positive("verify", verify)
    if time_limit is not None:
        check_positive("time_limit", time_limit)
    refuse_peaks(problem)
    with working(time_limit, progress) as (show, interrupts):
        try:
            nlp = transcription.nlp(problem)
        except Stopped as reason:
            return front.replace(stats=more_costs(front.stats, Counts(), interrupts.elapsed, str(reason)))
        evaluator = Bilevel(nlp, Propagate(), float(front.stats["tolerance"]))
        evaluator.before_batch = lambda: show(f"polish: {evaluator.counts.gradient_solves} of at most {solves} gradient solves done")
        left = BudgetedSolves(evaluator, solves)
        begun = _archive(nlp, known, evaluator.tolerance) if len(known) else _made_feasible(nlp, front.closest, left)
        if not len(begun):
            return front.replace(stats=more_costs(front.stats, evaluator.counts, interrupts.elapsed, interrupts.reason))
        archive = polish(begun, left, limit, guide=guide)
        evaluator.counts.kept_for += left.results.kept_for
        untouched = {z.tobytes() for z in begun.Z} if len(known) else set()
        Z = archive.Z[[z.tobytes() not in untouched for z in archive.Z]]
        moved, unseen = np.zeros(len(Z), dtype=bool), 0
        if verify is not None:
            evaluator.before_batch = lambda: show("polish: points that are infeasible when simulated are solved again")
            Z, feasible, moved = back_off(evaluator, Z, ranges(archive.F), verify)
            Z, moved = Z[feasible], moved[feasible]
            try:
                known = known[simulated(known, None, verify, *_accuracy(verify), "DOP853").status == CONVERGED]
            except Stopped:
                unseen = len(known)
        show(f"polish: optimality of {len(Z)} points")
        # A point that was moved inside its limits is no optimum of the problem as stated: it has no certificate.
        columns = {name: iter(values) for name, values in certified(nlp, Z[~moved], ranges(archive.F)).items()}
        found_of = {name: [None if inside else next(values) for inside in moved] for name, values in columns.items()}
        elapsed, stopped = interrupts.elapsed, interrupts.reason
    stats = more_costs(front.stats, evaluator.counts, elapsed, stopped)
    notes = [KEPT_INSIDE if inside else "" for inside in moved]
    found = merge([from_vectors(nlp, Z, front.solver, stats, **found_of, notes=notes), known])
    found = found if len(found) <= limit else found[np.flatnonzero(spread(found.F, limit, guide=guide))]
    message = found.message if len(found) else f"no point violates less than {verify:g} when simulated"
    message = f"{stopped}: {unseen} points of the front before were not simulated" if unseen else message
    return found.replace(solver=dict(front.solver), stats=stats, message=message)


def _archive(nlp: NLP, known: Points, tolerance: float) -> Archive:
    """The known points interpolated to this mesh, with the objectives of their own meshes, which polished points must not exceed."""
    starts = [nlp.interpolate(point.trajectory) for point in known if point.trajectory is not None]
    return Archive(np.array(starts), known.F, np.minimum(known.violation, tolerance))


def _made_feasible(nlp: NLP, closest: Point | None, solves: BudgetedSolves) -> Archive:
    """An archive of one point, by a solve from the least infeasible point; empty if that fails."""
    if closest is None or closest.trajectory is None or not np.isfinite([*closest.F, closest.violation]).all():
        return Archive(np.empty((0, len(nlp.variables))), np.empty((0, len(nlp.problem.goals))), np.empty(0))
    found = solves(nlp.interpolate(closest.trajectory)[None], closest.F[None], ranges(closest.F[None])[None])
    return Archive.of(found, found.status == CONVERGED)


@dataclass(frozen=True)
class BackOffLimits:
    """How limits are tightened."""

    rounds: int = 3  # most times that a point is solved with tightened limits
    more: float = 1.2  # limits are tightened by so many times the excess, which may be a little larger at the new point
    integrator: float = 1e-4  # its largest error, as a fraction of the excess that is allowed


BACK_OFF = BackOffLimits()


def back_off(evaluator: Bilevel, Z: np.ndarray, ranges: np.ndarray, verify: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vectors Z (k, D), re-solved with tightened limits where they are infeasible when simulated; and masks (k,) of the feasible and of the
    moved ones. ranges (m,)."""
    nlp, Z = evaluator.nlp, Z.copy()
    F = nlp.evaluate(Z)[0] if len(Z) else np.empty((0, len(ranges)))
    margins = np.zeros((len(Z), len(nlp.g_scale)))
    feasible, moved = np.zeros((2, len(Z)), dtype=bool)
    waiting = np.arange(len(Z))
    # What was solved again, but not simulated when the work is to end, does not count as feasible.
    with suppress(Stopped):
        for _ in range(BACK_OFF.rounds):
            waiting = _infeasible(nlp, Z, waiting, margins, feasible, verify)
            if not len(waiting):
                break
            found = evaluator.descend(Z[waiting], F[waiting], np.tile(ranges, (len(waiting), 1)), margins[waiting])
            good = found.status == CONVERGED
            waiting = waiting[: len(good)][good]
            Z[waiting], moved[waiting] = found.Z[good], True
        else:
            _infeasible(nlp, Z, waiting, margins, feasible, verify)
    return Z, feasible, moved


def _infeasible(nlp: NLP, Z: np.ndarray, waiting: np.ndarray, margins: np.ndarray, feasible: np.ndarray, verify: float) -> np.ndarray:
    """The rows of `waiting` that are infeasible when simulated; increases their `margins` by the excess and updates `feasible`."""
    rtol, atol = _accuracy(verify)
    simulations = simulate_all(nlp.problem, [nlp.unpack(z) for z in Z[waiting]], rtol=rtol, atol=atol)
    feasible[waiting] = [simulation.violation <= verify for simulation in simulations]
    for row, simulation in zip(waiting, simulations, strict=True):
        margins[row] += BACK_OFF.more * _by_row(simulation.violations, nlp.g_labels)
    return waiting[~feasible[waiting]]


def _by_row(violations: Mapping[str, float], labels: Sequence[str]) -> np.ndarray:
    """Excess (r,) in each row of the constraints; 0 for a constraint that a simulation does not evaluate."""
    excess = np.array([violations.get(label, 0.0) for label in labels])
    return np.where(np.isfinite(excess), np.maximum(excess, 0.0), 0.0)


def _accuracy(verify: float) -> tuple[float, float]:
    """Tolerances rtol and atol of the integrator, fine enough to detect an excess of `verify`."""
    accuracy = BACK_OFF.integrator * min(verify, 1.0)
    return accuracy, 0.1 * accuracy
