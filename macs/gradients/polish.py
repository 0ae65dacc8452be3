"""Gradient polish of an archive: its points are moved to the Pareto front by gradient solves, and spread along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..evaluation.evaluator import CONVERGED, FAILED, Evaluation, Evaluator
from ..pareto import archive as archives
from ..pareto.archive import Archive, Guide
from ..pareto.directions import across, divisions_below, simplex_lattice
from ..pareto.dominance import extremes
from ..pareto.ranges import BETTER, CURVE, distinct, feasible_and_no_worse, nearest, ranges, slack

PLACES = 500
"""Largest number of places that cover a surface."""


CLOSER = (1 / 3, 1 / 9)
"""With a guide, the places are around its first anchor instead, at these parts of the distances: its region may be small, it may lie beyond
the simplex between the ends, and far from known points it is not known where it ends."""


FAIR, LOSS = 1e-4, 0.05
"""Gain in its own objective, in its range, for which an end of the front may be replaced by a point that is far worse in another; what
counts as far."""


ROUNDS = 6
"""Largest number of rounds with starts from neighbours, and of rounds in which points slide along the front."""


WIDE = 1.5
"""A gap this many times as wide as the median one gets a point of its own; crowded points are left out for it."""


NEARER = 0.15
"""Where the middle of a gap was not reached, places are tried at this part of the way from both sides."""


GAIN = 0.995
"""A slide is tried only if it is expected to lower the energy of the point at least to this fraction."""


def polish(
    archive: Archive,
    solves: CountedSolves,
    limit: int,
    exponent: float | None = None,
    guide: Guide | None = None,
    optima: np.ndarray | None = None,
) -> Archive:
    """The archive with its points moved to the Pareto front by gradient solves, and spread along it evenly.

    1. With more than two objectives, the front is a surface: one solve goes to each of `limit` places spread over it. With a guide all
       solves that are left go to places that it wants, and no further steps follow: an even spread would take most of them elsewhere.
    2. One guarded solve from each point that no solve has found; the best point of each objective is first solved for the least value of
       that objective.
    3. Solves for each point from the positions of its neighbours, as long as this finds better points. With more than two objectives and
       few solves, each from the point that is nearest to dominating it.
    4. Points slide along the front to positions of less energy, and new points fill wide gaps and free places; where the middle of a gap
       is too far, places nearer to its sides. The ends are then solved once more from their neighbours.

    If there are few solves, step 2 uses only some points, well spread, and leaves half of the solves for the other steps. The remaining
    points fill free places in the end, if they are not dominated. If the work is asked to end early, no solves are left, and the result is
    made of those before.

    Parameters
    ----------
    archive : Archive
    solves : CountedSolves
    limit : int
        Largest number of points.
    exponent : float, optional
        See `archive.pair_energies`.
    guide : Guide, optional
        How densely points are wanted. Default: evenly.
    optima : array (k, m), optional
        Objectives of points that gradient solves have found already.
    """
    if not len(archive):
        return archive
    solved = np.empty((0, archive.F.shape[1])) if optima is None else optima
    if archive.F.shape[1] > CURVE:
        archive, solved = _cover(archive, solves, solved, limit, exponent, guide)
        if not solves.left:
            return archive
    archive, waiting = _descend(archive, solves, solved, exponent, guide)
    for _ in range(ROUNDS):
        better = _helped_by_neighbours(archive, solves)
        if better is archive:
            break
        archive = better
    pool, span = archive, ranges(archive.F)
    archive = _thinned(pool, limit, exponent, guide)
    for _ in range(ROUNDS):
        references, starts, gaps = _slide(archive, limit, exponent, guide)
        if not (len(references) and solves.left):
            break
        found = solves(starts, references, np.tile(span, (len(references), 1)))
        pool = pool.joined(Archive.of(found, solves.feasible(found)))
        failed = gaps[np.flatnonzero(found.status[: len(gaps)] != CONVERGED)]
        if len(failed) and solves.left:
            near, far = failed.ravel(), failed[:, ::-1].ravel()
            nearer = archive.F[near] + NEARER * (archive.F[far] - archive.F[near])
            found = solves(archive.Z[near], nearer, np.tile(span, (len(near), 1)))
            pool = pool.joined(Archive.of(found, solves.feasible(found)))
        pool = _front(pool, span)
        before, archive = archive, _thinned(pool, limit, exponent, guide)
        if np.array_equal(before.F, archive.F):
            break
    archive = _helped_by_neighbours(archive, solves, extremes(archive.F))
    if len(waiting):
        archive = _thinned(_front(archive.joined(waiting), span), limit, exponent, guide)
    return archive


def _thinned(pool: Archive, limit: int, exponent: float | None, guide: Guide | None) -> Archive:
    """At most `limit` points of the pool, evenly spread, or as the guide wants them."""
    return pool if len(pool) <= limit else pool.take(archives.spread(pool.F, limit, exponent=exponent, guide=guide))


def _descend(
    archive: Archive, solves: CountedSolves, solved: np.ndarray, exponent: float | None, guide: Guide | None
) -> tuple[Archive, Archive]:
    """The points after one guarded solve each, but for those with objectives (k, m) that were `solved` already, with the ends of the front;
    and the points that are left out for want of solves."""
    span = ranges(archive.F)
    most = max((solves.left - 2 * archive.F.shape[1]) // 2, 1)
    fresh = ~_among(archive.F, solved)
    chosen = fresh.copy()
    if most < np.count_nonzero(fresh):
        chosen[fresh] = archives.spread(archive.F[fresh], most, exponent=exponent, guide=guide)
    archive, waiting, chosen = archive.take(chosen | ~fresh), archive.take(fresh & ~chosen), chosen[chosen | ~fresh]
    points = archive.take(chosen)
    found = solves(points.Z, points.F, np.tile(span, (len(points), 1)))
    kept = feasible_and_no_worse(found, points.F, points.violation, span)
    archive = points.replaced(kept, found).joined(archive.take(~chosen))
    return _front(_ends(archive, span, solves, solved).joined(archive), span), waiting


def _among(F: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Mask (n,) of the rows of F (n, m) that are rows of `known` (k, m)."""
    return (F[:, None] == known).all(axis=2).any(axis=1)


