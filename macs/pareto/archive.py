"""The archive: feasible, mutually non-dominated points, spread like charges that repel each other (Ricciardi and Vasile 2015)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .dominance import extremes, nondominated

HUGE = 1e9
"""Largest energy of a pair, in units of that of neighbours."""


@dataclass(frozen=True)
class Archive:
    """What a search has to show: n points, no more than its limit, none dominated by another, no two alike.

    Attributes
    ----------
    Z : array (n, D)
        Full vectors, in the user's units.
    F : array (n, m)
        Objectives, all minimised.
    violation : array (n,)
        At most the tolerance.
    """

    Z: np.ndarray
    F: np.ndarray
    violation: np.ndarray

    def __len__(self) -> int:
        return len(self.F)

    def take(self, rows: np.ndarray) -> Archive:
        """The points of `rows` (indices or mask)."""
        return Archive(self.Z[rows], self.F[rows], self.violation[rows])


def reach(F: np.ndarray, exponent: float | None) -> float:
    """The exponent of the energy of points F (n, m), the given one or the default; see `pair_energies`."""
    return exponent or (2.0 if np.count_nonzero(np.ptp(F, axis=0)) <= 2 else 8.0)


def pair_energies(F: np.ndarray, exponent: float | None = None, count: int | None = None) -> np.ndarray:
    """Energies 1/d^s of all pairs, (n, n), zero on the diagonal; d is the distance of the rows of F (n, m) scaled by their ranges.

    Without an exponent, s is 2 on a curve, which is the paper's, and 8 where more than two objectives vary: a long reach drives the points
    of a surface to its edges, and only a short one leaves them evenly spread (Hardin and Saff 2004). An objective that does not vary adds
    nothing to any distance. Distances are in units of what there is between neighbours if `count` of the points (default: all) are evenly
    spread, so that coinciding points have an energy that is huge but finite (more would drown the others in rounding).
    """
    span = F.max(axis=0) - F.min(axis=0)
    varying = np.flatnonzero(span > 0.0)
    s = reach(F, exponent)
    squared = np.zeros((len(F), len(F)))
    for k in varying:
        column = F[:, k] / span[k]
        squared += (column[:, None] - column) ** 2
    unit = (count or len(F)) ** (-2.0 / max(varying.size - 1, 1))
    energies = (unit / np.maximum(squared, unit * HUGE ** (-2.0 / s))) ** (s / 2.0)
    np.fill_diagonal(energies, 0.0)
    return energies


def spread(F: np.ndarray, limit: int, members: np.ndarray | None = None, exponent: float | None = None) -> np.ndarray:
    """Choose `limit` of the points F (n, m), n > limit, with a low energy of all their pairs; the best of each objective is always kept.

    Vacancies are filled one at a time by the point that adds least; then members are exchanged for points left over, the best exchange
    first, as long as one lowers the energy. So the result has no higher energy than the `members`, if these were the limit in number and
    had the best of each objective; a best one that they lack comes in whatever it costs.

    Parameters
    ----------
    F : array (n, m)
        Mutually non-dominated objectives.
    limit : int
        How many to choose, at least 1. Of fewer than m, only as many are kept for being best, in the order of the objectives.
    members : array (n,) of bool, optional
        Points to begin with, at most `limit`. Default: the best of each objective only.
    exponent : float, optional
        See `pair_energies`.

    Returns
    -------
    array (n,) of bool
    """
    energies = pair_energies(F, exponent, limit)
    fixed = np.zeros(len(F), dtype=bool)
    fixed[extremes(F)[:limit]] = True
    inside = fixed.copy() if members is None else fixed | members
    energy = energies[:, inside].sum(axis=1)
    while np.count_nonzero(inside) > limit:  # an extreme that came in makes room for itself
        _flip(inside, energy, energies, np.argmax(np.where(inside & ~fixed, energy, -np.inf)))
    while np.count_nonzero(inside) < limit:
        _flip(inside, energy, energies, np.argmin(np.where(inside, np.inf, energy)))
    _exchange(inside, fixed, energy, energies)
    return inside


def _flip(inside: np.ndarray, energy: np.ndarray, energies: np.ndarray, point: np.intp) -> None:
    """Let a point in or out; `energy` (n,) is that of each point with all that are inside."""
    inside[point] = not inside[point]
    if inside[point]:
        energy += energies[point]
    else:
        energy -= energies[point]


def _exchange(inside: np.ndarray, fixed: np.ndarray, energy: np.ndarray, energies: np.ndarray) -> None:
    """Exchange members for others while that lowers the total; the threshold keeps rounding from exchanging two points for ever."""
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
) -> Archive:
    """The archive after it has been offered points.

    Parameters
    ----------
    archive : Archive
    Z, F, violation : arrays (k, D), (k, m), (k,)
        Points offered. Those that are infeasible, failed (NaN), dominated by or equal to another one are refused.
    limit : int
        Largest number of points, at least m.
    tolerance : float
        A violation of at most this is feasible.
    exponent : float, optional
        See `pair_energies`.

    Returns
    -------
    Archive
        Members come first, in their order; the best value ever offered of each objective is always in it.
    """
    offered = np.flatnonzero((violation <= tolerance) & np.isfinite(F).all(axis=1))
    if not offered.size:
        return archive
    every = Archive(
        np.vstack([archive.Z, Z[offered]]), np.vstack([archive.F, F[offered]]), np.concatenate([archive.violation, violation[offered]])
    )
    keep = np.flatnonzero(nondominated(every.F))
    if len(keep) > limit:
        keep = keep[spread(every.F[keep], limit, keep < len(archive), exponent)]
    return every.take(keep)


def least_violated(closest: Archive, Z: np.ndarray, F: np.ndarray, violation: np.ndarray) -> Archive:
    """The least violated, one row, of `closest` and of the points offered: Z (k, D), F (k, m), violation (k,). The first of equal ones."""
    every = Archive(np.vstack([closest.Z, Z]), np.vstack([closest.F, F]), np.concatenate([closest.violation, violation]))
    return every.take(np.argsort(every.violation, kind="stable")[:1])
