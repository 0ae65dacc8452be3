"""Gradient polish of an archive: its points are moved to the Pareto front by gradient solves, and spread along it.

The number of solves is limited, and a log keeps their results, so that an interrupted polish can be continued.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ..evaluation.evaluator import CONVERGED, FAILED, Counts, Evaluation, Evaluator
from ..io.interrupts import spending
from ..io.workers import TOGETHER
from ..pareto.archive import Archive
from ..pareto.directions import across, divisions_below, simplex_lattice
from ..pareto.dominance import BETTER, CURVE, among, distinct, extremes, feasible_and_no_worse, nearest, ranges, slack
from ..pareto.spread import Guide, reach, spread


@dataclass(frozen=True)
class PolishLimits:
    """Limits of the polish; objectives are in ranges of the front."""

    # An end may be replaced by a point that is worse in another objective by more than `loss` if it gains more than `fair` in its own.
    fair: float = 1e-4
    loss: float = 0.05
    rounds: int = 6  # most rounds with starts from neighbours, and most rounds in which points slide along the front
    wide: float = 1.5  # a gap so many times as wide as the median one gets a point of its own; crowded points are left out for it
    nearer: float = 0.15  # where the middle of a gap was not reached, places are tried at this part of the way from both sides
    gain: float = 0.995  # a slide is tried only if it is expected to lower the energy of the point at least to this fraction
    places: int = 500  # most places that cover a surface
    # With a guide, the places are around its first anchor instead, at these parts of the distances: its region may be small, it may lie
    # beyond the simplex between the ends, and far from known points it is not known where it ends.
    closer: tuple[float, float] = (1 / 3, 1 / 9)


POLISH = PolishLimits()


@spending("polish")
def polish(
    archive: Archive,
    solves: BudgetedSolves,
    limit: int,
    exponent: float | None = None,
    guide: Guide | None = None,
    optima: Archive | None = None,
    alike: bool = False,
) -> Archive:
    """The archive with its points moved to the Pareto front by gradient solves, and spread along it evenly.

    1. With more than two objectives, the front is a surface: one solve goes to each of `limit` places spread over it. With a guide all
    solves that are left go to places that it wants, and no further steps follow: an even spread would take most of them elsewhere. 2. One
    guarded solve from each point that no solve has found; the best point of each objective is first solved for the least value of that
    objective. 3. Solves for each point from the positions of its neighbours, as long as this finds better points. With more than two
    objectives and few solves, each from the point that is nearest to dominating it. Not where all starts are `alike`. 4. Points slide along
    the front to positions of less energy, and new points fill wide gaps and free places; where the middle of a gap is too far, places
    nearer to its sides. The ends are then solved once more from their neighbours. After 2 and 4, points are solved with other whole
    numbers.

    If there are few solves, step 2 uses only some points, well spread, and leaves half of the solves for the other steps. The remaining
    points fill free places in the end, if they are not dominated. If the work is asked to end early, no solves are left, and the result is
    made of those before.
    """
    if not len(archive):
        return archive
    optima = archive.take(np.arange(0)) if optima is None else optima
    archive, solved = _settled(archive, optima), optima.F
    solves.promise(limit + 2 * archive.F.shape[1])  # for each point one, and two for each end
    if archive.F.shape[1] > CURVE:
        ends = _ends(archive, ranges(archive.F), solves, solved)
        solves.promise(limit)
        surface = cover(archive, ends, solves, limit, guide)
        archive, solved = _thinned(surface.points(), limit, exponent, guide), np.vstack([solved, surface.solved])
        if not solves.left:
            return archive
    archive, waiting = _descend(archive, solves, solved, exponent, guide)
    archive = _with_other_values(archive, solves)
    solves.promise(1)  # and more as long as that helps
    for _ in range(0 if alike else POLISH.rounds):
        better = _helped_by_neighbours(archive, solves)
        if better is archive:
            break
        archive = better
    pool, span = archive, ranges(archive.F)
    archive = _thinned(pool, limit, exponent, guide)
    for _ in range(POLISH.rounds):
        with spending("gaps"):
            references, starts, gaps = _slide(archive, limit, exponent, guide)
            if not (len(references) and solves.left):
                break
            found = solves(starts, references, np.tile(span, (len(references), 1)))
            new = Archive.of(found, solves.feasible(found))
            failed = gaps[np.flatnonzero(found.status[: len(gaps)] != CONVERGED)]
            if len(failed) and solves.left:
                near, far = failed.ravel(), failed[:, ::-1].ravel()
                nearer = archive.F[near] + POLISH.nearer * (archive.F[far] - archive.F[near])
                found = solves(archive.Z[near], nearer, np.tile(span, (len(near), 1)))
                new = new.joined(Archive.of(found, solves.feasible(found)))
            known, pool = pool, _front(pool.joined(new), span)
            solves.results.keep(among(new.F, pool.F) & ~among(new.F, known.F))
        before, archive = archive, _thinned(pool, limit, exponent, guide)
        if np.array_equal(before.F, archive.F):
            break
    archive = archive if alike else _helped_by_neighbours(archive, solves, extremes(archive.F))
    archive = _with_other_values(archive, solves)
    if len(waiting):
        archive = _thinned(_front(archive.joined(waiting), span), limit, exponent, guide)
    return archive


def _thinned(pool: Archive, limit: int, exponent: float | None, guide: Guide | None) -> Archive:
    """At most `limit` points of the pool, evenly spread, or by the guide's density."""
    return pool if len(pool) <= limit else pool.take(spread(pool.F, limit, exponent=exponent, guide=guide))


