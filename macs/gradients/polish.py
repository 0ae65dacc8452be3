"""The last thing that a search with gradients does: its archive is brought down to the front, and spread along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..evaluation.evaluator import CONVERGED, FAILED, Evaluation, Evaluator
from ..pareto import archive as archives
from ..pareto.archive import Archive
from ..pareto.directions import across, divisions_below, simplex_lattice
from ..pareto.dominance import extremes
from ..pareto.ranges import BETTER, CURVE, distinct, feasible_and_no_worse, nearest, ranges, slack

PLACES = 500
"""How many places a surface has, at most."""


ROUNDS = 6
"""How often, at most, neighbours help and points slide along the front."""


WIDE = 1.5
"""A gap this many times as wide as the median one gets a point of its own; crowded ones give way."""


GAIN = 0.995
"""A slide is tried if it is to lower the energy of a point to this part."""


def polish(archive: Archive, solves: CountedSolves, limit: int, exponent: float | None = None) -> Archive:
    """Bring every point of an archive down to the front, and spread them along it as evenly as their number, at most `limit`, allows.

    First each from where it is, the best of an objective to the best there is; then from where its neighbours are, as long as that finds
    better ones; then points slide along the front to where they repel each other least, or fill what places are left. `exponent` is that of
    the archive. Where there are few solves, only some points come down, well spread, so that half of the solves are left to spread them
    along the front; what did not come down, and is not dominated, then takes what places are left. A surface is first gone down to from
    all over it, once for each point that the archive may hold. Where the work is to end early no solves are left, and what those before
    have found is the front.
    """
    if not len(archive):
        return archive
    if archive.F.shape[1] > CURVE:
        archive = _covered(archive, solves, limit, exponent)
        if not solves.left:
            return archive
    archive, waiting = _descended(archive, solves, exponent)
    for _ in range(ROUNDS):
        better = _taught(archive, solves)
        if better is archive:
            break
        archive = better
    pool, span = archive, ranges(archive.F)
    archive = _thinned(pool, limit, exponent)
    for _ in range(ROUNDS):
        references, starts = _slides(archive, limit, exponent)
        if not (len(references) and solves.left):
            break
        found = solves(starts, references, np.tile(span, (len(references), 1)))
        good = found.status == CONVERGED
        pool = _front(_joined(pool, Archive(found.Z[good], found.F[good], found.violation[good])), span)
        before, archive = archive, _thinned(pool, limit, exponent)
        if np.array_equal(before.F, archive.F):
            break
    if len(waiting):
        archive = _thinned(_front(_joined(archive, waiting), span), limit, exponent)
    return archive


def _thinned(pool: Archive, limit: int, exponent: float | None) -> Archive:
    """No more points than the limit, evenly spread."""
    return pool if len(pool) <= limit else pool.take(archives.spread(pool.F, limit, exponent=exponent))


def _descended(archive: Archive, solves: CountedSolves, exponent: float | None) -> tuple[Archive, Archive]:
    """Guarded solves of the points; ends of the front for their own objective first, then for the others. Also returns the points
    for which there are too few solves: they are not among the others any more."""
    span = ranges(archive.F)
    most = max((solves.left - 2 * archive.F.shape[1]) // 2, 1)
    chosen = archives.spread(archive.F, most, exponent=exponent) if most < len(archive) else np.ones(len(archive), dtype=bool)
    archive, waiting = archive.take(chosen), archive.take(~chosen)
    found = solves(archive.Z, archive.F, np.tile(span, (len(archive), 1)))
    kept = feasible_and_no_worse(found, archive.F, archive.violation, span)
    archive = Archive(
        np.where(kept[:, None], found.Z, archive.Z),
        np.where(kept[:, None], found.F, archive.F),
        np.where(kept, found.violation, archive.violation),
    )
    return _front(_joined(_ends(archive, span, solves), archive), span), waiting


def _covered(archive: Archive, solves: CountedSolves, limit: int, exponent: float | None) -> Archive:
    """Ends of the front, and as many places between them as there may be points: always that which is farthest from what is known."""
    m, span = archive.F.shape[1], ranges(archive.F)
    ends = _ends(archive, span, solves)
    pool = _front(_joined(ends, archive), span)
    ideal, between = ends.F.min(axis=0), np.ptp(ends.F, axis=0)
    between = np.where(between > 0.0, between, span)
    known = across((ends.F - ideal) / between)
    places = simplex_lattice(m, divisions_below(m, PLACES)) @ known
    for _ in range(limit):
        if solves.left <= 0:
            break
        place = places[np.argmax(np.linalg.norm(places[:, None] - known, axis=2).min(axis=1))]
        reference = ideal + between * place
        start = np.argmin(((pool.F - reference) / between).max(axis=1))
        found = solves(pool.Z[start : start + 1], reference[None], between[None])
        known = np.vstack([known, place])
        if found.status[0] == CONVERGED:
            known = np.vstack([known, across((found.F - ideal) / between)])
            pool = _joined(Archive(found.Z, found.F, found.violation), pool)
    return _thinned(_front(pool, between), limit, exponent)


def _ends(archive: Archive, span: np.ndarray, solves: CountedSolves) -> Archive:
    """The best of each objective, and of these the best in the others."""
    m = archive.F.shape[1]
    best = archive.take(extremes(archive.F))
    one = np.eye(m, dtype=bool)
    single = solves(best.Z, np.where(one, best.F, np.inf), np.where(one, span, 0.0))
    kept = (single.status == CONVERGED) & (np.diag(single.F) <= np.diag(best.F) + slack(best.violation) * span)
    Z, F = np.where(kept[:, None], single.Z, best.Z), np.where(kept[:, None], single.F, best.F)
    if m == 1:
        return Archive(Z, F, np.where(kept, single.violation, best.violation))
    # From the least value of its own objective, which becomes a limit, all others together.
    both = solves(Z, F, np.where(one, 0.0, span))
    violation = np.where(kept, single.violation, best.violation)
    good = feasible_and_no_worse(both, F, violation, span)
    return Archive(np.where(good[:, None], both.Z, Z), np.where(good[:, None], both.F, F), np.where(good, both.violation, violation))


def _taught(archive: Archive, solves: CountedSolves) -> Archive:
    """Guarded solves of every point from its neighbours' controls, if there are enough for all; the archive itself if none was clearly
    better."""
    span = ranges(archive.F)
    pairs = [(i, j) for i in range(len(archive)) for j in nearest(archive.F[i], archive.F, span)[1 : archive.F.shape[1] + 1]]
    if not 0 < len(pairs) <= solves.left:
        return archive
    own, other = (np.array(index) for index in zip(*pairs, strict=True))
    found = solves(archive.Z[other], archive.F[own], np.tile(span, (len(own), 1)))
    gain = ((archive.F[own] - found.F) / span).min(axis=1)
    better = (found.status == CONVERGED) & (gain > BETTER)
    if not better.any():
        return archive
    return _front(_joined(Archive(found.Z[better], found.F[better], found.violation[better]), archive), span)


def _slides(archive: Archive, limit: int, exponent: float | None) -> tuple[np.ndarray, np.ndarray]:
    """References (k, m) on the lines between neighbours, and vectors (k, D) to start from: in the middle of wide gaps, and where points
    would repel each other less."""
    span = ranges(archive.F)
    F, n = archive.F / span, len(archive)
    if n < 2:
        return np.empty((0, F.shape[1])), archive.Z[:0]
    neighbours = [nearest(point, archive.F, span)[1 : 2 * (F.shape[1] - 1) + 1] for point in archive.F]
    pairs = sorted({(min(i, j), max(i, j)) for i in range(n) for j in neighbours[i]})
    apart = np.array([np.linalg.norm(F[i] - F[j]) for i, j in pairs])
    wide = np.count_nonzero(apart > WIDE * np.median(apart))
    gaps = [pairs[k] for k in np.argsort(-apart, kind="stable")[: max(wide, min(limit - n, n))]]
    references = [0.5 * (F[i] + F[j]) for i, j in gaps]
    starts = [archive.Z[i] for i, _ in gaps]
    power, share = 0.5 * archives.reach(F, exponent), np.linspace(0.0, 0.6, 25)[:, None]
    for i in np.setdiff1d(np.arange(n), extremes(archive.F)):
        others = np.delete(F, i, axis=0)
        lines = np.concatenate([F[i] + share * (F[j] - F[i]) for j in neighbours[i]])
        energy = (1.0 / np.maximum(((lines[:, None] - others) ** 2).sum(axis=2), 1e-12) ** power).sum(axis=1)
        best = int(np.argmin(energy))
        if energy[best] < GAIN * energy[0]:
            references.append(lines[best])
            starts.append(archive.Z[i])
    return np.array(references).reshape(-1, F.shape[1]) * span, np.array(starts).reshape(-1, archive.Z.shape[1])


def _front(points: Archive, span: np.ndarray) -> Archive:
    """Points that are `distinct` and not dominated."""
    return points.take(distinct(points.F, span))


def _joined(one: Archive, two: Archive) -> Archive:
    return Archive(np.vstack([one.Z, two.Z]), np.vstack([one.F, two.F]), np.concatenate([one.violation, two.violation]))


@dataclass
class PolishLog:
    """A polish that is under way, after k solves.

    Attributes
    ----------
    archive : Archive
        What it began with.
    Z, F, violation, status : arrays (k, D), (k, m), (k,), (k,)
        What the solves gave, in their order; see `Evaluation`.
    """

    archive: Archive
    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray
    status: np.ndarray

    @classmethod
    def of(cls, archive: Archive) -> PolishLog:
        """One that begins."""
        return cls(archive, archive.Z[:0], archive.F[:0], archive.violation[:0], np.empty(0, dtype="<U10"))

    def __len__(self) -> int:
        return len(self.F)

    def add(self, found: Evaluation) -> None:
        """Take note of what further solves gave."""
        self.Z, self.F = np.vstack([self.Z, found.Z]), np.vstack([self.F, found.F])
        self.violation, self.status = np.append(self.violation, found.violation), np.append(self.status, found.status)

    def take(self, rows: slice) -> Evaluation:
        """What the solves of `rows` gave."""
        return Evaluation(self.Z[rows], self.F[rows], self.violation[rows], self.status[rows])


class CountedSolves:
    """Gradient solves, as long as there are any left: none are, once the work is to end early.

    Parameters
    ----------
    evaluator : Evaluator
    left : int
    polishing : PolishLog, optional
        The solves that it knows are not made again, all others are added to it.

    Attributes
    ----------
    left : int
    stopped : bool
        Whether the work was to end early, with solves left to make.
    """

    def __init__(self, evaluator: Evaluator, left: int, polishing: PolishLog | None = None) -> None:
        self._evaluator, self._polishing = evaluator, polishing
        self._made = 0
        self.left, self.stopped = left, False

    def __call__(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray) -> Evaluation:
        """See `Evaluator.descend`; rows for which nothing is left have failed."""
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

    def _solve(self, start: np.ndarray, reference: np.ndarray, weights: np.ndarray) -> Evaluation:
        """The next solve, of one row: made, or remembered; no row if the work is to end early."""
        made, self._made = self._made, self._made + 1
        if self._polishing is not None and made < len(self._polishing):
            return self._polishing.take(slice(made, made + 1))
        found = self._evaluator.descend(start, reference, weights)
        if self._polishing is not None:
            self._polishing.add(found)
        return found
