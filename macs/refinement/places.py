"""Any point of a front: solved from the points around its place, certified and simulated like all others."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from problems.checks import check_count, check_interval
from problems.sampling import refuse_peaks
from transcription import from_dict
from transcription.base import NLP, Transcription
from transcription.nlp.derivatives import refuse_dense
from transcription.nlp.optimality import Multipliers
from transcription.nlp.scalarized import Solved
from transcription.stopping import Stopped, stopping
from transcription.trajectories.trajectory import Trajectory

from ..evaluation.evaluator import CONVERGED, Counts
from ..fronts.builders import best_rows, certified, from_vectors
from ..fronts.curve import curve_of
from ..fronts.points import Points
from ..fronts.provenance import costs, more_costs
from ..fronts.verified import VERIFY, objective_scales, verified
from ..gradients.ends import check_points, tasks_between
from ..gradients.predictor import Neighbour, coordinates, in_units, multipliers_at, predicted, shares
from ..gradients.scalarised import GradientSolves, Scalarised, Start, best_of, strongly_optimal
from ..io.console import working
from ..io.interrupts import work_on_trajectories
from ..io.text import counted
from ..io.workers import TOGETHER, Workers, each
from ..pareto.directions import LATTICE_SIZE
from ..pareto.dominance import BETTER, extremes, ranges, separate
from ..preferences.ranges import confidence, named_numbers, named_weights, places, shown
from .mending import resolve_unverified
from .mesh_loop import Programs, latest_programs

log = logging.getLogger(__name__)


def point_at(front: Points, goals: Mapping[str, float] | None, weights: Mapping[str, float] | None) -> Points:
    """The point with given goals, or of the least weighted sum; see `Front.at`."""
    if (goals is None) == (weights is None):
        raise ValueError("say where: goals such as {'flight time': 150.0}, or weights={'flight time': 1.0, 'speed': 2.0}")
    if weights is not None:
        shares = np.nan_to_num(_values(front, named_weights(weights)))
        return found_alone(front, lambda known: known.least_sum(shares))
    limits = _values(front, named_numbers(goals, "goals"))
    if not np.isnan(limits).any():
        raise ValueError(f"goals for all of {', '.join(front.names)} leave nothing to be best: nearest(...) takes such a reference")
    return found_alone(front, lambda known: known.within(limits * front.signs))


def nearest_point(front: Points, reference: Mapping[str, float]) -> Points:
    """The point nearest to a reference; see `Front.nearest`."""
    values = _values(front, named_numbers(reference, "reference"))
    if np.isnan(values).any():
        missing = front.names[int(np.isnan(values).argmax())]
        raise ValueError(f"a reference has a value for each objective, and there is none for '{missing}': at(...) takes goals for some")
    return achieved(front, values * front.signs)


def achieved(front: Points, reference: np.ndarray, widths: np.ndarray | None = None) -> Points:
    """The point nearest to a reference (m,) along widths (m,), by default the ranges of the front."""
    return found_alone(front, lambda known: known.nearest(reference, known.units if widths is None else widths))


def _values(front: Points, given: Mapping[str, float]) -> np.ndarray:
    """Values by name (m,); no numbers for objectives without one."""
    places(given, front.goals)
    return np.array([given.get(name, np.nan) for name in front.names])


def found_alone(front: Points, solve: Callable[[KnownPoints], KnownPoint]) -> Points:
    """One point of a front, by one solve or a few."""
    known = KnownPoints(front)
    with work_on_trajectories():
        return known.found([solve(known)])


def dense_front(front: Points, n: int, time_limit: float | None, progress: bool | None, workers: Workers | None) -> Points:
    """So many points all along the front; see `Front.dense`."""
    check_count("n", n, 2)
    check_points(n, len(front.goals))
    known = KnownPoints(front)
    with working(time_limit, progress, workers) as (show, interrupts):
        points = known.dense(n, show)
        elapsed, stopped = interrupts.elapsed, interrupts.reason
    return points.replace(stats=more_costs(front.stats, known.counts, elapsed, stopped))


def dense_curve(front: Points, error: float, time_limit: float | None, progress: bool | None, workers: Workers | None) -> Points:
    """The front with as many points more as its curve takes to err by less; see `Front.dense`."""
    check_interval("error", error, "(0, 1]")
    points, curve, counts, tried = front, curve_of(front), Counts(), list[float]()
    with working(time_limit, progress, workers) as (show, interrupts), suppress(Stopped):
        while (places := curve.wanting(error, tried)) and len(points) < LATTICE_SIZE and not stopping():
            show(f"dense: {len(points)} points, of which the curve errs by about {curve.error:.1e}")
            known, tried = KnownPoints(points), tried + places
            lines = [curve.least + curve.ranges * np.array([place, 1.0 - place]) for place in places]
            new = [one for one in known.solved(*(Scalarised(line, curve.ranges, units=known.units) for line in lines)) if one.row is None]
            counts = counts.joined(known.counts)
            points = Points.concatenate([points, known.found(new)]) if new else points
            points = points[best_rows(points)].sorted()
            curve = curve_of(points)
    missed = f"The curve errs by about {curve.error:.1e} of the ranges, and not by less than {error:g}." if curve.error > error else ""
    stats = more_costs(front.stats, counts, interrupts.elapsed, interrupts.reason)
    return points.replace(stats=stats, message=" ".join(filter(None, [front.message, missed])))


@dataclass(frozen=True, eq=False)
class KnownPoint:
    """A point of a front, or a result of a solve, on its mesh."""

    method: Transcription
    z: np.ndarray
    F: np.ndarray  # (m,)
    trajectory: Trajectory | None = None  # of one of the front
    multipliers: Multipliers | None = None  # of a result
    row: int | None = None  # in the front
    note: str = ""
    columns: dict[str, Any] = field(default_factory=dict)  # its certificate

    def on(self, nlp: NLP, units: np.ndarray) -> Neighbour:
        """It on the mesh of an NLP."""
        if nlp.transcription != self.method:
            return Neighbour(nlp.interpolate(self.trajectory or self.method.nlp(nlp.problem).unpack(self.z)), self.F, None)
        found = self.multipliers or multipliers_at(nlp, self.z.tobytes(), tuple(units.tolist()))
        return Neighbour(self.z, self.F, in_units(found, units))


def _solved(
    programs: Programs, method: Transcription, task: Scalarised, starts: Sequence[Start], bound: float, tolerance: float
) -> tuple[Solved, dict[str, Any], Counts]:
    """The result of a task from its starts, strongly optimal, with its certificate; and what it took."""
    nlp, solves = programs(method), GradientSolves(tolerance)
    found = best_of(task, solves, nlp, starts, bound)
    if found.status != CONVERGED:
        found = task.solve(solves, nlp, starts[-1].z)
    if found.status != CONVERGED:
        return found, {}, solves.counts
    if found.multipliers is not None:
        weights = found.multipliers.of_objectives
        found = strongly_optimal(partial(solves, nlp), nlp, tolerance, found, weights, task.units)
    return found, {name: column[0] for name, column in certified(nlp, found.z[None], task.units).items()}, solves.counts


class KnownPoints:
    """The points of a front, and solves between them."""

    def __init__(self, front: Points) -> None:
        if front.source is None:
            raise ValueError("this front is of a black box, which has no dynamics to solve: evaluate it instead")
        self.problem, self.front = front.compiled(), front
        refuse_peaks(self.problem)
        doubt = confidence(front)
        good = [i for i in range(len(front)) if doubt[i] < 2 and front.trajectories[i] is not None and front.transcriptions[i] is not None]
        # A point that a simulation refutes may promise too much.
        good = [i for i in good if doubt[i] == 0] if sum(doubt[i] == 0 for i in good) > 1 else good
        if len(good) < 2:
            raise ValueError(f"the front has {counted(len(good), 'feasible point')}: between two or more there are others")
        self.known = [
            KnownPoint(from_dict(front.transcriptions[i] or {}), front[i].decision, front.F[i], front.trajectories[i], row=i) for i in good
        ]
        self.units = ranges(self.F)
        self.programs, self.counts, self._began = latest_programs(self.problem), Counts(), time.perf_counter()

    @property
    def F(self) -> np.ndarray:
        """Objectives (k, m) of all that is known."""
        return np.array([one.F for one in self.known])

    def within(self, limits: np.ndarray) -> KnownPoint:
        """The point with limits (m,), not numbers where others are best: all of these alike, along their ranges."""
        limited = ~np.isnan(limits)
        if not (self.F[:, limited] <= limits[limited]).all(axis=1).any():
            # First as near to the limits as can be.
            (closest,) = self.solved(Scalarised(np.where(limited, limits, np.inf), self.units, units=self.units))
            self.known.append(closest)
            over = (closest.F - limits)[limited] / self.units[limited]
            if over.max() > BETTER:
                return replace(closest, note=f"{self._words(limits)} is out of reach: this is the point of the front nearest to it")
        task = Scalarised(np.where(limited, limits, self.F.min(axis=0)), np.where(limited, 0.0, self.units), units=self.units)
        (found,) = self.solved(task)
        spare = self._words(np.where(limited & (limits - found.F > BETTER * self.units), limits, np.nan))
        return replace(found, note=f"it is better than {spare}: at that goal, nothing else would be better") if spare else found

    def least_sum(self, weights: np.ndarray) -> KnownPoint:
        """The point of the least sum of objectives in their ranges times weights (m,)."""
        reference = np.where(weights > 0, self.F.min(axis=0), np.inf)
        return self.solved(Scalarised(reference, weights / self.units, units=self.units, summed=True))[0]

    def nearest(self, reference: np.ndarray, widths: np.ndarray) -> KnownPoint:
        """The point nearest to a reference (m,), along widths (m,)."""
        task = Scalarised(reference, widths, units=widths)
        (found,) = self.solved(task)
        missed, words = task.loss(found.F), f"{self._words(reference)} lies off the front: this point "
        if abs(missed) <= BETTER:
            return found
        return replace(found, note=f"{words}{'misses it by up to' if missed > 0 else 'is better in all by'} {abs(missed):.2g} of a range")

    def solved(self, *tasks: Scalarised) -> list[KnownPoint]:
        """The results of tasks, side by side; the best point that is known where nothing better was found."""
        pieces = [self._piece(task) for task in tasks]
        found = []
        for task, (method, *_), (solved, columns, counts) in zip(tasks, pieces, each(_solved, self.programs, pieces), strict=True):
            self.counts = self.counts.joined(counts)
            within = (self.F - task.reference <= BETTER * self.units)[:, task.hard].all(axis=1)
            losses = np.where(within, [task.loss(one) for one in self.F], np.inf)
            best = int(np.argmin(losses))
            if solved.status == CONVERGED and task.loss(solved.F) <= losses[best] + BETTER:
                found.append(KnownPoint(method, solved.z, solved.F, None, solved.multipliers, columns=columns))
            else:
                why = "" if solved.status == CONVERGED else f": {solved.message}"
                found.append(replace(self.known[best], note=f"no solve found a better point for this place{why}"))
        return found

    def _piece(self, task: Scalarised) -> tuple[Any, ...]:
        """What `_solved` needs for a task."""
        X = coordinates(task, self.F)
        parts = shares(X)
        rows = np.flatnonzero(parts)
        # The finest of their meshes: an end may have few degrees of freedom because it needs none, and a point beside it then lacks them.
        near = rows[np.argsort((X[rows] ** 2).sum(axis=1), kind="stable")]
        nlp = max((self.programs(self.known[i].method) for i in near), key=lambda one: len(one.variables))
        refuse_dense(nlp)
        around = [self.known[i].on(nlp, self.units) for i in rows]
        return nlp.transcription, task, *predicted(task, nlp, around, parts[rows]), float(self.front.stats["tolerance"])

    def dense(self, n: int, show: Any) -> Points:
        """So many points, in even steps between the ends."""
        F, best = self.F, extremes(self.F)
        waiting = [replace(one, units=self.units) for one in tasks_between(F[best], np.ptp(F, axis=0), n, "pascoletti-serafini")]
        found = [self.known[i] for i in dict.fromkeys(best.tolist())]
        with suppress(Stopped):  # with what there is until then
            while waiting and not stopping():
                show(f"dense: {len(found)} of {n} points")
                some = self._farthest(waiting)
                new = [one for one in self.solved(*(waiting[i] for i in some)) if one.row is None]
                waiting = [one for i, one in enumerate(waiting) if i not in some]
                found, self.known = found + new, self.known + new
        points = self.found(found)
        points = points[best_rows(points)]
        points = points[separate(points.F, self.units)].sorted()
        counts = {"were not begun": len(waiting), "have no point of their own": n - len(points) - len(waiting)}
        return points.replace(message="; ".join(f"{count} of {n} places {what}" for what, count in counts.items() if count > 0))

    def _farthest(self, tasks: Sequence[Scalarised]) -> list[int]:
        """The tasks of the next batch: in turn that whose place is farthest from all points and places before."""
        references = np.array([task.reference for task in tasks])
        apart = np.array([np.linalg.norm(coordinates(task, self.F), axis=1).min() for task in tasks])
        chosen = list[int]()
        while len(chosen) < min(TOGETHER, len(tasks)):
            chosen.append(int(np.argmax(apart)))
            apart = np.minimum(apart, np.linalg.norm(coordinates(tasks[chosen[-1]], references), axis=1))
            apart[chosen] = -1.0
        return chosen

    def found(self, some: Sequence[KnownPoint]) -> Points:
        """Points, certified and simulated; what a simulation does not confirm is solved again."""
        front, about = self.front, {name: self.front.stats[name] for name in ("seed", "tolerance")}
        stats = costs(self.counts, wall_time=time.perf_counter() - self._began, reproducible=not self.counts.clocked, **about)
        solver, sets = {"name": "at", "settings": {}}, list[Points]()
        for method in dict.fromkeys(one.method for one in some):
            mine = [one for one in some if one.method == method]
            old, new = {one.row: one.note for one in mine if one.row is not None}, [one for one in mine if one.row is None]
            if old:
                sets.append(front[list(old)].replace(notes=list(old.values())))
            if new:
                columns = {name: [one.columns.get(name) for one in new] for name in ("optimality", "costates", "weighted_gain")}
                Z, notes = np.array([one.z for one in new]), [one.note for one in new]
                sets.append(from_vectors(self.programs(method), Z, solver, stats, notes=notes, **columns))
        points = (sets[0] if len(sets) == 1 else Points.concatenate(sets)).replace(solver=solver, stats=stats)
        for note in filter(None, (one.note for one in some)):
            log.info("%s: %s", self.problem.name, note)
        found, verify = points.notes, front.stats.get("verify", VERIFY)
        points = verified(points, verify, objective_scales(front))
        if points.verified.all():
            return points
        points = resolve_unverified(points, verify)
        return points.replace(notes=["; ".join(dict.fromkeys(filter(None, both))) for both in zip(found, points.notes, strict=True)])

    def _words(self, limits: np.ndarray) -> str:
        """Objectives (m,) in words; those that are no numbers are left out."""
        front = self.front
        known = [(goal, value * goal.sign) for goal, value in zip(front.goals, limits.tolist(), strict=True) if not np.isnan(value)]
        return ", ".join(f"{goal.name} {shown(value, goal)}" for goal, value in known)
