"""Archive of a search: feasible, mutually non-dominated points, spread like charges that repel each other (Ricciardi and Vasile 2015)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from ..io.text import counted
from .dominance import extremes, nondominated

HUGE = 1e9
"""Largest energy of a pair, in units of the energy of neighbours."""
ANCHORED = 0.5
"""Part of the places that points may have which a guide wants kept."""


class Guide(Protocol):
    """How densely points are wanted along a front. Objectives are minimised; only points of the front at hand are known."""

    def factors(self, front: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Positive factors (k,) of distances at points (k, m) on a front (n, m): distances that are multiplied by them are to be even."""

    def anchors(self, front: np.ndarray) -> np.ndarray:
        """Rows of the front (n, m) that are to be kept beside the best of each objective, most important first."""


@dataclass(frozen=True, repr=False)
class Archive:
    """Evaluated points as columns. Those that `insert` returns are feasible, mutually non-dominated and different.

    Attributes
    ----------
    Z : array (n, D)
        Full vectors, in the user's units.
    F : array (n, m)
        Objectives, all minimised.
    violation : array (n,)
        Largest scaled residual of any constraint.
    """

    SHAPES: ClassVar[dict[str, str]] = {"Z": "n D", "F": "n m", "violation": "n"}

    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray

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
        """The points of this archive, then the others, all of them."""
        return type(self)(*map(np.concatenate, zip(self.columns(), others.columns(), strict=True)))

    def replaced(self, rows: np.ndarray, others: Any) -> Archive:
        """The points, with those of the mask `rows` (n,) replaced by those in the same rows of `others`, such as an `Evaluation`."""
        Z, F = (np.where(rows[:, None], new, old) for new, old in ((others.Z, self.Z), (others.F, self.F)))
        return Archive(Z, F, np.where(rows, others.violation, self.violation))


def reach(F: np.ndarray, exponent: float | None) -> float:
    """Exponent of the energy of points F (n, m): the given one or the default; see `pair_energies`."""
    return exponent or (2.0 if np.count_nonzero(np.ptp(F, axis=0)) <= 2 else 8.0)


def pair_energies(F: np.ndarray, exponent: float | None = None, count: int | None = None, factors: np.ndarray | None = None) -> np.ndarray:
    """Energies 1/d^s of all pairs, (n, n), zero on the diagonal; d is the distance of two rows of F (n, m) scaled by their ranges.

    By default the exponent s is 2, as in the paper, if at most two objectives vary, and 8 otherwise: a low exponent has a long reach, which
    drives the points of a surface to its edges; a high one spreads them evenly (Hardin and Saff 2004). An objective that does not vary adds
    nothing to the distances. The unit of distance is that between neighbours when `count` points (default: all) are evenly spread. The
    energy of coinciding points is large but finite, since a larger one would hide the others in rounding errors.

    With factors (n,) of a `Guide`, the distance of two points is multiplied by the geometric mean of theirs. Where points are many, those
    of least energy are then as near to each other as the factors say (Borodachov, Hardin and Saff 2008).
    """
    span = F.max(axis=0) - F.min(axis=0)
    varying = np.flatnonzero(span > 0.0)
    s = reach(F, exponent)
    squared = np.zeros((len(F), len(F)))
    for k in varying:
        column = F[:, k] / span[k]
        squared += (column[:, None] - column) ** 2
    if factors is not None:
        squared *= factors[:, None] * factors
    unit = (count or len(F)) ** (-2.0 / max(varying.size - 1, 1))
    energies = (unit / np.maximum(squared, unit * HUGE ** (-2.0 / s))) ** (s / 2.0)
    np.fill_diagonal(energies, 0.0)
    return energies