def _cover(
    archive: Archive, solves: CountedSolves, solved: np.ndarray, limit: int, exponent: float | None, guide: Guide | None
) -> tuple[Archive, np.ndarray]:
    """The points with the ends of the front, and results of solves to `limit` places between them: always the place farthest from all known
    points. With a guide all solves go to places around the point that it puts first, and distances are multiplied by the factors that are
    expected there. Also the objectives (k, m) of what these and earlier solves found."""
    m, span = archive.F.shape[1], ranges(archive.F)
    ends = _ends(archive, span, solves, solved)
    pool = _front(ends.joined(archive), span)
    ideal, between = ends.F.min(axis=0), np.ptp(ends.F, axis=0)
    between = np.where(between > 0.0, between, span)
    known, solved = across((ends.F - ideal) / between), np.vstack([solved, ends.F])
    lattice = simplex_lattice(m, divisions_below(m, PLACES)) @ known
    for k in range(max(limit, solves.left)):
        # As long as it says nothing, the search is even.
        guided = guide is not None and np.ptp(guide.factors(pool.F, pool.F)) > 0.0
        if solves.left <= 0 or (k >= limit and not guided):
            break
        places, wanted = lattice, np.ones(len(lattice))
        if guide is not None and guided:
            best = across((pool.F[guide.anchors(pool.F)[:1]] - ideal) / between)
            places = np.vstack([best + closer * (lattice - lattice.mean(axis=0)) for closer in CLOSER])
            wanted = guide.factors(pool.F, ideal + between * _raised(places, (pool.F - ideal) / between))
        apart = wanted * np.linalg.norm(places[:, None] - known, axis=2).min(axis=1)
        place = places[np.argmax(apart)]
        reference = ideal + between * place
        start = np.argmin(((pool.F - reference) / between).max(axis=1))
        found = solves(pool.Z[start : start + 1], reference[None], between[None])
        known = np.vstack([known, place])
        if solves.feasible(found)[0]:
            known = np.vstack([known, across((found.F - ideal) / between)])
            pool = Archive.of(found, np.arange(1)).joined(pool)
        # What ran out of iterations is to go on.
        solved = np.vstack([solved, found.F[found.status == CONVERGED]])
    return _thinned(_front(pool, between), limit, exponent, guide), solved