def _descend(
    archive: Archive, solves: BudgetedSolves, solved: np.ndarray, exponent: float | None, guide: Guide | None
) -> tuple[Archive, Archive]:
    """The points after one guarded solve each, except for objectives (k, m) that are `solved` already, with the ends of the front; and the
    points for which no solves are left."""
    span = ranges(archive.F)
    most = max((solves.left - 2 * archive.F.shape[1]) // 2, 1)
    fresh = ~among(archive.F, solved)
    chosen = fresh.copy()
    if most < np.count_nonzero(fresh):
        chosen[fresh] = spread(archive.F[fresh], most, exponent=exponent, guide=guide)
    archive, waiting, chosen = archive.take(chosen | ~fresh), archive.take(fresh & ~chosen), chosen[chosen | ~fresh]
    points = archive.take(chosen)
    found = solves(points.Z, points.F, np.tile(span, (len(points), 1)))
    kept = feasible_and_no_worse(found, points.F, points.violation, span)
    solves.results.keep(kept)
    archive = points.replaced(kept, found).joined(archive.take(~chosen))
    return _front(_ends(archive, span, solves, solved).joined(archive), span), waiting


def _settled(archive: Archive, optima: Archive) -> Archive:
    """The archive, with points replaced by optima unless they are better by more than their violation explains."""
    if not len(optima):
        return archive
    span = ranges(archive.F)
    gain = ((optima.F - archive.F[:, None]) / span).max(axis=2)  # of each point over each optimum
    best = gain.argmin(axis=1)
    settled = gain.min(axis=1) <= slack(archive.violation)
    return _front(optima.take(np.unique(best[settled])).joined(archive.take(~settled)), span)


def _ends(archive: Archive, span: np.ndarray, solves: BudgetedSolves, solved: np.ndarray) -> Archive:
    """One point for each objective, its lexicographic optimum; unchanged if all are `solved`."""
    m = archive.F.shape[1]
    best = archive.take(extremes(archive.F))
    if among(best.F, solved).all():
        return best
    one = np.eye(m, dtype=bool)
    single = solves(best.Z, np.where(one, best.F, np.inf), np.where(one, span, 0.0))
    gain = (np.diag(best.F) - np.diag(single.F)) / span
    # Where many points have the least value of an objective, the one that is known may be far better in the others.
    fair = (gain > POLISH.fair) | ((single.F - best.F) / span <= POLISH.loss).all(axis=1)
    kept = (single.status == CONVERGED) & (gain >= -slack(best.violation)) & fair
    ends = best.replaced(kept, single)
    solves.results.keep(kept)
    if m == 1:
        return ends
    # The least value of its own objective becomes a limit, and all others are lowered together.
    both = solves(ends.Z, ends.F, np.where(one, 0.0, span))
    kept = feasible_and_no_worse(both, ends.F, ends.violation, span)
    solves.results.keep(kept)
    return ends.replaced(kept, both)


@spending("neighbours")
def _helped_by_neighbours(archive: Archive, solves: BudgetedSolves, chosen: np.ndarray | None = None) -> Archive:
    """The archive after guarded solves of all, or the chosen, points from their neighbours, the most promising first, until as many in
    a row as there are points find nothing better; not those that failed before. The archive itself if none improves."""
    span, m = ranges(archive.F), archive.F.shape[1]
    rows = range(len(archive)) if chosen is None else np.unique(chosen).tolist()
    # What another point nearly dominates most likely lies in a poorer valley.
    worse = ((archive.F[None] - archive.F[:, None]) / span).max(axis=2)
    pairs = sorted(((i, j) for i in rows for j in nearest(archive.F[i], archive.F, span)[1 : m + 1]), key=lambda pair: worse[pair])
    known = solves.failed_pairs if solves.failed_pairs is not None else np.empty((0, 2 * m))
    both = [np.hstack([archive.F[i], archive.F[j]]) for i, j in pairs]
    new = [k for k, pair in enumerate(both) if not among(pair[None], known)[0]]
    left, better, failed, fruitless = solves.left // (2 if len(pairs) > solves.left else 1), archive.take(np.arange(0)), [known], 0
    while new and (count := min(len(archive) - fruitless, left, solves.left)) > 0:
        some, new, left = new[:count], new[count:], left - count
        i, j = np.array([pairs[k] for k in some]).T
        found = solves(archive.Z[j], archive.F[i], np.tile(span, (len(some), 1)))
        gained = (found.status == CONVERGED) & (((archive.F[i] - found.F) / span).min(axis=1) > BETTER)
        solves.results.keep(gained)
        fruitless = int(np.argmax(gained[::-1])) if gained.any() else fruitless + count
        if gained.any():
            solves.promise(m)
        better = Archive.of(found, gained).joined(better)
        failed += [both[k][None] for k in np.array(some)[~gained]]
    solves.failed_pairs = np.vstack(failed)
    return _front(better.joined(archive), span) if len(better) else archive


@spending("whole numbers")
def _with_other_values(archive: Archive, solves: BudgetedSolves) -> Archive:
    """The archive after guarded solves of its points with each whole number one less and one more, as long as this finds better points; of
    the ends, the others of their objectives are lowered."""
    span, m = ranges(archive.F), archive.F.shape[1]
    for _ in range(POLISH.rounds):
        weights, ends = np.tile(span, (len(archive), 1)), extremes(archive.F)
        weights[ends, np.arange(m)] = 0.0 if m > 1 else span
        near = [solves.neighbours(z) for z in archive.Z] if solves.left else []
        if not (count := sum(map(len, near))):
            break
        solves.promise(count)
        rows = np.repeat(np.arange(len(near)), [len(one) for one in near])
        found = solves(np.vstack(near), archive.F[rows], weights[rows])
        change = (archive.F[rows] - found.F) / span
        gained = (found.status == CONVERGED) & (change.min(axis=1) >= -BETTER) & (change.max(axis=1) > BETTER)
        solves.results.keep(gained)
        if not gained.any():
            break
        archive = _front(Archive.of(found, gained).joined(archive), span)
    return archive


def _slide(archive: Archive, limit: int, exponent: float | None, guide: Guide | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """References (k, m) on the lines between neighbours, in wide gaps first and then where points have less energy; start vectors (k, D);
    and the points (g, 2) on both sides of the gaps."""
    span = ranges(archive.F)
    F, n = archive.F / span, len(archive)
    if n < 2:
        return np.empty((0, F.shape[1])), archive.Z[:0], np.empty((0, 2), dtype=int)
    neighbours = [nearest(point, archive.F, span)[1 : 2 * (F.shape[1] - 1) + 1] for point in archive.F]
    pairs = sorted({(min(i, j), max(i, j)) for i in range(n) for j in neighbours[i]})
    apart = np.array([np.linalg.norm(F[i] - F[j]) for i, j in pairs])
    factors = None if guide is None else guide.factors(archive.F, archive.F)
    if factors is not None:
        apart *= [np.sqrt(factors[i] * factors[j]) for i, j in pairs]
    wide = np.count_nonzero(apart > POLISH.wide * np.median(apart))
    gaps = [pairs[k] for k in np.argsort(-apart, kind="stable")[: max(wide, min(limit - n, n))]]
    references = [0.5 * (F[i] + F[j]) for i, j in gaps]
    starts = [archive.Z[i] for i, _ in gaps]
    power, share = 0.5 * reach(F, exponent), np.linspace(0.0, 0.6, 25)[:, None]
    for i in np.setdiff1d(np.arange(n), extremes(archive.F)):
        others = np.delete(F, i, axis=0)
        lines = np.concatenate([F[i] + share * (F[j] - F[i]) for j in neighbours[i]])
        squared = ((lines[:, None] - others) ** 2).sum(axis=2)
        if guide is not None and factors is not None:
            squared *= guide.factors(archive.F, lines * span)[:, None] * np.delete(factors, i)
        energy = (1.0 / np.maximum(squared, 1e-12) ** power).sum(axis=1)
        best = int(np.argmin(energy))
        if energy[best] < POLISH.gain * energy[0]:
            references.append(lines[best])
            starts.append(archive.Z[i])
    found = np.array(references).reshape(-1, F.shape[1]) * span, np.array(starts).reshape(-1, archive.Z.shape[1])
    return *found, np.array(gaps, dtype=int).reshape(-1, 2)


def _front(points: Archive, span: np.ndarray) -> Archive:
    """The points that are non-dominated and `distinct`."""
    return points.take(distinct(points.F, span))


@dataclass
class Surface:
    """Points on a surface, and the target places of solves. Distances are in the plane across the diagonal, in units of the front between
    its ends."""

    pool: Archive  # the points, the latest first
    ideal: np.ndarray  # (m,): least values of the ends
    between: np.ndarray  # (m,): their ranges
    known: np.ndarray  # (k, m): Places and points in the plane; the ends first
    solved: np.ndarray  # (k, m): Objectives of what solves converged to, and of the ends
    lattice: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.lattice = simplex_lattice(len(self.ideal), divisions_below(len(self.ideal), POLISH.places)) @ self.known

    def plane(self, F: np.ndarray) -> np.ndarray:
        """The objectives (k, m) projected onto the plane."""
        return across((F - self.ideal) / self.between)

    def points(self) -> Archive:
        """The points that are non-dominated and `distinct`."""
        return self.pool.take(distinct(self.pool.F, self.between))

    def even(self) -> tuple[int, np.ndarray]:
        """The place (m,) that is farthest from all known places, and the row of the point that is best for it, at which a solve starts."""
        place = self.lattice[np.argmax(self._apart(self.lattice))]
        return int(((self.pool.F - self.ideal) / self.between - place).max(axis=1).argmin()), place

    def guided(self, guide: Guide) -> tuple[int, np.ndarray]:
        """The same for the place, around the guide's first point, that is farthest from known places, by the factors expected there. It
        starts at the nearest of the points where the guide wants most: the best point for the place alone may lie in a poor valley."""
        first = int(guide.anchors(self.pool.F)[0])
        shape = self.lattice - self.lattice.mean(axis=0)
        places = np.vstack([self.plane(self.pool.F[first : first + 1]) + part * shape for part in POLISH.closer])
        factors = guide.factors(self.pool.F, self.ideal + self.between * self._raised(places))
        place = places[np.argmax(factors * self._apart(places))]
        wanted = guide.factors(self.pool.F, self.pool.F)
        good = np.flatnonzero(wanted == wanted.max())
        start = good[np.linalg.norm(self.plane(self.pool.F[good]) - place, axis=1).argmin()]
        return int(start), place

    def solve(self, solves: BudgetedSolves, count: int, guide: Guide | None) -> None:
        """Add the results of solves to so many next places, side by side."""
        starts, places = list[int](), list[np.ndarray]()
        for _ in range(count):
            start, place = self.even() if guide is None else self.guided(guide)
            starts, places, self.known = [*starts, start], [*places, place], np.vstack([self.known, place])
        found = solves(self.pool.Z[starts], self.ideal + self.between * np.array(places), np.tile(self.between, (count, 1)))
        feasible = solves.feasible(found)
        solves.results.keep(feasible)
        self.known = np.vstack([self.known, self.plane(found.F[feasible])])
        self.pool = Archive.of(found, feasible).joined(self.pool)
        # What ran out of iterations is to go on.
        self.solved = np.vstack([self.solved, found.F[found.status == CONVERGED]])

    def _apart(self, places: np.ndarray) -> np.ndarray:
        """Distances (k,) of places (k, m) from the nearest known ones."""
        return np.linalg.norm(places[:, None] - self.known, axis=2).min(axis=1)

    def _raised(self, places: np.ndarray) -> np.ndarray:
        """Where the diagonals from places (k, m) are expected to meet the front: as far up as its point nearest to the diagonal."""
        front = (self.pool.F - self.ideal) / self.between
        beneath = np.linalg.norm(places[:, None] - across(front), axis=2).argmin(axis=1)
        return places + front.mean(axis=1)[beneath, None]


def cover(archive: Archive, ends: Archive, solves: BudgetedSolves, limit: int, guide: Guide | None) -> Surface:
    """The points of an archive, with the ends of the front, and the results of solves to `limit` places between the ends; with a guide, of
    all solves that are left, to places that it wants."""
    span = ranges(archive.F)
    pool = ends.joined(archive)
    ideal, between = ends.F.min(axis=0), np.ptp(ends.F, axis=0)
    between = np.where(between > 0.0, between, span)
    known = across((ends.F - ideal) / between)
    surface = Surface(pool.take(distinct(pool.F, span)), ideal, between, known, ends.F)
    made, most = 0, max(limit, solves.left)
    while made < most and solves.left > 0:
        # As long as it says nothing, the search is even.
        guided = guide is not None and np.ptp(guide.factors(surface.pool.F, surface.pool.F)) > 0.0
        # Of four at a time, 0.1 % of the hypervolume of two fronts was lost: the next place depends on what the last one led to.
        count = min(TOGETHER // 4, solves.left, (most if guided else limit) - made)
        if count <= 0:
            break
        surface.solve(solves, count, guide if guided else None)
        made += count
    return surface


@dataclass
class PolishLog:
    """Results of the first k solves of a polish, which can be continued with them."""

    SHAPES: ClassVar[dict[str, str]] = {"Z": "k D", "F": "k m", "violation": "k", "status": "k str", "work": "k"}

    archive: Archive  # the archive before the polish
    Z: np.ndarray  # Z, F, violation, status: (k, D), (k, m), (k,), (k,): Results in the order of the solves; see `Evaluation`
    F: np.ndarray
    violation: np.ndarray
    status: np.ndarray
    work: np.ndarray  # (k,): all work before the batch of each

    @classmethod
    def of(cls, archive: Archive) -> PolishLog:
        """The log of a polish that begins with this archive."""
        return cls(archive, archive.Z[:0], archive.F[:0], archive.violation[:0], np.empty(0, dtype="<U10"), np.empty(0))

    def __len__(self) -> int:
        return len(self.F)

    def add(self, found: Evaluation, work: float) -> None:
        """Append the results of further solves, with the work before them."""
        self.Z, self.F = np.vstack([self.Z, found.Z]), np.vstack([self.F, found.F])
        self.violation, self.status = np.append(self.violation, found.violation), np.append(self.status, found.status)
        self.work = np.append(self.work, np.full(len(found.F), float(work)))

    def take(self, rows: slice) -> Evaluation:
        """The results of the solves `rows`."""
        return Evaluation(self.Z[rows], self.F[rows], self.violation[rows], self.status[rows])


class BudgetedSolves:
    """Gradient solves up to a number and, but for those that are promised, up to the most work of the whole search; after a request to end
    early no more are made. `failed_pairs` (k, 2 m) has the objectives of points and of the neighbours from which nothing better was
    found for them, and `results` how many were kept: of a polish that is continued, those before, too."""

    def __init__(
        self,
        evaluator: Evaluator,
        left: int,
        log: PolishLog | None = None,
        failed_pairs: np.ndarray | None = None,
        most_work: float = np.inf,
    ) -> None:
        self._evaluator, self._log, self._most_work = evaluator, log, most_work
        self._made, self._promised, self._answers = 0, 0, dict[bytes, Evaluation]()
        self.left, self.stopped, self.failed_pairs, self.results = left, False, failed_pairs, Counts()

    def __call__(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray) -> Evaluation:
        """The results of `Evaluator.descend`; rows beyond the number of solves count as failed."""
        Z, F = np.array(starts), np.full(references.shape, np.nan)
        violation, status = np.full(len(starts), np.inf), np.full(len(starts), FAILED, dtype="<U10")
        rows = range(max(min(len(starts), self.left), 0))
        tasks = [b"".join(part[row].tobytes() for part in (starts, references, weights)) for row in rows]
        new = [row for row, task in enumerate(tasks) if task not in self._answers and task not in tasks[:row]]
        for k in range(0, len(new), TOGETHER):
            if not (some := new[k : k + min(TOGETHER, self._allowed)]):
                break
            found = self._solve(starts[some], references[some], weights[some])
            self._answers |= {tasks[row]: found.take(slice(i, i + 1)) for i, row in enumerate(some[: len(found.F)])}
            self.left -= len(found.F)
            if len(found.F) < len(some):
                self.left, self.stopped = 0, True
                break
        for row, task in enumerate(tasks):
            if (answer := self._answers.get(task)) is not None:
                Z[row], F[row], violation[row], status[row] = answer.Z[0], answer.F[0], answer.violation[0], answer.status[0]
        return Evaluation(Z, F, violation, status)

    def neighbours(self, z: np.ndarray) -> np.ndarray:
        """The vectors (k, D) in which one whole number of a vector (D,) is one less or one more; none where all variables are real."""
        free, box = self._evaluator.free, self._evaluator.box
        steps = np.eye(len(free))[np.zeros(len(free), dtype=bool) if box.whole is None else box.whole]
        near = z[free] + np.vstack([steps, -steps])
        near = near[((near >= box.lower) & (near <= box.upper)).all(axis=1)]
        Z = np.tile(z, (len(near), 1))
        Z[:, free] = near
        return Z

    def feasible(self, found: Evaluation) -> np.ndarray:
        """Mask (k,) of the feasible results, which may include solves that ran out of iterations."""
        return (found.status == CONVERGED) | (found.violation <= self._evaluator.tolerance)

    def promise(self, count: int) -> None:
        """Let so many more solves be made, whatever work was done, up to their number."""
        self._promised = self._made + count

    @property
    def _work(self) -> float:
        """The work before the next solve, from the log or at present."""
        return self._log.work[self._made] if self._log is not None and self._made < len(self._log) else self._evaluator.counts.work

    @property
    def _allowed(self) -> int:
        """How many solves may be made now: all that are left or, after the most work, those that are promised."""
        return max(0, self.left if self._work < self._most_work else min(self.left, self._promised - self._made))

    def _solve(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray) -> Evaluation:
        """The results of the next solves, from the log or made now, side by side; fewer if asked to end early."""
        work, begun = self._work, self._made
        self._made += len(starts)
        if self._log is None:
            return self._evaluator.descend(starts, references, weights)
        if (known := max(len(self._log) - begun, 0)) < len(starts):
            self._log.add(self._evaluator.descend(starts[known:], references[known:], weights[known:]), work)
        return self._log.take(slice(begun, self._made))
