"""Re-solves points that a simulation does not confirm: on finer meshes, or with tightened limits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial, wraps
from typing import Any

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from transcription import from_dict
from transcription.inner import Propagate
from transcription.meshed import Meshed
from transcription.meshes.verdict import Wanted
from transcription.nlp.scalarized import Solved
from transcription.stopping import Stopped, stopping

from ..evaluation.bilevel import Bilevel
from ..evaluation.evaluator import CONVERGED, Counts
from ..fronts.builders import best_rows, certified, from_vectors
from ..fronts.points import Points
from ..fronts.provenance import more_costs
from ..fronts.verified import Simulations, feasible_as_simulated, largest_miss, missed, objective_scales, untrusted, verified
from ..gradients.front_polish import KEPT_INSIDE, back_off
from ..gradients.scalarised import WORK, GradientSolves, Scalarised, strongly_optimal
from ..io.console import working
from ..io.interrupts import spending
from ..io.workers import TOGETHER
from ..pareto.dominance import extremes, separate
from ..pareto.spread import Guide, spread
from .front_refinement import FrontRefinement
from .mesh_loop import LOOP, MeshLoop, OnMesh, Programs, differentiable
from .mesh_search import SEARCH


@dataclass(frozen=True)
class MendingLimits:
    """Limits on the re-solves of points that a simulation does not confirm."""

    part: float = 0.8  # what points are to miss at most, as a fraction of what they may
    meshes: int = 6  # most of one point
    patience: int = 150  # most iterations of one solve: from a trajectory nearby most take some tens
    share: float = 0.4  # work on solving points again, and on programs for that, as a part of what the front cost
    each: float = 100.0  # iterations for each point that is missed that are allowed even then: enough for one more mesh
    # Work that is always allowed, about a second, since a mesh that is coarse for its search is refined to many times its variables.
    least: float = 2e5
    slightly: float = 0.1  # excess over limits, in their scales, up to which a point is rather moved inside of them
    loss: float = 5e-3  # what that may cost in each objective, in ranges of the front
    starts: int = 2  # verified points from which a solve for a further one is tried


MENDING = MendingLimits()
AS_SIMULATED = "its objectives are those of its simulation, which its mesh does not give"


@spending("mending")
def mended(
    points: Points,
    verify: float,
    time_limit: float | None = None,
    progress: bool | None = None,
    fine: Meshed | None = None,
    ends: Points | None = None,
    guide: Guide | None = None,
    size: int = 0,
) -> Points:
    """The front with its unverified points re-solved, all on a `fine` mesh first, if that of the search is known to be too coarse; with
    those of the `ends` that are better in an objective than all of the points. A guide says how densely points are wanted, and `size` how
    many at least."""
    if not len(points):
        return verified(points, verify)
    with working(time_limit, progress) as (show, interrupts):
        job = _Mending(points, verify, show, ends)
        again = job.resolve_unverified(fine)
        joined = job.strong(again)
        if joined is job.points and joined.verified.all() and len(joined) >= size:
            return job.with_costs(_separate(joined[best_rows(joined)]).sorted(), interrupts.elapsed, interrupts.reason)
        kept = _separate(joined[best_rows(joined, verify * objective_scales(joined))])
        if joined is not job.points or len(kept) < size:
            kept = job.marked(job.fill_gaps(kept, max(size, len(points)), guide))
        return job.with_costs(job.with_reasons(kept.sorted()), interrupts.elapsed, interrupts.reason)


@spending("mending")
def resolve_unverified(points: Points, verify: float) -> Points:
    """The points in their order, the unverified ones re-solved. They are simulated first if none was."""
    with working(None, None) as (show, interrupts):
        job = _Mending(points, verify, show)
        return job.with_costs(job.with_reasons(job.resolve_unverified()), interrupts.elapsed, interrupts.reason)


def _unless_stopped(step: Callable[..., Points]) -> Callable[..., Points]:
    """A step of mending that returns its points as they are if it is to end in its middle, as while a program is built."""

    @wraps(step)
    def kept(self: _Mending, points: Points, *arguments: Any) -> Points:
        try:
            return step(self, points, *arguments)
        except Stopped:
            return points

    return kept


class _Mending:
    """The re-solves in several steps, which share programs on meshes and simulations, each made once."""

    def __init__(self, points: Points, verify: float, show: Callable[[str], None], ends: Points | None = None) -> None:
        problem = points.compiled()
        self.points, self.verify, self.show = points, verify, show
        self._gain = SEARCH.optimum * verify  # what other controls may gain, as for a single optimum
        # Points are filled up from the first meshes, too, after others were refined.
        there = {from_dict(one) for one in points.transcriptions if one}
        self.programs, self.simulations = Programs(problem, MENDING.meshes, there), Simulations(problem, verify)
        self._solves = GradientSolves(float(points.stats["tolerance"]))
        limits = MENDING.part * verify
        self._wanted = Wanted(limits, feasible=limits, leaving=limits, objectives=limits, confirmed=False)
        self._loop = MeshLoop(self.programs, self._solves, self._wanted, MENDING.meshes)
        self._work, self._scales, self.missing = points.stats.get("work", 0), None, ""
        self.ends = None if ends is None else self.marked(ends)
        # With ends that are known to simulate, tolerances are fixed by these; else by what the points are in the end.
        self._scales = None if self.ends is None else objective_scales(self.ends)
        self._later = ends is None and np.isnan(points.tolerances).any()

    def marked(self, points: Points, remark: bool = False) -> Points:
        """The points marked by their simulations, without remarks on dynamics in their notes."""
        return verified(points, self.verify, self._scales, remark, self.simulations)

    def with_reasons(self, points: Points) -> Points:
        """The same with remarks on unverified points, since no solve can cure unstable dynamics."""
        return points if points.verified.all() else self.marked(points, remark=True)

    def with_costs(self, points: Points, elapsed: float, stopped: str) -> Points:
        """The points with all costs of the re-solves."""
        message = " ".join(filter(None, [self.points.message, self.missing]))
        return points.replace(stats=more_costs(points.stats, self._solves.counts, elapsed, stopped), message=message)

    def resolve_unverified(self, fine: Meshed | None = None) -> Points:
        """The points in their order; `points` itself if none was solved."""
        again = self.points
        if not again.was_simulated.any():
            again = self.points = self.marked(again)
        tried = again
        if fine is None:
            # What costs least comes first: the mesh and its program are there.
            again = tried = self._as_simulated(self._inside(again, _slightly_outside(again, self.verify), MENDING.loss), SEARCH.passable)
        again = self._refined(again, self._meshed(again, again.was_simulated & ((fine is not None) | ~again.verified)), fine)
        again = self.with_ends(again)
        gaining, ends = self._meshed(again, again.verified & (again.gain > self._gain)), list[int]()
        if self.ends is not None and self.points.stats["evaluations"] and gaining:
            # Where work is limited, the ends come first, if meshes are sought for these.
            good = np.flatnonzero(again.verified)
            ends = [i for i in gaining if i in good[extremes(again.simulated_F[good])]]
            again = self._refined(again, ends, None, MENDING.share)
        again = self._refined(again, [i for i in gaining if i not in ends])
        # On a finer mesh, too, a point may exceed limits between nodes, and by less.
        old = set(map(id, tried.trajectories))
        moved = [i for i in _slightly_outside(again, self.verify) if id(again.trajectories[i]) not in old]
        again = self._as_before(self._inside(again, moved, MENDING.loss))
        beyond = again.was_simulated & (again.simulated_violation > self.verify) & (again.status == CONVERGED)
        again = self._inside(again, sorted(set(np.flatnonzero(beyond).tolist()) - set(self._meshed(again, beyond))))
        return self._as_simulated(self.marked(again.replace(tolerances=None)) if self._later and again is not self.points else again)

    def _as_simulated(self, points: Points, most: float = np.inf) -> Points:
        """The points, with simulated objectives in place of those that are wrong, by at `most` so many tolerances, where nothing else is:
        quadrature over a kink."""
        rows = feasible_as_simulated(points, self.verify) & ~points.verified & ~untrusted(points) & (missed(points).max(axis=1) <= most)
        if not rows.any():
            return points
        notes = np.where(rows, AS_SIMULATED, points.notes).tolist()
        return self.marked(points.replace(F=np.where(rows[:, None], points.simulated_F, points.F), notes=notes))

    @_unless_stopped
    def _inside(self, points: Points, rows: list[int], loss: float = np.inf) -> Points:
        """The points, with those in `rows` moved inside the limits that they exceed; see `_inside_limits`."""
        if not rows:
            return points
        self.show("points that are infeasible when simulated are solved again")
        moved, counts = _inside_limits(self.programs, points, rows, self.verify, loss)
        self._solves.counts = self._solves.counts.joined(counts)
        return self.marked(moved)

    def with_ends(self, points: Points) -> Points:
        """The points with those verified ends that are better in an objective than all of them, by more than optima may miss."""
        ends, good = self.ends, points.simulated_F[points.verified]
        if ends is None:
            return points
        better = ends.verified & (ends.simulated_F < good.min(axis=0, initial=np.inf) - self._gain * objective_scales(ends)).any(axis=1)
        if not better.any():
            return points
        return Points.concatenate([points, ends[better]]).replace(stats=points.stats, solver=points.solver)

    def fill_gaps(self, points: Points, size: int, guide: Guide | None) -> Points:
        """The points with further verified ones, until there are `size` or the work is used up, and fewer unverified ones: by solves from
        the nearest verified points, on their meshes, to where unverified ones are, then to the middles of the widest gaps."""
        if not differentiable(self.programs.problem):
            return points
        most = self._solves.counts.work + self._most_work(points, size - int(points.verified.sum()))
        tried = np.empty((0, points.F.shape[1]))
        fruitless, without, ended = 0, Counter[str](), ""
        while 0 < points.verified.sum() < size and fruitless < LOOP.patience:
            scales = objective_scales(points)
            left, targets = most - self._solves.counts.work, list[np.ndarray]()
            each = MENDING.each * float(np.mean([len(variables) for variables in points.places]))
            room = min(TOGETHER // 2, size - int(points.verified.sum()), LOOP.patience - fruitless, max(left / each, 1.0))
            while len(targets) < room and (target := _target(points, tried, scales, guide, targets)) is not None:
                targets, tried = [*targets, target], np.vstack([tried, target])
            if not targets or left <= 0 or stopping():
                ended = "all gaps were tried" if not targets else "the work for more was used up" if left <= 0 else "the time was over"
                break
            found: list[Points | str] = ["ended with the time"] * len(targets)
            with suppress(Stopped):  # which ends the loop
                found = self._between(points, targets, scales)
            for target, new in zip(targets, found, strict=True):
                fruitless, before = fruitless + 1, int(points.verified.sum())
                if isinstance(new, Points):
                    joined = Points.concatenate([points, new]).replace(stats=points.stats, solver=points.solver)
                    joined = joined[np.flatnonzero(_needed(joined) | (target != joined.F).any(axis=1))]  # not what it takes the place of
                    points = _separate(joined[best_rows(joined)])
                    new = "no better than another point" if points.verified.sum() <= before else ""
                    fruitless = fruitless if new else 0
                    self._solves.counts.keep(not new)
                without[new] += 1
        points, why = points[_within(points, size, guide)], ", ".join(f"{count} {why}" for why, count in without.items() if why)
        if len(points) < size and (why or ended):
            said = "; ".join(filter(None, [why and f"solves for more: {why}", ended]))
            self.missing = f"{len(points)} of {size} points were found; {said}."
        return points

    def _between(self, points: Points, targets: Sequence[np.ndarray], scales: np.ndarray) -> list[Points | str]:
        """For each of some targets (m,), side by side, a verified point, by solves from the verified points nearest to it in turn, on their
        meshes, or why there is none."""
        good, found = np.flatnonzero(points.verified), list[Points | str](["had no mesh to be solved on"] * len(targets))
        apart = np.linalg.norm((points.simulated_F[good] - np.array(targets)[:, None]) / scales, axis=2)
        near, meshed = good[np.argsort(apart, axis=1, kind="stable")].tolist(), self._meshed(points, points.verified)
        for k in range(min(MENDING.starts, len(good))):
            begun = {i: near[i][k] for i, one in enumerate(found) if isinstance(one, str) and near[i][k] in meshed}
            starts = [(from_dict(points[row].transcription or {}), points[row].decision) for row in begun.values()]
            pieces = [(*start, Scalarised(targets[i], scales, units=scales)) for i, start in zip(begun, starts, strict=True)]
            solved = self._loop.each(_solved, pieces)
            new = dict[int, Points]()
            for (i, row), (method, _), one in zip(begun.items(), starts, solved, strict=True):
                found[i] = "did not converge"
                if one is not None and one.status == CONVERGED:
                    new[i] = from_vectors(self.programs(method), one.z[None], points.solver, points.stats, **_judged(points[[row]]))
            if new:
                judged = self.marked(Points.concatenate([*new.values()]))
                judged = self._as_simulated(self._inside(judged, _slightly_outside(judged, self.verify)), SEARCH.passable)
                for row, i in enumerate(new):
                    found[i] = judged[[row]] if judged.verified[row] else "not confirmed by simulation"
        return found

    @_unless_stopped
    def strong(self, points: Points) -> Points:
        """The points, with a better one in place of each verified one that is only weakly optimal: of each that is not optimal with a
        weight on every objective, the objectives without are minimised once. `points` itself if none is better."""
        m, scales, better = points.F.shape[1], objective_scales(points), dict[int, Points]()
        best = extremes(points.F) if len(points) else np.zeros(0)
        most = self._solves.counts.work + min(self._most_work(points, 0), WORK.most)
        for i in self._meshed(points, points.verified) if m > 1 and differentiable(self.programs.problem) else ():
            own = points[i].weights
            weights = (best == i).astype(float) if own is None else np.array(list(own.values()))
            if not (weights > 0).any() or self._solves.counts.work >= most or stopping():
                continue
            nlp = self.programs(from_dict(points[i].transcription or {}))
            point = Solved(points[i].decision, points[i].F, points[i].violation, CONVERGED, 0)
            with self._solves.at_most(MENDING.patience):
                found = strongly_optimal(partial(self._solves, nlp), nlp, self._solves.tolerance, point, weights, scales)
            if found is not point:
                certificate = certified(nlp, found.z[None], scales)
                new = self.marked(from_vectors(nlp, found.z[None], points.solver, points.stats, **certificate, **_judged(points[[i]])))
                better |= {i: new} if new.verified[0] else {}
        self._solves.counts.keep(len(better))
        if not better:
            return points
        return Points.concatenate([better.get(i, points[[i]]) for i in range(len(points))]).replace(
            stats=points.stats, solver=points.solver
        )

    def _as_before(self, points: Points) -> Points:
        """The points, with the original in place of each that was verified originally and no longer is, lost more than its tolerance, an
        end of the front in its own objective, or has no certificate any more, since it was interrupted before that."""
        before = self.points
        lost = (points.simulated_F[: len(before)] - before.simulated_F) / objective_scales(before)
        ends = extremes(before.F)
        own = ~np.isin(np.arange(len(before)), ends)[:, None] | (ends == np.arange(len(before))[:, None])
        worse = np.where(own, lost, 0.0).max(axis=1) > self.verify
        unknown = [now is None is not known for now, known in zip(points.optimality, before.optimality, strict=False)]
        unsure = np.flatnonzero((~points.verified[: len(before)] | worse | unknown) & (before.verified | ~before.was_simulated)).tolist()
        lost = [i for i in unsure if points.trajectories[i] is not self.points.trajectories[i]]
        if not lost:
            return points
        old = self.marked(self.points[lost])
        rows = {i: old[[k]] for k, i in enumerate(lost) if old.verified[k]}
        return Points.concatenate([rows.get(i, points[[i]]) for i in range(len(points))]).replace(stats=points.stats)

    def _meshed(self, points: Points, rows: np.ndarray) -> list[int]:
        """Those of a mask of rows (n,) that can be solved on other meshes."""
        rows = rows & (points.status == CONVERGED) & ~untrusted(points)
        return [i for i in np.flatnonzero(rows).tolist() if isinstance(from_dict(points[i].transcription or {}), Meshed)]

    @_unless_stopped
    def _refined(self, points: Points, rows: list[int], fine: Meshed | None = None, more: float = 0.0) -> Points:
        """The points with some of them on a `fine` mesh, or finer ones of their own, as far as the work allows, and `more` as a part of the
        front's; simulated."""
        if not rows:
            return points
        gaining = fine is None and bool(points.verified[rows].all())
        wanted = replace(self._wanted, gain=self._gain if gaining else np.inf)
        scales = objective_scales(points)

        # Where only objectives are off, those of the simulation are known, too.
        blurred = fine is None and bool(feasible_as_simulated(points, self.verify)[rows].all())
        most = self._most_work(points, 0 if gaining else len(rows), fine, 0.0 if blurred or gaining else MENDING.share)
        most += more * self._work
        enough = partial(_enough, scales, wanted.tolerance)
        job = FrontRefinement(points, wanted, MENDING.meshes, rows, most, self.programs, enough, MENDING.patience, first=fine)
        job.go(self.show)
        again = self.marked(job.points(0.0, ""))
        # What refinement would wish for besides is no complaint about a point that is verified.
        return again.replace(notes=["" if i in rows and again.verified[i] else note for i, note in enumerate(again.notes)])

    def _most_work(self, points: Points, count: int, fine: Meshed | None = None, share: float = MENDING.share) -> float:
        """The work left for so many points, in iterations times variables, and a share of what the front cost; no limit where there was no
        search, so that the mesh is the only task."""
        if not points.stats["evaluations"]:
            return np.inf
        spent = points.stats.get("work", 0) + self._solves.counts.work - self._work + WORK.building * self.programs.built
        size = float(np.mean([len(variables) for variables in points.places])) if fine is None else len(self.programs(fine).variables)
        return max(share * self._work - spent, MENDING.each * count * size, MENDING.least)


