"""Rounds of a search without a number of evaluations, and the rule by which it ends: more work no longer changes the front.

A round is a search of some evaluations and, with gradients, a polish. At its end, its points are compared with the front of the last
improvement. A new spacing of the archive's points is no progress: a point counts only if it lies beyond the known front, with straight
lines between its points, by more than a tolerance. All decisions depend on counts, so the same seed ends alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..gradients.scalarised import WORK
from ..pareto.directions import tchebycheff
from ..pareto.dominance import distinct, nondominated, ranges
from ..pareto.spread import dominated_volume

PLANNED_EVALUATIONS = 2_000
"""Settings that follow from a number of evaluations are those of this one."""
DONE, CEILING = "done", "ceiling"
"""Reasons for the end: further work did not improve the front; the largest number of evaluations."""


@dataclass(frozen=True)
class RoundLimits:
    """When a round ends, the tolerance of progress, and when no round follows (measured on the catalogue and standard problems)."""

    first: int = 150  # evaluations of the first round, and least number of a later one, with gradients
    first_without: int = 2_000  # the same without
    growth: int = 4  # a later round has at least this part, one fourth, of all evaluations before it
    # A later round begins with one gradient solve from another start for so many of its evaluations: where each end had starts enough, and
    # where one had not.
    restart: tuple[int, int] = (12, 6)
    patience: float = 2.0  # then, and where a later round made progress: least rounds without progress before the search ends,
    again: float = 0.25  # as a part of the evaluations that the last progress took,
    long: int = 8  # and, where an end had not starts enough, either `WORK.little` of work or so many rounds
    beyond: float = 1e-3  # distance, in ranges of the front, that a point must lie beyond the front to count
    progress: float = 1e-3  # part by which the hypervolume must grow, or the best values of the directions on average, to be progress
    ends: float = 5e-3  # part of its range by which the best value of an objective must fall to be progress
    closer: float = 0.9  # as long as nothing is feasible: factor by which the least violation must fall to be progress
    joined: float = 0.3  # points of the front that are farther from a point, in ranges, are not joined by lines beside it
    flat: float = 1e-3  # least range of an objective on the front, in that of all points found: a front may be one point
    alone: float = 0.01  # least range of a single objective, in its size: starts that end at one optimum have no range


ROUND_LIMITS = RoundLimits()


@dataclass
class Rounds:
    """State of the rounds of a search."""

    SHAPES: ClassVar[dict[str, str]] = {"front": "k m", "extent": "m"}

    finished: int  # rounds that have ended
    end: int  # evaluations at which the current round ends
    improved: int  # evaluations, and work, at the end of the round that last improved the front
    work: int
    opened: int  # evaluations at the end of the first round that found anything feasible; 0 before
    front: np.ndarray  # (k, m): objectives of all points known when the front was last improved, non-dominated
    extent: np.ndarray  # (m,): largest range of each objective over feasible agents and points of the archive so far
    violation: float  # the least violation then, as long as nothing was feasible
    due: int = 0  # gradient solves from other starts with which rounds begin, up to the current one
    restarts: int = 0  # those that were made
    stopped: str = ""  # why the search is at its end; empty as long as it goes on

    @classmethod
    def first(cls, m: int, gradients: bool, ceiling: int) -> Rounds:
        """The first round of a search for m objectives."""
        none, shortest = np.empty((0, m)), ROUND_LIMITS.first if gradients else ROUND_LIMITS.first_without
        return cls(finished=0, end=min(shortest, ceiling), improved=0, work=0, opened=0, front=none, extent=np.zeros(m), violation=np.inf)

    def has_improvement(self, found: np.ndarray) -> bool:
        """Whether any of the points with F (k, m) lies beyond the front, so that a polish may lead to progress."""
        if not (len(found) and len(self.front)):
            return len(found) > 0
        ideal, span = _frame(np.vstack([self.front, found]), self.extent)
        return bool((beyond((found - ideal) / span, (self.front - ideal) / span) > ROUND_LIMITS.beyond).any())


def next_round(
    rounds: Rounds,
    found: np.ndarray,
    feasible: np.ndarray,
    violation: float,
    directions: np.ndarray,
    evaluations: int,
    work: int,
    gradients: bool,
    unsettled: bool,
    ceiling: int,
) -> Rounds:
    """The rounds after the end of one with new objectives (k, m) and feasible agents (a, m): with the next round, or the reason why none
    follows. `unsettled`: an end of the front has several optima, and had not starts enough."""
    shortest, little = (ROUND_LIMITS.first, WORK.little) if gradients else (ROUND_LIMITS.first_without, 0.0)
    seen = np.vstack([found, feasible])
    extent = np.fmax(rounds.extent, np.ptp(seen, axis=0)) if len(seen) else rounds.extent
    rounds = replace(rounds, finished=rounds.finished + 1, extent=extent)
    if len(rounds.front):
        better = improves(found, rounds.front, extent, directions)
    else:
        better = len(found) > 0 or violation < ROUND_LIMITS.closer * rounds.violation
    if better:
        known = np.vstack([rounds.front, found])
        known = known[distinct(known, ranges(known))] if len(known) else known
        opened = rounds.opened or (evaluations if len(known) else 0)
        rounds = replace(rounds, improved=evaluations, work=work, opened=opened, front=known, violation=violation)
    several = unsettled or rounds.improved > rounds.opened
    patience = max(ROUND_LIMITS.patience * shortest, ROUND_LIMITS.again * rounds.improved) if several else shortest
    fruitless = evaluations - rounds.improved
    if fruitless >= patience and (not unsettled or work - rounds.work >= little or fruitless >= ROUND_LIMITS.long * shortest):
        return replace(rounds, stopped=DONE)
    if evaluations >= ceiling or (len(rounds.front) and work >= WORK.search):
        return replace(rounds, stopped=CEILING)
    end = min(evaluations + max(shortest, evaluations // ROUND_LIMITS.growth), ceiling)
    return replace(rounds, end=end, due=rounds.due + (end - evaluations) // ROUND_LIMITS.restart[unsettled])


def improves(found: np.ndarray, front: np.ndarray, extent: np.ndarray, directions: np.ndarray) -> bool:
    """Whether points with F (k, m) improve a front (n, m): those beyond it have gains above the tolerance."""
    hypervolume, mean, end = gains(found, front, extent, directions)
    return hypervolume > ROUND_LIMITS.progress or mean > ROUND_LIMITS.progress or end > ROUND_LIMITS.ends


def gains(found: np.ndarray, front: np.ndarray, extent: np.ndarray, directions: np.ndarray) -> tuple[float, float, float]:
    """The gains of points with F (k, m) that lie beyond a front (n, m)."""
    ideal, span = _frame(np.vstack([front, found]), extent)
    new = found[beyond((found - ideal) / span, (front - ideal) / span) > ROUND_LIMITS.beyond]
    if not len(new):
        return 0.0, 0.0, 0.0
    both = np.vstack([front, new])
    before, after = (tchebycheff(F[:, None], directions, ideal, ideal + span).min(axis=0) for F in (front, both))
    volumes = [dominated_volume((F - ideal) / span) for F in (front, both)]
    end = float(((front.min(axis=0) - both.min(axis=0)) / span).max())
    return 1.0 - volumes[0] / volumes[1], float(np.mean(np.minimum(before - after, 1.0))), end


def _frame(F: np.ndarray, extent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ideal point and ranges (m,) of the best of points with F (k, m), by which a front is normalised."""
    best = F[nondominated(F)]
    span = np.maximum(np.ptp(best, axis=0), ROUND_LIMITS.flat * extent)
    if F.shape[1] == 1:
        span = np.maximum(span, ROUND_LIMITS.alone * np.abs(best).max(axis=0))
    return best.min(axis=0), np.where(span > 0.0, span, ranges(best))