def _raised(places: np.ndarray, front: np.ndarray) -> np.ndarray:
    """Where the diagonals from places (k, m) are expected to meet a front (n, m): as far up as its point nearest to the diagonal."""
    beneath = np.linalg.norm(places[:, None] - across(front), axis=2).argmin(axis=1)
    return places + front.mean(axis=1)[beneath, None]


def _ends(archive: Archive, span: np.ndarray, solves: CountedSolves, solved: np.ndarray) -> Archive:
    """One point for each objective: its least value, and for that the least values of the others; as they are where all were `solved`."""
    m = archive.F.shape[1]
    best = archive.take(extremes(archive.F))
    if _among(best.F, solved).all():
        return best
    one = np.eye(m, dtype=bool)
    single = solves(best.Z, np.where(one, best.F, np.inf), np.where(one, span, 0.0))
    gain = (np.diag(best.F) - np.diag(single.F)) / span
    # Where many points have the least value of an objective, the one that is known may be far better in the others.
    fair = (gain > FAIR) | ((single.F - best.F) / span <= LOSS).all(axis=1)
    kept = (single.status == CONVERGED) & (gain >= -slack(best.violation)) & fair
    ends = best.replaced(kept, single)
    if m == 1:
        return ends
    # The least value of its own objective becomes a limit, and all others are lowered together.
    both = solves(ends.Z, ends.F, np.where(one, 0.0, span))
    return ends.replaced(feasible_and_no_worse(both, ends.F, ends.violation, span), both)