def _solved(loop: MeshLoop, method: Meshed, z: np.ndarray, task: Scalarised) -> Solved:
    """The result of a solve from the vector (n,) of a point nearby."""
    with loop.solves.at_most(MENDING.patience):
        return task.solve(loop.solves, loop.programs(method), z)


def _enough(scales: np.ndarray, limits: float, point: OnMesh) -> bool:
    """Whether a simulation confirms a point within the limits, in scales (m,), and other controls gain little."""
    return not point.gaining and largest_miss(point.verdict.problem, point.verdict.simulation, point.F, scales) <= limits


def _slightly_outside(points: Points, verify: float) -> list[int]:
    """The points whose only faults in a simulation are that they exceed limits a little, mostly between nodes, and that objectives are a
    little off. A solve on their own mesh, whose program exists already, costs far less than on any other."""
    beyond = (points.simulated_violation > verify) & (points.simulated_violation <= MENDING.slightly) & (points.status == CONVERGED)
    return np.flatnonzero(beyond & (points.defect <= verify) & (missed(points) <= SEARCH.passable).all(axis=1)).tolist()


def _inside_limits(programs: Programs, points: Points, rows: Sequence[int], verify: float, loss: float) -> tuple[Points, Counts]:
    """The points, with those of `rows` moved inside the limits that they exceed when simulated, where no objective gets worse by more than
    the loss, in ranges of the front; and what that cost."""
    moved, counts = dict[int, Points](), Counts()
    for transcription in {id(points.transcriptions[i]): points.transcriptions[i] for i in rows}.values():
        own = [i for i in rows if points.transcriptions[i] is transcription]
        nlp = programs(from_dict(transcription or {}))
        evaluator = Bilevel(nlp, Propagate(), float(points.stats["tolerance"]))
        if not evaluator.has_gradients:
            continue
        scales = objective_scales(points)
        Z, feasible, changed = back_off(evaluator, np.array([points[i].decision for i in own]), scales, verify)
        worse = ((nlp.evaluate(Z)[0] - points.F[own]) / scales).max(axis=1)
        good = np.flatnonzero(feasible & changed & (worse <= loss)).tolist()
        evaluator.counts.keep(len(good))
        counts = counts.joined(evaluator.counts)
        for k in good:
            moved[own[k]] = from_vectors(nlp, Z[k : k + 1], points.solver, points.stats, notes=[KEPT_INSIDE], **_judged(points[[own[k]]]))
    joined = Points.concatenate([moved.get(i, points[[i]]) for i in range(len(points))]) if moved else points
    return joined.replace(stats=points.stats, solver=points.solver), counts


