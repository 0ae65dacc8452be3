"""Gradient polish of an archive: its points are moved to the Pareto front by gradient solves, and spread along it."""

from __future__ import annotations

import numpy as np

from ..evaluation.evaluator import CONVERGED
from ..pareto.archive import Archive
from ..pareto.dominance import CURVE, among, extremes
from ..pareto.energy import Guide, reach, spread
from ..pareto.ranges import BETTER, distinct, feasible_and_no_worse, nearest, ranges, slack
from .counted import CountedSolves
from .surface import cover

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
    nearer to its sides. The ends are then solved once more from their neighbours.

    If there are few solves, step 2 uses only some points, well spread, and leaves half of the solves for the other steps. The remaining
    points fill free places in the end, if they are not dominated. If the work is asked to end early, no solves are left, and the result is
    made of those before.
    """
    if not len(archive):
        return archive
    optima = archive.take(np.arange(0)) if optima is None else optima
    archive, solved = _settled(archive, optima), optima.F
    if archive.F.shape[1] > CURVE:
        ends = _ends(archive, ranges(archive.F), solves, solved)
        surface = cover(archive, ends, solves, limit, guide)
        archive, solved = _thinned(surface.points(), limit, exponent, guide), np.vstack([solved, surface.solved])
        if not solves.left:
            return archive
    archive, waiting = _descend(archive, solves, solved, exponent, guide)
    for _ in range(0 if alike else ROUNDS):
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
    archive = archive if alike else _helped_by_neighbours(archive, solves, extremes(archive.F))
    if len(waiting):
        archive = _thinned(_front(archive.joined(waiting), span), limit, exponent, guide)
    return archive


def _thinned(pool: Archive, limit: int, exponent: float | None, guide: Guide | None) -> Archive:
    """At most `limit` points of the pool, evenly spread, or as the guide wants them."""
    return pool if len(pool) <= limit else pool.take(spread(pool.F, limit, exponent=exponent, guide=guide))


def _descend(
    archive: Archive, solves: CountedSolves, solved: np.ndarray, exponent: float | None, guide: Guide | None
) -> tuple[Archive, Archive]:
    """The points after one guarded solve each, but for those with objectives (k, m) that were `solved` already, with the ends of the front;
    and the points that are left out for want of solves."""
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
    archive = points.replaced(kept, found).joined(archive.take(~chosen))
    return _front(_ends(archive, span, solves, solved).joined(archive), span), waiting


def _settled(archive: Archive, optima: Archive) -> Archive:
    """The archive, with optima in place of points that are no better than these by more than their violation explains."""
    if not len(optima):
        return archive
    span = ranges(archive.F)
    gain = ((optima.F - archive.F[:, None]) / span).max(axis=2)  # of each point over each optimum
    best = gain.argmin(axis=1)
    settled = gain.min(axis=1) <= slack(archive.violation)
    return _front(optima.take(np.unique(best[settled])).joined(archive.take(~settled)), span)


def _ends(archive: Archive, span: np.ndarray, solves: CountedSolves, solved: np.ndarray) -> Archive:
    """One point for each objective: its least value, and for that the least values of the others; as they are where all were `solved`."""
    m = archive.F.shape[1]
    best = archive.take(extremes(archive.F))
    if among(best.F, solved).all():
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
    """The archive after guarded solves of all, or the chosen, points from their neighbours, but for those that were in vain before; the
    archive itself if none is better or solves are too few."""
    span, m = ranges(archive.F), archive.F.shape[1]
    rows = range(len(archive)) if chosen is None else np.unique(chosen).tolist()
    pairs = [(i, j) for i in rows for j in nearest(archive.F[i], archive.F, span)[1 : m + 1]]
    if len(pairs) > solves.left and m > CURVE:
        # What another point nearly dominates most likely lies in a poorer valley.
        worse = ((archive.F[None] - archive.F[:, None]) / span).max(axis=2)
        np.fill_diagonal(worse, np.inf)
        pairs = [(i, int(worse[i].argmin())) for i in sorted(rows, key=lambda i: worse[i].min())[: solves.left // 2]]
    known = solves.in_vain if solves.in_vain is not None else np.empty((0, 2 * m))
    pairs = [(i, j) for i, j in pairs if not among(np.hstack([archive.F[[i]], archive.F[[j]]]), known)[0]]
    if not 0 < len(pairs) <= solves.left:
        return archive
    own, other = (np.array(index) for index in zip(*pairs, strict=True))
    found = solves(archive.Z[other], archive.F[own], np.tile(span, (len(own), 1)))
    gain = ((archive.F[own] - found.F) / span).min(axis=1)
    better = (found.status == CONVERGED) & (gain > BETTER)
    solves.in_vain = np.vstack([known, np.hstack([archive.F[own], archive.F[other]])[~better]])
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
    power, share = 0.5 * reach(F, exponent), np.linspace(0.0, 0.6, 25)[:, None]
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
