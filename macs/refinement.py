"""Refinement by gradients: an individual action of agents during the search, and a polish of the archive at its end.

Every solve goes from a feasible point down to the front (Pascoletti and Serafini 1984): F - reference <= alpha weights, least alpha. With
the point's own objectives as reference it is guarded: no objective gets worse, whichever basin the solve began in. What it finds is taken
only if it is feasible and keeps that promise.
"""

from __future__ import annotations

from itertools import count
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from . import archive as archives
from . import social
from .agent import NO_DIRECTION
from .archive import Archive
from .box import Box
from .directions import normalised, simplex_lattice
from .dominance import extremes, nondominated
from .evaluation import CONVERGED, FAILED, Evaluation, Evaluator

if TYPE_CHECKING:
    from .search import SearchState

CURVE = 2
"""With so many objectives the front is a curve, and with more a surface."""
PLACES = 500
"""How many places a surface has, at most."""
FLAT = 0.05
"""Least component of a direction that still counts: a smaller one would let its objective go anywhere."""
SAME, PROMISE = 1e-7, 10.0
"""Objectives that differ by less than this part of their ranges are equal; so many times its violation more may be what a point, feasible
within the tolerance only, promises too much."""
BETTER = 1e-6
"""By what part of the ranges a point has to be better to be worth another round."""
ROUNDS = 6
"""How often, at most, neighbours help and points slide along the front."""
WIDE = 1.5
"""A gap this many times as wide as the median one gets a point of its own; crowded ones give way."""
GAIN = 0.995
"""A slide is tried if it is to lower the energy of a point to this part."""


