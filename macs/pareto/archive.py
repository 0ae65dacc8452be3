"""Archive of a search: feasible, mutually non-dominated points, evenly spread along the front."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np

from ..io.text import counted
from .dominance import CURVE, alpha_nondominated, among, dominates, nondominated
from .niches import MANY, best_of_niches
from .spread import Guide, best_of_each, of_low_energy, pair_energies, reach, spread, swap_by_hypervolume


@dataclass(frozen=True, repr=False)
class Archive:
    """Evaluated points as columns. The points that `insert` returns are feasible, mutually non-dominated and different."""

    SHAPES: ClassVar[dict[str, str]] = {"Z": "n D", "F": "n m", "violation": "n"}

    Z: np.ndarray  # (n, D): Full vectors, in the user's units
    F: np.ndarray  # (n, m): Objectives, all minimised
    violation: np.ndarray  # (n,): Largest scaled residual of any constraint

    @staticmethod
    def of(points: Any, rows: np.ndarray) -> Archive:
        """The points of `rows` (indices or mask) of anything with the columns `Z`, `F` and `violation`, such as an `Evaluation`."""
        return Archive(points.Z[rows], points.F[rows], points.violation[rows])

    def __len__(self) -> int:
        return len(self.F)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {counted(len(self), 'point')}, {counted(self.F.shape[1], 'objective')}>"

    def columns(self) -> list[np.ndarray]:
        """The arrays of all fields, in their order."""
        return [getattr(self, one.name) for one in fields(self)]

    def take(self, rows: np.ndarray) -> Self:
        """The points of `rows` (indices or mask)."""
        return type(self)(*(values[rows] for values in self.columns()))

    def joined(self, others: Self) -> Self:
        """All points of this archive, then all others."""
        return type(self)(*map(np.concatenate, zip(self.columns(), others.columns(), strict=True)))

    def has(self, F: np.ndarray) -> np.ndarray:
        """Mask (k,) of the objectives F (k, m) that a point of the archive has."""
        return among(F, self.F)

    def replaced(self, rows: np.ndarray, others: Any) -> Archive:
        """The points, with those of the mask `rows` (n,) replaced by those in the same rows of `others`, such as an `Evaluation`."""
        Z, F = (np.where(rows[:, None], new, old) for new, old in ((others.Z, self.Z), (others.F, self.F)))
        return Archive(Z, F, np.where(rows, others.violation, self.violation))


def insert(
    archive: Archive,
    Z: np.ndarray,
    F: np.ndarray,
    violation: np.ndarray,
    *,
    limit: int,
    tolerance: float,
    exponent: float | None = None,
    guide: Guide | None = None,
) -> Archive:
    """The archive after points have been offered to it. Z (k, D), F (k, m), violation (k,)."""
    offered = np.flatnonzero((violation <= tolerance) & np.isfinite(F).all(axis=1))
    if not offered.size:
        return archive
    return _thinned(archive.joined(Archive(Z[offered], F[offered], violation[offered])), len(archive), limit, exponent, guide)


def outside(
    known: Archive, archive: Archive, Z: np.ndarray, F: np.ndarray, violation: np.ndarray, *, limit: int, tolerance: float
) -> Archive:
    """At most `limit` infeasible points, from `known` and Z (k, D), F (k, m), violation (k,), with mutually non-dominated objectives that
    no point of the archive dominates.

    They may lead to feasible points that are better than those of the archive, behind what is infeasible (Li, Chen, Fu and Yao 2019).
    """
    offered = np.flatnonzero((violation > tolerance) & np.isfinite(violation) & np.isfinite(F).all(axis=1))
    both = known.joined(Archive(Z[offered], F[offered], violation[offered]))
    free = np.flatnonzero(~np.any(dominates(archive.F[:, None], both.F), axis=0))
    return _thinned(both.take(free), int((free < len(known)).sum()), limit)


def _thinned(points: Archive, known: int, limit: int, exponent: float | None = None, guide: Guide | None = None) -> Archive:
    """The non-dominated points, thinned to the limit; the first are `known` already."""
    keep = np.flatnonzero(nondominated(points.F))
    if len(keep) > limit and exponent is None and guide is None and points.F.shape[1] > CURVE:
        keep = keep[alpha_nondominated(points.F[keep])]
    if len(keep) > limit:
        keep = keep[truncate(points.F[keep], limit, keep < known, exponent, guide)]
    return points.take(keep)


def truncate(F: np.ndarray, limit: int, members: np.ndarray, exponent: float | None = None, guide: Guide | None = None) -> np.ndarray:
    """Mask (n,) of `limit` of the non-dominated points F (n, m), of which the `members` (n,) are in the archive already.

    With up to three objectives they have little energy, and each is worth more in volume than the points near it that are left out. With
    more, they are the best near evenly spread directions. With an exponent, or a guide, energy alone decides.
    """
    if exponent is not None or guide is not None:
        return spread(F, limit, members, exponent, guide)
    if F.shape[1] > MANY:
        return best_of_niches(F, limit)
    fixed, energies = best_of_each(F, limit), pair_energies(F, count=limit)
    return swap_by_hypervolume(F, of_low_energy(energies, limit, fixed, members), fixed, energies, reach(F, None))


def least_violated(closest: Archive, Z: np.ndarray, F: np.ndarray, violation: np.ndarray, limit: int = 1) -> Archive:
    """At most `limit` least violated points, from `closest` and Z (k, D), F (k, m), violation (k,), in this order; of equal points the
    first. The first row exists even if all evaluations failed, the others have finite violations."""
    every = closest.joined(Archive(Z, F, violation))
    order = np.argsort(every.violation, kind="stable")
    kept = [order[0]] if len(order) else []
    known = {every.Z[row].tobytes() for row in kept}
    for row in order[1:]:
        if len(kept) >= limit or not np.isfinite(every.violation[row]):
            break
        if (place := every.Z[row].tobytes()) not in known:
            known.add(place)
            kept.append(row)
    return every.take(np.array(kept, dtype=int))