def beyond(F: np.ndarray, front: np.ndarray) -> np.ndarray:
    """Distances (k,) that points F (k, m) lie beyond a front (n, m): by how much all objectives of a point have to be worse for the front
    to dominate it. Points of the front that are near are joined by straight lines, or planes. All are normalised."""
    alone = np.array([(front - point).max(axis=1).min() for point in F])
    return np.array(
        [_joined(point, front, far) if far > ROUND_LIMITS.beyond else far for point, far in zip(F, alone.tolist(), strict=True)]
    )


def _joined(point: np.ndarray, front: np.ndarray, alone: float) -> float:
    """The distance of a point (m,) beyond the points of a front near it, and beyond the lines or planes between these."""
    from scipy.optimize import linprog

    m, apart = len(point), np.linalg.norm(front - point, axis=1)
    rows = np.argsort(apart, kind="stable")[: 4 * m]
    near = front[rows[apart[rows] <= ROUND_LIMITS.joined]]
    if len(near) <= 1:
        return alone
    # The least t such that a mean of the near points, with weights w, is no worse than the point by more than t.
    k = len(near)
    found = linprog(
        np.r_[np.zeros(k), 1.0],
        A_ub=np.c_[(near - point).T, -np.ones(m)],
        b_ub=np.zeros(m),
        A_eq=[[*np.ones(k), 0.0]],
        b_eq=[1.0],
        bounds=[(0.0, None)] * k + [(None, None)],
    )
    return min(alone, float(found.fun)) if found.status == 0 else alone