def spread(
    F: np.ndarray, limit: int, members: np.ndarray | None = None, exponent: float | None = None, guide: Guide | None = None
) -> np.ndarray:
    """Mask (n,) of `limit` of the points F (n, m), n > limit, with a low energy of all pairs; the best of each objective is always kept.

    Free places are filled one at a time by the point that adds least energy. Then chosen points are exchanged for others, the best exchange
    first, as long as an exchange lowers the energy. So the energy is at most that of `members`, if these are `limit` points that include
    the best of each objective; a best one that is missing is added at any cost.

    Parameters
    ----------
    F : array (n, m)
        Mutually non-dominated objectives.
    limit : int
        Number of points to choose, at least 1. If it is less than m, only the best points of the first objectives are kept.
    members : array (n,) of bool, optional
        Points to begin with, at most `limit`. Default: the best of each objective only.
    exponent : float, optional
        See `pair_energies`.
    guide : Guide, optional
        How densely points are wanted, and which are kept. Default: evenly.

    Returns
    -------
    array (n,) of bool
    """
    energies = pair_energies(F, exponent, limit, None if guide is None else guide.factors(F, F))
    fixed = np.zeros(len(F), dtype=bool)
    fixed[extremes(F)[:limit]] = True
    for row in [] if guide is None else guide.anchors(F):
        if np.count_nonzero(fixed) < ANCHORED * limit:
            fixed[row] = True
    inside = fixed.copy() if members is None else fixed | members
    energy = energies[:, inside].sum(axis=1)
    while np.count_nonzero(inside) > limit:  # a best point that was added replaces another
        _flip(inside, energy, energies, np.argmax(np.where(inside & ~fixed, energy, -np.inf)))
    while np.count_nonzero(inside) < limit:
        _flip(inside, energy, energies, np.argmin(np.where(inside, np.inf, energy)))
    _exchange(inside, fixed, energy, energies)
    return inside


def _flip(inside: np.ndarray, energy: np.ndarray, energies: np.ndarray, point: np.intp) -> None:
    """Add or remove a point, in place; `energy` (n,) is that of each point with all points inside."""
    inside[point] = not inside[point]
    if inside[point]:
        energy += energies[point]
    else:
        energy -= energies[point]


def _exchange(inside: np.ndarray, fixed: np.ndarray, energy: np.ndarray, energies: np.ndarray) -> None:
    """Exchange points, in place, while that lowers the total energy; because of the threshold, rounding cannot exchange two for ever."""
    for _ in range(10 * len(inside)):
        out, others = np.flatnonzero(inside & ~fixed), np.flatnonzero(~inside)
        if not (out.size and others.size):
            return
        change = energy[others] - energy[out, None] - energies[np.ix_(out, others)]
        i, j = np.unravel_index(np.argmin(change), change.shape)
        if change[i, j] >= -1e-9 * energy[out[i]]:
            return
        _flip(inside, energy, energies, out[i])
        _flip(inside, energy, energies, others[j])


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
    """The archive after points have been offered to it.

    Parameters
    ----------
    archive : Archive
    Z, F, violation : arrays (k, D), (k, m), (k,)
        Offered points. Those that are infeasible, failed (NaN), or dominated by or equal to another one are refused.
    limit : int
        Largest number of points, at least m.
    tolerance : float
        A point with a violation of at most this is feasible.
    exponent : float, optional
        See `pair_energies`.
    guide : Guide, optional
        See `spread`.

    Returns
    -------
    Archive
        Points of the old archive come first, in their order. The best value of each objective that was ever offered is in it.
    """
    offered = np.flatnonzero((violation <= tolerance) & np.isfinite(F).all(axis=1))
    if not offered.size:
        return archive
    every = archive.joined(Archive(Z[offered], F[offered], violation[offered]))
    keep = np.flatnonzero(nondominated(every.F))
    if len(keep) > limit:
        keep = keep[spread(every.F[keep], limit, keep < len(archive), exponent, guide)]
    return every.take(keep)


def least_violated(closest: Archive, Z: np.ndarray, F: np.ndarray, violation: np.ndarray) -> Archive:
    """The least violated point, one row, of `closest` and the points Z (k, D), F (k, m), violation (k,); of equal ones the first."""
    every = closest.joined(Archive(Z, F, violation))
    return every.take(np.argsort(every.violation, kind="stable")[:1])