def allowed(evaluations: int, every: int, solves: int) -> int:
    """How many gradient solves a search may make now: one for every so many evaluations, less those that it has made."""
    return max(evaluations // every - solves, 0)


def individual_action(state: SearchState, box: Box, evaluator: Evaluator, F: float) -> list[Evaluation]:
    """One solve for the agent whose turn it is, towards its own direction.

    Of an agent that is feasible it is guarded, and begins, in turn, where the agent is, where its nearest neighbour in the archive is, and
    where a social action would have led it: the last two so that it may leave the basin that it is in. One that is infeasible is made
    feasible on the way, from where it is. In the first turn, those whose direction is one objective go for its best there is, whatever
    becomes of the others: where the ends of the front are, the archive has to know to be spread along it. With more than two objectives,
    all but these look from the ideal point, along their direction: a surface has too many places to wait until each has been visited by
    somebody. After the first turn, there is nothing to be gained at the ends, and another direction is drawn.

    Returns
    -------
    list of Evaluation
        What there is to tell the archive.
    """
    agents, m = state.agents, state.directions.shape[1]
    turn, i = divmod(state.refinements, len(agents))
    state.refinements += 1
    feasible = agents.violation[i] <= evaluator.tolerance
    if not np.isfinite(agents.F[i]).all():
        return []
    start = agents.Z[i].copy()
    others = np.flatnonzero((agents.F[i] != state.archive.F).any(axis=1) & feasible)
    if turn % 3 == 1 and others.size:
        start = state.archive.Z[others[_nearest(state, agents.F[i], state.archive.F[others])[0]]]
    elif turn % 3 == 2 and feasible:
        pool = box.to_unit(state.archive.Z[:, evaluator.free])
        X = box.to_unit(start[evaluator.free])[None]
        start[evaluator.free] = box.to_values(social.current_to_rand(box, X, pool, max(len(pool), 4), F, state.rng)[0])
    direction = np.ones(m) if agents.direction[i] == NO_DIRECTION else state.directions[agents.direction[i]]
    if m > CURVE and turn and np.count_nonzero(direction) == 1:
        direction = state.directions[state.rng.integers(m, len(state.directions))]
    weights = np.where(direction > 0, _ranges(state) / np.maximum(direction, FLAT), 0.0)
    alone = turn == 0 and m > 1 and np.count_nonzero(direction) == 1
    reference = state.ideal if m > CURVE and len(state.archive) >= m and not (weights == 0.0).any() else agents.F[i]
    reference = np.where(direction > 0, reference, np.inf) if alone else reference
    found = evaluator.refine(start[None], reference[None], weights[None])
    promised = agents.F[i] if feasible else np.full(m, np.inf)
    if _kept(found, promised[None], agents.violation[i : i + 1], _ranges(state))[0]:
        agents.place(np.array([i]), found.Z, found.F, found.violation)
    return [found]


class Solves:
    """Gradient solves as long as there are any left.

    Parameters
    ----------
    evaluator : Evaluator
    left : int
    """

    def __init__(self, evaluator: Evaluator, left: int) -> None:
        self._evaluator, self.left = evaluator, left

    def __call__(self, starts: np.ndarray, references: np.ndarray, weights: np.ndarray) -> Evaluation:
        """See `Evaluator.refine`; rows for which nothing is left have failed."""
        count = max(min(len(starts), self.left), 0)
        self.left -= count
        Z, F = np.array(starts), np.full(references.shape, np.nan)
        violation, status = np.full(len(starts), np.inf), np.full(len(starts), FAILED, dtype="<U10")
        if count:
            found = self._evaluator.refine(starts[:count], references[:count], weights[:count])
            Z[:count], F[:count], violation[:count], status[:count] = found.Z, found.F, found.violation, found.status
        return Evaluation(Z, F, violation, status)


def polish(state: SearchState, solves: Solves, limit: int, exponent: float | None = None) -> None:
    """Bring every point of the archive down to the front, and spread them along it as evenly as their number allows.

    First each from where it is, the best of an objective to the best there is; then from where its neighbours are, as long as that finds
    better ones; then points slide along the front to where they repel each other least, or fill what places are left. `exponent` is that of
    the archive. Where there are few solves, only some points come down, well spread, so that half of the solves are left to spread them
    along the front; what did not come down, and is not dominated, then takes what places are left. A surface is first gone down to from
    all over it, once for each point that the archive may hold.
    """
    if not len(state.archive):
        return
    if state.archive.F.shape[1] > CURVE:
        _cover(state, solves, limit, exponent)
        if not solves.left:
            return
    waiting = _descend(state, solves, exponent)
    for _ in range(ROUNDS):
        if not _learn_from_neighbours(state, solves):
            break
    pool, ranges = state.archive, _ranges(state)
    state.archive = _thinned(pool, limit, exponent)
    for _ in range(ROUNDS):
        references, starts = _slides(state, limit, exponent)
        if not (len(references) and solves.left):
            break
        found = solves(starts, references, np.tile(ranges, (len(references), 1)))
        good = found.status == CONVERGED
        pool = _front(_joined(pool, Archive(found.Z[good], found.F[good], found.violation[good])), ranges)
        before, state.archive = state.archive, _thinned(pool, limit, exponent)
        if np.array_equal(before.F, state.archive.F):
            break
    if len(waiting):
        state.archive = _thinned(_front(_joined(state.archive, waiting), ranges), limit, exponent)


def _thinned(pool: Archive, limit: int, exponent: float | None) -> Archive:
    """No more points than the limit, evenly spread."""
    return pool if len(pool) <= limit else pool.take(archives.spread(pool.F, limit, exponent=exponent))


def _descend(state: SearchState, solves: Solves, exponent: float | None) -> Archive:
    """Guarded solves of the points; ends of the front are solved for their own objective first, then for the others. Returns the points
    for which there are too few solves: they are not in the archive any more."""
    archive, ranges = state.archive, _ranges(state)
    most = max((solves.left - 2 * archive.F.shape[1]) // 2, 1)
    chosen = archives.spread(archive.F, most, exponent=exponent) if most < len(archive) else np.ones(len(archive), dtype=bool)
    archive, waiting = archive.take(chosen), archive.take(~chosen)
    found = solves(archive.Z, archive.F, np.tile(ranges, (len(archive), 1)))
    kept = _kept(found, archive.F, archive.violation, ranges)
    archive = Archive(
        np.where(kept[:, None], found.Z, archive.Z),
        np.where(kept[:, None], found.F, archive.F),
        np.where(kept, found.violation, archive.violation),
    )
    ends = _ends(archive, ranges, solves)
    state.archive = _front(_joined(ends, archive), ranges)
    return waiting


def _cover(state: SearchState, solves: Solves, limit: int, exponent: float | None) -> None:
    """Ends of the front, and as many places between them as there may be points: always that which is farthest from what is known."""
    m = state.archive.F.shape[1]
    ends = _ends(state.archive, _ranges(state), solves)
    pool = _front(_joined(ends, state.archive), _ranges(state))
    ideal, ranges = ends.F.min(axis=0), np.ptp(ends.F, axis=0)
    ranges = np.where(ranges > 0.0, ranges, _ranges(state))
    known = _across((ends.F - ideal) / ranges)
    places = simplex_lattice(m, _divisions(m)) @ known
    for _ in range(min(limit, solves.left)):
        place = places[np.argmax(np.linalg.norm(places[:, None] - known, axis=2).min(axis=1))]
        reference = ideal + ranges * place
        start = np.argmin(((pool.F - reference) / ranges).max(axis=1))
        found = solves(pool.Z[start : start + 1], reference[None], ranges[None])
        known = np.vstack([known, place])
        if found.status[0] == CONVERGED:
            known = np.vstack([known, _across((found.F - ideal) / ranges)])
            pool = _joined(Archive(found.Z, found.F, found.violation), pool)
    state.archive = _thinned(_front(pool, ranges), limit, exponent)


def _across(y: np.ndarray) -> np.ndarray:
    """Points (k, m) on the plane that is square to the way down."""
    return y - y.mean(axis=1, keepdims=True)


def _divisions(m: int) -> int:
    """Of the finest lattice that has no more than `PLACES` points."""
    return next(d for d in count(1) if comb(d + m, m - 1) > PLACES)


def _ends(archive: Archive, ranges: np.ndarray, solves: Solves) -> Archive:
    """The best of each objective, and of these the best in the others."""
    m = archive.F.shape[1]
    best = archive.take(extremes(archive.F))
    one = np.eye(m, dtype=bool)
    single = solves(best.Z, np.where(one, best.F, np.inf), np.where(one, ranges, 0.0))
    kept = (single.status == CONVERGED) & (np.diag(single.F) <= np.diag(best.F) + _slack(best.violation) * ranges)
    Z, F = np.where(kept[:, None], single.Z, best.Z), np.where(kept[:, None], single.F, best.F)
    if m == 1:
        return Archive(Z, F, np.where(kept, single.violation, best.violation))
    # From the least value of its own objective, which becomes a limit, all others together.
    both = solves(Z, F, np.where(one, 0.0, ranges))
    violation = np.where(kept, single.violation, best.violation)
    good = _kept(both, F, violation, ranges)
    return Archive(np.where(good[:, None], both.Z, Z), np.where(good[:, None], both.F, F), np.where(good, both.violation, violation))


def _learn_from_neighbours(state: SearchState, solves: Solves) -> bool:
    """Guarded solves of every point from its neighbours' controls, if there are enough for all; whether any was clearly better."""
    archive, ranges = state.archive, _ranges(state)
    pairs = [(i, j) for i in range(len(archive)) for j in _nearest(state, archive.F[i], archive.F)[1 : archive.F.shape[1] + 1]]
    if not 0 < len(pairs) <= solves.left:
        return False
    own, other = (np.array(index) for index in zip(*pairs, strict=True))
    found = solves(archive.Z[other], archive.F[own], np.tile(ranges, (len(own), 1)))
    gain = ((archive.F[own] - found.F) / ranges).min(axis=1)
    better = (found.status == CONVERGED) & (gain > BETTER)
    if not better.any():
        return False
    state.archive = _front(_joined(Archive(found.Z[better], found.F[better], found.violation[better]), archive), ranges)
    return True


def _slides(state: SearchState, limit: int, exponent: float | None) -> tuple[np.ndarray, np.ndarray]:
    """References (k, m) on the lines between neighbours, and vectors (k, D) to start from: in the middle of wide gaps, and where points
    would repel each other less."""
    archive, ranges = state.archive, _ranges(state)
    F, n = archive.F / ranges, len(archive)
    if n < 2:
        return np.empty((0, F.shape[1])), archive.Z[:0]
    neighbours = [_nearest(state, point, archive.F)[1 : 2 * (F.shape[1] - 1) + 1] for point in archive.F]
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
    return np.array(references).reshape(-1, F.shape[1]) * ranges, np.array(starts).reshape(-1, archive.Z.shape[1])


def _kept(found: Evaluation, F: np.ndarray, violation: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Which results (k,) are feasible optima that are nowhere worse than what points with F (k, m) and a violation (k,) promised."""
    with np.errstate(invalid="ignore"):
        return (found.status == CONVERGED) & (F + _slack(violation)[:, None] * ranges >= found.F).all(axis=1)


def _slack(violation: np.ndarray) -> np.ndarray:
    """By what part of the ranges an optimum may be worse than points with a violation (k,), and still be as good."""
    return SAME + PROMISE * violation


def _front(points: Archive, ranges: np.ndarray) -> Archive:
    """Points that no other dominates, to as many digits as they have; of equal ones the first."""
    return points.take(np.flatnonzero(nondominated(np.round((points.F - points.F.min(axis=0)) / ranges / SAME))))


def _joined(one: Archive, two: Archive) -> Archive:
    return Archive(np.vstack([one.Z, two.Z]), np.vstack([one.F, two.F]), np.concatenate([one.violation, two.violation]))


def _ranges(state: SearchState) -> np.ndarray:
    """What counts as much in each objective (m,): the range of the archive, or of the agents while it is empty; where that is nothing, the
    objective's size."""
    F = state.archive.F
    if not len(F):
        F = state.agents.F[np.isfinite(state.agents.F).all(axis=1)]
    span = np.ptp(F, axis=0)
    return np.where(span > 0.0, span, np.maximum(np.abs(F).max(axis=0), 1.0))


def _nearest(state: SearchState, point: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Rows of F (n, m), the nearest to a point first."""
    ranges = _ranges(state)
    zero = np.zeros(len(ranges))
    return np.argsort(np.linalg.norm(normalised(F - point, zero, ranges), axis=1), kind="stable")
