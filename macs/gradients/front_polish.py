"""A front brought down to the Pareto front by gradients, on a transcription that is made for them, whoever found it on whichever."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.checks import check_count, check_positive
from problems.peaks import refuse_peaks
from transcription.base import NLP, Transcription, check_problem
from transcription.inner import Propagate
from transcription.stopping import stopped_by
from transcription.trajectories.simulate import simulate_all

from ..evaluation.bilevel import Bilevel
from ..evaluation.evaluator import CONVERGED, Counts
from ..fronts.builders import certificates, vectors_front
from ..fronts.merging import merge
from ..io.console import Told
from ..io.interrupts import Monitor
from ..pareto import archive as archives
from ..pareto.archive import Archive
from ..pareto.dominance import nondominated
from ..pareto.ranges import ranges
from .polish import Solves, polish

if TYPE_CHECKING:
    from ..front import Front
    from ..point import Point

KEPT_INSIDE = "kept inside its limits, so that it holds when it is flown"
"""What there is to say of a point that missed some."""


def polished(
    front: Front,
    transcription: Transcription,
    solves: int | None,
    limit: int | None,
    verify: float | None,
    time_limit: float | None,
    progress: bool,
) -> Front:
    """See `Front.polished`."""
    problem = front.compiled()
    check_problem(problem, transcription)
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
    nlp = transcription.nlp(problem)
    evaluator = Bilevel(nlp, Propagate(), float(front.stats["tolerance"]))
    with Told(progress) as told, Monitor(time_limit, None, None) as monitor, stopped_by(lambda: bool(monitor.reason)):
        evaluator.before_batch = lambda: told(f"polish: {evaluator.counts.gradient_solves} of at most {solves} gradient solves done")
        left = Solves(evaluator, solves)
        begun = _archive(nlp, known, evaluator.tolerance) if len(known) else _made_feasible(nlp, front.closest, left)
        if not len(begun):
            found = front[:]
            found.stats = _costs(front, evaluator.counts, monitor.elapsed, monitor.reason)
            return found
        archive = polish(begun, left, limit)
        untouched = {z.tobytes() for z in begun.Z} if len(known) else set()
        Z = archive.Z[[z.tobytes() not in untouched for z in archive.Z]]
        moved = np.zeros(len(Z), dtype=bool)
        if verify is not None:
            evaluator.before_batch = lambda: told("polish: points that miss something when flown are solved once more")
            Z, holds, moved = hold(evaluator, Z, ranges(archive.F), verify)
            Z, moved = Z[holds], moved[holds]
            known = believable(nlp.evaluate(Z)[0], known, verify)
        told(f"polish: how near to optimal {len(Z)} points are")
        certified = iter(certificates(nlp, Z[~moved], ranges(archive.F)))
        # What was moved inside is no optimum of the problem as it is stated, but the nearest that can be flown.
        optimality = [None if inside else next(certified) for inside in moved]
        taken, stopped = monitor.elapsed, monitor.reason
    stats = _costs(front, evaluator.counts, taken, stopped)
    notes = [KEPT_INSIDE if inside else "" for inside in moved]
    found = merge([vectors_front(nlp, Z, front.solver, stats, optimality=optimality, notes=notes), known])
    found = found if len(found) <= limit else found[np.flatnonzero(archives.spread(found.F, limit))]
    found.solver, found.stats = dict(front.solver), stats
    if not len(found):
        found.message = f"no point misses less than {verify:g} when it is flown"
    return found


def _archive(nlp: NLP, known: Front, tolerance: float) -> Archive:
    """Known points on this mesh. What is promised is what was found, on whichever mesh: nothing worse is to take its place."""
    starts = [nlp.interpolate(point.trajectory) for point in known if point.trajectory is not None]
    return Archive(np.array(starts), known.F, np.minimum(known.violation, tolerance))


def _made_feasible(nlp: NLP, closest: Point | None, solves: Solves) -> Archive:
    """What one solve makes of the least infeasible point: one point, or none."""
    if closest is None or closest.trajectory is None or not np.isfinite([*closest.F, closest.violation]).all():
        return Archive(np.empty((0, len(nlp.variables))), np.empty((0, len(nlp.problem.goals))), np.empty(0))
    found = solves(nlp.interpolate(closest.trajectory)[None], closest.F[None], ranges(closest.F[None])[None])
    good = found.status == CONVERGED
    return Archive(found.Z[good], found.F[good], found.violation[good])


def _costs(front: Front, counts: Counts, taken: float, stopped: str) -> dict[str, Any]:
    """The stats of a front, with what was spent beside."""
    before = front.stats
    return {
        **before,
        "gradient_solves": before["gradient_solves"] + counts.gradient_solves,
        "inner_iterations": before["inner_iterations"] + counts.inner_iterations,
        "wall_time": before["wall_time"] + taken,
        "reproducible": before["reproducible"] and not (counts.clocked or stopped),
        **({"stopped": stopped} if stopped else {}),
    }


ROUNDS = 3
"""How often a point is moved further inside, at most."""


MORE = 1.2
"""How many times what was missed it is moved: where it moves to, it may miss a little more."""


PART = 1e-4
"""Errors of the integrator are this part of what may be missed, at most."""


def hold(evaluator: Bilevel, Z: np.ndarray, ranges: np.ndarray, verify: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vectors that hold, in place of such as do not.

    Parameters
    ----------
    evaluator : Bilevel
        It makes the solves, and counts them.
    Z : array (k, D)
        Feasible vectors.
    ranges : array (m,)
        What counts as much in each objective.
    verify : float
        By how much, in their scales, constraints may be missed in flight.

    Returns
    -------
    Z : array (k, D)
    holds : array (k,) of bool
        Which do, in the end.
    moved : array (k,) of bool
        Which are not what they were.
    """
    nlp, Z = evaluator.nlp, Z.copy()
    F = nlp.evaluate(Z)[0] if len(Z) else np.empty((0, len(ranges)))
    margins = np.zeros((len(Z), len(nlp.g_scale)))
    holds, moved = np.zeros((2, len(Z)), dtype=bool)
    waiting = np.arange(len(Z))
    for _ in range(ROUNDS):
        waiting = _missing(nlp, Z, waiting, margins, holds, verify)
        if not len(waiting):
            return Z, holds, moved
        found = evaluator.refine(Z[waiting], F[waiting], np.tile(ranges, (len(waiting), 1)), margins[waiting])
        good = found.status == CONVERGED
        waiting = waiting[: len(good)][good]
        Z[waiting], moved[waiting] = found.Z[good], True
    _missing(nlp, Z, waiting, margins, holds, verify)
    return Z, holds, moved