def _helped_by_neighbours(archive: Archive, solves: CountedSolves, chosen: np.ndarray | None = None) -> Archive:
    """The archive after guarded solves of all, or the chosen, points from their neighbours; the archive itself if none is better or solves
    are too few."""
    span, m = ranges(archive.F), archive.F.shape[1]
    rows = range(len(archive)) if chosen is None else np.unique(chosen).tolist()
    pairs = [(i, j) for i in rows for j in nearest(archive.F[i], archive.F, span)[1 : m + 1]]
    if len(pairs) > solves.left and m > CURVE:
        # What another point nearly dominates most likely lies in a poorer valley.
        worse = ((archive.F[None] - archive.F[:, None]) / span).max(axis=2)
        np.fill_diagonal(worse, np.inf)
        pairs = [(i, int(worse[i].argmin())) for i in sorted(rows, key=lambda i: worse[i].min())[: solves.left // 2]]
    if not 0 < len(pairs) <= solves.left:
        return archive
    own, other = (np.array(index) for index in zip(*pairs, strict=True))
    found = solves(archive.Z[other], archive.F[own], np.tile(span, (len(own), 1)))
    gain = ((archive.F[own] - found.F) / span).min(axis=1)
    better = (found.status == CONVERGED) & (gain > BETTER)
    if not better.any():
        return archive
    return _front(Archive.of(found, better).joined(archive), span)


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
    wide = np.count_nonzero(apart > WIDE * np.median(apart))
    gaps = [pairs[k] for k in np.argsort(-apart, kind="stable")[: max(wide, min(limit - n, n))]]
    references = [0.5 * (F[i] + F[j]) for i, j in gaps]
    starts = [archive.Z[i] for i, _ in gaps]
    power, share = 0.5 * archives.reach(F, exponent), np.linspace(0.0, 0.6, 25)[:, None]
    for i in np.setdiff1d(np.arange(n), extremes(archive.F)):
        others = np.delete(F, i, axis=0)
        lines = np.concatenate([F[i] + share * (F[j] - F[i]) for j in neighbours[i]])
        squared = ((lines[:, None] - others) ** 2).sum(axis=2)
        if guide is not None and factors is not None:
            squared *= guide.factors(archive.F, lines * span)[:, None] * np.delete(factors, i)
        energy = (1.0 / np.maximum(squared, 1e-12) ** power).sum(axis=1)
        best = int(np.argmin(energy))
        if energy[best] < GAIN * energy[0]:
            references.append(lines[best])
            starts.append(archive.Z[i])
    found = np.array(references).reshape(-1, F.shape[1]) * span, np.array(starts).reshape(-1, archive.Z.shape[1])
    return *found, np.array(gaps, dtype=int).reshape(-1, 2)


def _front(points: Archive, span: np.ndarray) -> Archive:
    """The points that are non-dominated and `distinct`."""
    return points.take(distinct(points.F, span))


@dataclass
class PolishLog:
    """Results of the first k solves of a polish, which can be continued with them.

    Attributes
    ----------
    archive : Archive
        The archive before the polish.
    Z, F, violation, status : arrays (k, D), (k, m), (k,), (k,)
        Results in the order of the solves; see `Evaluation`.
    """

    archive: Archive
    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray
    status: np.ndarray

    @classmethod
    def of(cls, archive: Archive) -> PolishLog:
        """The log of a polish that begins with this archive."""
        return cls(archive, archive.Z[:0], archive.F[:0], archive.violation[:0], np.empty(0, dtype="<U10"))

    def __len__(self) -> int:
        return len(self.F)

    def add(self, found: Evaluation) -> None:
        """Append the results of further solves."""
        self.Z, self.F = np.vstack([self.Z, found.Z]), np.vstack([self.F, found.F])
        self.violation, self.status = np.append(self.violation, found.violation), np.append(self.status, found.status)

    def take(self, rows: slice) -> Evaluation:
        """The results of the solves `rows`."""
        return Evaluation(self.Z[rows], self.F[rows], self.violation[rows], self.status[rows])


class CountedSolves:
    """Gradient solves up to a number. After a request to end early no more are made.

    Parameters
    ----------
    evaluator : Evaluator
    left : int
        Largest number of solves.
    log : PolishLog, optional
        The solves in it are not made again; all further solves are added to it.

    Attributes
    ----------
    left : int
        Number of solves that may still be made; 0 after a request to end early.
    stopped : bool
        Whether the work was asked to end while solves were left.
    """

    def __init__(self, evaluator: Evaluator, left: int, log: PolishLog | None = None) -> None:
        self._evaluator, self._log = evaluator, log
        self._made = 0
        self.left, self.stopped = left, False

    def __call__(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray) -> Evaluation:
        """The results of `Evaluator.descend`; rows beyond the number of solves have failed."""
        Z, F = np.array(starts), np.full(references.shape, np.nan)
        violation, status = np.full(len(starts), np.inf), np.full(len(starts), FAILED, dtype="<U10")
        for row in range(max(min(len(starts), self.left), 0)):
            one = slice(row, row + 1)
            found = self._solve(starts[one], references[one], weights[one])
            if not len(found.F):
                self.left, self.stopped = 0, True
                break
            self.left -= 1
            Z[one], F[one], violation[one], status[one] = found.Z, found.F, found.violation, found.status
        return Evaluation(Z, F, violation, status)

    def feasible(self, found: Evaluation) -> np.ndarray:
        """Mask (k,) of the feasible results: those that ran out of iterations may be, too."""
        return (found.status == CONVERGED) | (found.violation <= self._evaluator.tolerance)

    def _solve(self, start: np.ndarray, reference: np.ndarray, weights: np.ndarray) -> Evaluation:
        """The result of the next solve, one row, from the log or made now; no row if asked to end early."""
        made, self._made = self._made, self._made + 1
        if self._log is not None and made < len(self._log):
            return self._log.take(slice(made, made + 1))
        found = self._evaluator.descend(start, reference, weights)
        if self._log is not None:
            self._log.add(found)
        return found
