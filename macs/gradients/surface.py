"""Cover of a surface, the front of more than two objectives: gradient solves to places that are spread over it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..evaluation.evaluator import CONVERGED, Evaluation
from ..pareto.archive import Archive
from ..pareto.directions import across, divisions_below, simplex_lattice
from ..pareto.energy import Guide
from ..pareto.ranges import distinct, ranges
from .counted import CountedSolves

PLACES = 500
"""Largest number of places that cover a surface."""


CLOSER = (1 / 3, 1 / 9)
"""With a guide, the places are around its first anchor instead, at these parts of the distances: its region may be small, it may lie beyond
the simplex between the ends, and far from known points it is not known where it ends."""


@dataclass(frozen=True)
class Task:
    """Gradient solve to be made: the row of the point at which it starts, the reference (m,), and the place (m,) that it goes to."""

    start: int
    reference: np.ndarray
    place: np.ndarray


@dataclass
class Surface:
    """Points on a surface, and the places that solves went to. Distances are in the plane across the diagonal, in units of the front
    between its ends."""

    pool: Archive  # the points, the last that was found first
    ideal: np.ndarray  # ideal, between: (m,): Least values of the ends, and their ranges
    between: np.ndarray
    known: np.ndarray  # (k, m): Places and points in the plane; the ends first
    solved: np.ndarray  # (k, m): Objectives of what solves converged to, and of the ends
    lattice: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.lattice = simplex_lattice(len(self.ideal), divisions_below(len(self.ideal), PLACES)) @ self.known

    def plane(self, F: np.ndarray) -> np.ndarray:
        """The objectives (k, m) projected onto the plane."""
        return across((F - self.ideal) / self.between)

    def points(self) -> Archive:
        """The points that are non-dominated and `distinct`."""
        return self.pool.take(distinct(self.pool.F, self.between))

    def even(self) -> Task:
        """To the place that is farthest from all known ones, from the point that is best for it."""
        place = self.lattice[np.argmax(self._apart(self.lattice))]
        reference = self.ideal + self.between * place
        start = ((self.pool.F - reference) / self.between).max(axis=1).argmin()
        return Task(int(start), reference, place)

    def guided(self, guide: Guide) -> Task:
        """To the place, around the point that the guide puts first, that is farthest from known ones, by the factors that are expected
        there; from the nearest of the points where the guide wants most: what is good for the place alone may lie in a poor valley."""
        first = int(guide.anchors(self.pool.F)[0])
        shape = self.lattice - self.lattice.mean(axis=0)
        places = np.vstack([self.plane(self.pool.F[first : first + 1]) + closer * shape for closer in CLOSER])
        factors = guide.factors(self.pool.F, self.ideal + self.between * self._raised(places))
        place = places[np.argmax(factors * self._apart(places))]
        wanted = guide.factors(self.pool.F, self.pool.F)
        good = np.flatnonzero(wanted == wanted.max())
        start = good[np.linalg.norm(self.plane(self.pool.F[good]) - place, axis=1).argmin()]
        return Task(int(start), self.ideal + self.between * place, place)

    def add(self, task: Task, found: Evaluation, feasible: bool) -> None:
        """Add the result of a solve."""
        self.known = np.vstack([self.known, task.place])
        if feasible:
            self.known = np.vstack([self.known, self.plane(found.F)])
            self.pool = Archive.of(found, np.arange(1)).joined(self.pool)
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


def cover(archive: Archive, ends: Archive, solves: CountedSolves, limit: int, guide: Guide | None) -> Surface:
    """The points of an archive, with the ends of the front, and the results of solves to `limit` places between the ends.

    With a guide, all solves that are left go to places that it wants.
    """
    span = ranges(archive.F)
    pool = ends.joined(archive)
    ideal, between = ends.F.min(axis=0), np.ptp(ends.F, axis=0)
    between = np.where(between > 0.0, between, span)
    known = across((ends.F - ideal) / between)
    surface = Surface(pool.take(distinct(pool.F, span)), ideal, between, known, ends.F)
    for k in range(max(limit, solves.left)):
        # As long as it says nothing, the search is even.
        guided = guide is not None and np.ptp(guide.factors(surface.pool.F, surface.pool.F)) > 0.0
        if solves.left <= 0 or (k >= limit and not guided):
            break
        task = surface.guided(guide) if guide is not None and guided else surface.even()
        found = solves(surface.pool.Z[task.start : task.start + 1], task.reference[None], between[None])
        surface.add(task, found, bool(solves.feasible(found)[0]))
    return surface
