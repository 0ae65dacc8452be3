"""Evenly spread points of a front, by their energy: points repel each other like charges (Ricciardi and Vasile 2015).

Energy alone may leave points behind the front: a point slightly behind it, between its neighbours, is not dominated by them, and has more
room than on the front. Such a point has a small hypervolume contribution (Beume, Naujoks and Emmerich 2007). The hypervolume alone would
draw points to where the front bulges, so the room of a point counts, too.
"""

from __future__ import annotations

from typing import Protocol

import moocore
import numpy as np

from .dominance import extremes


class Guide(Protocol):
    """The wanted density of points along a front. Objectives are minimised; only points of the present front are known."""

    def factors(self, front: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Positive factors (k,) of distances at points (k, m) on a front (n, m): distances times factors should be equal."""

    def anchors(self, front: np.ndarray) -> np.ndarray:
        """Rows of the front (n, m) to keep beside the best of each objective, most important first."""


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
    # Coinciding points have 1e9 times the energy of neighbours: a larger one would hide others in rounding errors.
    energies = (unit / np.maximum(squared, unit * 1e9 ** (-2.0 / s))) ** (s / 2.0)
    np.fill_diagonal(energies, 0.0)
    return energies


def spread(
    F: np.ndarray, limit: int, members: np.ndarray | None = None, exponent: float | None = None, guide: Guide | None = None
) -> np.ndarray:
    """Mask (n,) of `limit` of the points F (n, m), n > limit, with a low energy of all pairs; the best of each objective always stays.

    Free places are filled one at a time by the point that adds least energy. Then chosen points are exchanged for others, the best exchange
    first, as long as an exchange lowers the energy. So the energy is at most that of `members`, if these are `limit` points that include
    the best of each objective; a best one that is missing is added at any cost. members (n,).
    """
    fixed = best_of_each(F, limit)
    for row in [] if guide is None else guide.anchors(F):
        if np.count_nonzero(fixed) < 0.5 * limit:  # a guide may keep half of the places
            fixed[row] = True
    energies = pair_energies(F, exponent, limit, None if guide is None else guide.factors(F, F))
    return of_low_energy(energies, limit, fixed, members)


def best_of_each(F: np.ndarray, limit: int) -> np.ndarray:
    """Mask (n,) of the best of each objective of F (n, m); of the first `limit` objectives if these are fewer."""
    fixed = np.zeros(len(F), dtype=bool)
    fixed[extremes(F)[:limit]] = True
    return fixed


def of_low_energy(energies: np.ndarray, limit: int, fixed: np.ndarray, members: np.ndarray | None = None) -> np.ndarray:
    """Mask (n,) of `limit` points with a low energy of all pairs (n, n), as `spread` chooses them; those of the mask `fixed` (n,) are among
    them."""
    inside = fixed.copy() if members is None else fixed | members
    energy = energies[:, inside].sum(axis=1)
    while np.count_nonzero(inside) > limit:  # a fixed point that was added replaces another
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
    """Exchange points, in place, while that lowers the total energy; a threshold prevents endless exchanges by rounding."""
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


CORNER = 1.1
"""Corner of the dominated volume in each objective, in ranges of the front from its ideal point."""


def dominated_volume(N: np.ndarray) -> float:
    """The volume that points N (k, m) dominate up to the corner, where 0 to 1 is the range of the front in each objective."""
    return float(moocore.hypervolume(np.ascontiguousarray(N), ref=np.full(N.shape[1], CORNER)))


def swap_by_hypervolume(F: np.ndarray, chosen: np.ndarray, fixed: np.ndarray, energies: np.ndarray, exponent: float) -> np.ndarray:
    """Mask (n,) of as many of the points F (n, m) as are `chosen`: each of the others, in their order, replaces the nearest chosen one if
    its worth there is larger.

    Worth is the volume that a point adds times its room: the distance of a single neighbour with the energy of all. chosen, fixed (n,),
    energies (n, n).
    """
    rows = np.concatenate([np.flatnonzero(chosen & ~fixed), np.flatnonzero(chosen & fixed)])
    movable, others = np.count_nonzero(chosen & ~fixed), np.flatnonzero(~chosen)
    if not movable:
        return chosen
    span = np.ptp(F, axis=0)
    N = (F - F.min(axis=0)) / np.where(span > 0.0, span, 1.0)
    inside, corner = N[rows], np.full(F.shape[1], CORNER)
    energy = energies[:, rows].sum(axis=1)
    volume, added = dominated_volume(inside), moocore.hv_contributions(inside, ref=corner)
    for other in others:
        place = energies[other, rows[:movable]].argmax()  # the nearest
        held = rows[place]
        inside[place] = N[other]
        larger = dominated_volume(inside)
        worth = max(larger - volume + added[place], 0.0) ** exponent * energy[held]
        if worth > (1.0 + 1e-9) * added[place] ** exponent * (energy[other] - energies[other, held]):
            rows[place], volume = other, larger
            energy += energies[:, other] - energies[:, held]
            added = moocore.hv_contributions(inside, ref=corner)
        else:
            inside[place] = N[held]
    result = np.zeros(len(F), dtype=bool)
    result[rows] = True
    return result
