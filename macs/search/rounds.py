"""Rounds of a search without a number of evaluations, and the rule by which it ends: more work no longer changes the front.

A round is a search of some evaluations and, with gradients, a polish. At its end the points that were found are compared with the front as
it was when it was last improved. That the archive's points were spread anew is no progress: a point counts only if it lies beyond the known
front, with straight lines between its points, by more than a tolerance. All decisions depend on counts, so the same seed ends alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..gradients.scalarised import WORK
from ..pareto.directions import tchebycheff
from ..pareto.dominance import distinct, nondominated, ranges
from ..pareto.spread import dominated_volume

PLANNED = 2_000
"""Settings that follow from a number of evaluations are those of this one."""
FIRST, FIRST_WITHOUT = 150, 2_000
"""Evaluations of the first round, and least number of a later one, with gradients; without."""
STARTS = 6
"""A later round begins with one gradient solve from another start for so many of its evaluations."""
PATIENCE, AGAIN, LONG = 2, 0.25, 8
"""Where optima are several: evaluations without progress before the search ends, in least rounds, and as a part of what the last progress
took; and the least rounds that are enough where they took less work than other starts may always take, `WORK.little`."""
GROWTH = 4
"""A later round has at least this part, one fourth, of all evaluations before it."""
SOLVES = 8
"""Largest number of gradient solves in the polish of a round, for each point that the archive may have."""
BEYOND = 1e-3
"""Distance, in ranges of the front, that a point must lie beyond the front to count."""
PROGRESS = 1e-3
"""Part by which the hypervolume must grow, or the best values of the directions on average, to be progress."""
ENDS = 5e-3
"""Part of its range by which the best value of an objective must fall to be progress."""
CLOSER = 0.9
"""As long as nothing is feasible: factor by which the least violation must fall to be progress."""
JOINED = 0.3
"""Points of the front that are farther from a point, in ranges, are not joined by lines beside it: there may be a gap."""
FLAT = 1e-3
"""Least range of an objective on the front, in that of all feasible agents and points of archives: a front may be one point."""
ALONE = 0.01
"""Least range of a single objective, in its size: its front is one point, and starts that end at one optimum have no range."""
DONE, CEILING = "done", "ceiling"
"""Reasons for the end: further work did not improve the front; the largest number of evaluations."""


@dataclass
class Rounds:
    """State of the rounds of a search.

    Attributes
    ----------
    finished : int
        Number of rounds that have ended.
    end : int
        Number of evaluations at which the current round ends.
    improved, work : int
        Number of evaluations, and work, at the end of the round that last improved the front.
    opened : int
        Number of evaluations at the end of the first round that found anything feasible; 0 before.
    front : array (k, m)
        Objectives of all points known then, non-dominated.
    extent : array (m,)
        Largest range of each objective over feasible agents and points of the archive so far.
    violation : float
        The least violation then, as long as nothing was feasible.
    due, anew : int
        Number of gradient solves from other starts with which rounds begin, up to the current one; number of those that were made.
    stopped : str
        Why the search is at its end; empty as long as it goes on.
    """

    SHAPES: ClassVar[dict[str, str]] = {"front": "k m", "extent": "m"}

    finished: int
    end: int
    improved: int
    work: int
    opened: int
    front: np.ndarray
    extent: np.ndarray
    violation: float
    due: int = 0
    anew: int = 0
    stopped: str = ""

    @classmethod
    def first(cls, m: int, shortest: int, ceiling: int) -> Rounds:
        """The first round of a search for m objectives."""
        none = np.empty((0, m))
        return cls(finished=0, end=min(shortest, ceiling), improved=0, work=0, opened=0, front=none, extent=np.zeros(m), violation=np.inf)

    def news(self, found: np.ndarray) -> bool:
        """Whether any of the points with F (k, m) lies beyond the front, so that a polish may make progress of it."""
        if not (len(found) and len(self.front)):
            return len(found) > 0
        ideal, span = _frame(np.vstack([self.front, found]), self.extent)
        return bool((beyond((found - ideal) / span, (self.front - ideal) / span) > BEYOND).any())


def least(gradients: bool) -> tuple[int, float]:
    """Least number of evaluations of a round, and without progress before the search ends; and least work then, where optima are
    several."""
    return (FIRST, WORK.little) if gradients else (FIRST_WITHOUT, 0.0)


def judged(
    rounds: Rounds,
    found: np.ndarray,
    feasible: np.ndarray,
    violation: float,
    directions: np.ndarray,
    evaluations: int,
    work: int,
    shortest: int,
    little: float,
    ceiling: int,
    several: bool,
) -> Rounds:
    """The rounds after one has ended: with the next one, or the reason why there is none. found (k, m), feasible (a, m), directions (d,
    m)."""
    seen = np.vstack([found, feasible])
    extent = np.fmax(rounds.extent, np.ptp(seen, axis=0)) if len(seen) else rounds.extent
    rounds = replace(rounds, finished=rounds.finished + 1, extent=extent)
    if len(rounds.front):
        better = improves(found, rounds.front, extent, directions)
    else:
        better = len(found) > 0 or violation < CLOSER * rounds.violation
    if better:
        known = np.vstack([rounds.front, found])
        known = known[distinct(known, ranges(known))] if len(known) else known
        opened = rounds.opened or (evaluations if len(known) else 0)
        rounds = replace(rounds, improved=evaluations, work=work, opened=opened, front=known, violation=violation)
    several = several or rounds.improved > rounds.opened
    patience = max(PATIENCE * shortest, AGAIN * rounds.improved) if several else shortest
    fruitless = evaluations - rounds.improved
    if fruitless >= patience and (not several or work - rounds.work >= little or fruitless >= LONG * shortest):
        return replace(rounds, stopped=DONE)
    if evaluations >= ceiling:
        return replace(rounds, stopped=CEILING)
    end = min(evaluations + max(shortest, evaluations // GROWTH), ceiling)
    return replace(rounds, end=end, due=rounds.due + (end - evaluations) // STARTS)


def improves(found: np.ndarray, front: np.ndarray, extent: np.ndarray, directions: np.ndarray) -> bool:
    """Whether points with F (k, m) improve a front (n, m): the gains of those that lie beyond it are more than little."""
    hypervolume, mean, end = gains(found, front, extent, directions)
    return hypervolume > PROGRESS or mean > PROGRESS or end > ENDS


def gains(found: np.ndarray, front: np.ndarray, extent: np.ndarray, directions: np.ndarray) -> tuple[float, float, float]:
    """The gains by points with F (k, m) that lie beyond a front (n, m)."""
    ideal, span = _frame(np.vstack([front, found]), extent)
    new = found[beyond((found - ideal) / span, (front - ideal) / span) > BEYOND]
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
    span = np.maximum(np.ptp(best, axis=0), FLAT * extent)
    if F.shape[1] == 1:
        span = np.maximum(span, ALONE * np.abs(best).max(axis=0))
    return best.min(axis=0), np.where(span > 0.0, span, ranges(best))


def beyond(F: np.ndarray, front: np.ndarray) -> np.ndarray:
    """Distances (k,) that points F (k, m) lie beyond a front (n, m): by how much all objectives of a point have to be worse for the front
    to dominate it. Points of the front that are near are joined by straight lines, or planes. All are normalised."""
    alone = np.array([(front - point).max(axis=1).min() for point in F])
    return np.array([_joined(point, front, far) if far > BEYOND else far for point, far in zip(F, alone.tolist(), strict=True)])


def _joined(point: np.ndarray, front: np.ndarray, alone: float) -> float:
    """The distance of a point (m,) beyond the points of a front that are near it, and what lies between these."""
    from scipy.optimize import linprog

    m, apart = len(point), np.linalg.norm(front - point, axis=1)
    rows = np.argsort(apart, kind="stable")[: 4 * m]
    near = front[rows[apart[rows] <= JOINED]]
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