def _missing(nlp: NLP, Z: np.ndarray, waiting: np.ndarray, margins: np.ndarray, holds: np.ndarray, verify: float) -> np.ndarray:
    """Fly the rows that are waiting: which of them miss something. Their `margins` grow by that; the others hold."""
    rtol, atol = _accuracy(verify)
    flights = simulate_all(nlp.problem, [nlp.unpack(z) for z in Z[waiting]], rtol=rtol, atol=atol)
    holds[waiting] = [flight.violation <= verify for flight in flights]
    for row, flight in zip(waiting, flights, strict=True):
        margins[row] += MORE * _by_row(flight.violations, nlp.g_labels)
    return waiting[~holds[waiting]]


def _by_row(violations: Mapping[str, float], labels: Sequence[str]) -> np.ndarray:
    """What was missed, in each row of the constraints; 0 where a row is none of a constraint that can be missed in flight."""
    missed = np.array([violations.get(label, 0.0) for label in labels])
    return np.where(np.isfinite(missed), np.maximum(missed, 0.0), 0.0)


def believable(found: np.ndarray, known: Front, verify: float) -> Front:
    """Of a front's points those that hold when flown, as far as it matters: what points `found` (k, m) dominate is not flown."""
    holds, seen = np.ones(len(known), dtype=bool), np.zeros(len(known), dtype=bool)
    while True:
        rows = np.flatnonzero(holds)
        apart = nondominated(np.vstack([found, known.F[rows]]))[len(found) :]
        look = rows[apart & ~seen[rows]]
        if not len(look):
            return known[rows]
        seen[look] = True
        rtol, atol = _accuracy(verify)
        holds[look] = known[look].simulate(tolerance=verify, rtol=rtol, atol=atol).status == CONVERGED


def _accuracy(verify: float) -> tuple[float, float]:
    """rtol and atol of an integrator that is as exact as the question whether something is missed by more than `verify`."""
    accuracy = min(PART * verify, PART)
    return accuracy, 0.1 * accuracy
