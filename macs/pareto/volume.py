"""Volume that points dominate, and places taken by points that add more to it.

Points that are only spread evenly may stay behind the front: what lies a little behind it, between its neighbours, is not dominated by
them, and has more room than on it. Such a point adds little to the volume that all dominate together (Beume, Naujoks and Emmerich 2007).
The volume alone would draw points to where the front bulges, so a point also counts by the room it has.
"""

from __future__ import annotations

import moocore
import numpy as np

CORNER = 1.1
"""Corner of the dominated volume in each objective, in ranges of the front from its ideal point."""
BETTER = 1.0 + 1e-9
"""Factor by which a point must be worth more than another to take its place."""


def dominated_volume(N: np.ndarray) -> float:
    """The volume that points N (k, m) dominate up to the corner, where 0 to 1 is the range of the front in each objective."""
    return float(moocore.hypervolume(np.ascontiguousarray(N), ref=np.full(N.shape[1], CORNER)))


def duels(F: np.ndarray, chosen: np.ndarray, fixed: np.ndarray, energies: np.ndarray, exponent: float) -> np.ndarray:
    """Mask (n,) of as many of the points F (n, m) as are `chosen`: each of the others, in their order, has taken the place of the nearest
    chosen one if it is worth more there.

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
        if worth > BETTER * added[place] ** exponent * (energy[other] - energies[other, held]):
            rows[place], volume = other, larger
            energy += energies[:, other] - energies[:, held]
            added = moocore.hv_contributions(inside, ref=corner)
        else:
            inside[place] = N[held]
    result = np.zeros(len(F), dtype=bool)
    result[rows] = True
    return result
