"""The adaptive grid of an archive: hypercubes in the space of objectives, between the least and the greatest values that are there.

Coello Coello, Pulido and Lechuga, IEEE Trans. Evolutionary Computation 8 (2004), after Knowles and Corne (2000).
"""

from __future__ import annotations

import numpy as np


def hypercubes(F: np.ndarray, cells: int) -> np.ndarray:
    """The hypercube of each of the points F (n, m), (n,) of int: those that are occupied are numbered from 0.

    Each objective's range is cut into `cells` equal parts; the greatest value belongs to the last. An objective that does not vary has one.
    """
    low, span = F.min(axis=0), np.ptp(F, axis=0)
    share = np.divide(F - low, span, out=np.zeros_like(F), where=span > 0.0)
    places = np.minimum((share * cells).astype(int), cells - 1)
    return np.unique(places, axis=0, return_inverse=True)[1].reshape(-1)


def roulette(cube: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw `count` points, with repetitions, by their hypercubes (n,): rows (count,).

    A hypercube is drawn in inverse proportion to the points in it, then one of these, all alike.
    """
    occupancy = np.bincount(cube)
    wheel = np.cumsum(1.0 / occupancy)
    drawn = np.searchsorted(wheel[:-1], wheel[-1] * rng.random(count), side="right")
    first = np.cumsum(occupancy) - occupancy
    within = (rng.random(count) * occupancy[drawn]).astype(int)
    return np.argsort(cube, kind="stable")[first[drawn] + within]


def thin_out(cube: np.ndarray, limit: int, rng: np.random.Generator) -> np.ndarray:
    """Which of the points in hypercubes (n,) to keep, (n,) of bool, `limit` of them.

    One at a time is left out, any of those in the fullest hypercube, which is drawn if there are several. (A roulette by occupancy would
    give every point the same chance, whatever its neighbours.)
    """
    keep, occupancy = np.ones(len(cube), dtype=bool), np.bincount(cube)
    for _ in range(len(cube) - limit):
        fullest = rng.choice(np.flatnonzero(occupancy == occupancy.max()))
        keep[rng.choice(np.flatnonzero(keep & (cube == fullest)))] = False
        occupancy[fullest] -= 1
    return keep