def _separate(points: Points) -> Points:
    """The points without those in the same place as another; see `separate`."""
    seen = np.where(points.verified[:, None], points.simulated_F, points.F)
    return points[np.flatnonzero(separate(seen, objective_scales(points)))] if len(points) else points


def _judged(points: Points) -> dict[str, np.ndarray]:
    """The columns by which points are judged."""
    return {"tolerances": points.tolerances, "within": points.within}


def _within(points: Points, size: int, guide: Guide | None) -> np.ndarray:
    """Rows (k,) of a front with `size` points: of verified points those that are well spread, of others as many as there is room for, first
    the best of an objective."""
    good = np.flatnonzero(points.verified)
    if len(good) > size:
        return good[spread(points.simulated_F[good], size, guide=guide)]
    others = np.flatnonzero(~points.verified)
    return np.sort(np.r_[good, others[np.argsort(~_needed(points)[others], kind="stable")][: size - len(good)]])


def _needed(points: Points) -> np.ndarray:
    """Mask (n,) of the points that are verified or, by more than may be lost, the best of an objective."""
    best, needed = extremes(points.F), points.verified.copy()
    known = points.simulated_F[needed].min(axis=0, initial=np.inf)
    needed[best[points.F.min(axis=0) < known - MENDING.loss * objective_scales(points)]] = True
    return needed


def _target(
    points: Points, tried: np.ndarray, scales: np.ndarray, guide: Guide | None, also: Sequence[np.ndarray] = ()
) -> np.ndarray | None:
    """The next target (m,): the unverified point nearest to a verified one; without any, the middle of the widest gap between verified
    points that are neighbours, on the tree of least length that joins all, and those that will be `also` there. None if all were tried."""
    good, others = np.vstack([points.simulated_F[points.verified], *also]), points.F[~points.verified]
    others = others[[not (row == tried).all(axis=1).any() for row in others]]
    if len(others):
        return others[np.argmin(np.linalg.norm((others[:, None] - good) / scales, axis=2).min(axis=1))]
    if len(good) < 2:
        return None
    tree = minimum_spanning_tree(np.linalg.norm((good[:, None] - good) / scales, axis=2)).tocoo()
    middles, widths = 0.5 * (good[tree.row] + good[tree.col]), tree.data
    if guide is not None:
        widths *= guide.factors(good, middles)
    new = [k for k in np.argsort(-widths, kind="stable").tolist() if not (middles[k] == tried).all(axis=1).any()]
    return middles[new[0]] if new else None
