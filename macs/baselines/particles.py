"""How particles fly: inertia, velocity, bounds, and what they remember. Pure functions, in the unit coordinates of a `Box`.

Equation numbers are those of Armellin and Lavagna, "Multidisciplinary optimization of aerocapture maneuvers", J. Artificial Evolution and
Applications 2008, section 4.1.
"""

from __future__ import annotations

import numpy as np

from ..evaluation.box import Box
from ..pareto.dominance import dominates


def inertia(share: float, first: float, last: float) -> float:
    """The weight w of the old velocity when this share of the search is over: on a line from `first` to `last`."""
    return first + (last - first) * min(max(share, 0.0), 1.0)


def velocities(
    box: Box,
    X: np.ndarray,
    V: np.ndarray,
    best: np.ndarray,
    leaders: np.ndarray,
    *,
    weights: tuple[float, float, float],
    chance: np.ndarray,
    largest: float,
) -> np.ndarray:
    """New velocities, for an interval of 1: w V + c1 r1 (best - X) + c2 r2 (leaders - X).

    Eq. (22), which is printed with a slip: its differences have the opposite sign, and particles would flee what they are to follow.

    Parameters
    ----------
    box : Box
    X, V, best, leaders : arrays (n, d)
        Positions and velocities of the particles, the best place of each, and the point of the archive that each follows. Across periodic
        bounds differences go the short way round.
    weights : (w, c1, c2)
    chance : array (2, n, d)
        r1 and r2, in [0, 1].
    largest : float
        In each coordinate; faster ones are slowed down to it.
    """
    w, c1, c2 = weights
    V = w * V + c1 * chance[0] * box.difference(best, X) + c2 * chance[1] * box.difference(leaders, X)
    return np.clip(V, -largest, largest)


def flown(box: Box, X: np.ndarray, V: np.ndarray, rebound: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n, d) after an interval of 1.

    A coordinate that leaves the box is set to the bound, and its velocity is multiplied by a number of `rebound` (n, d), in [-1, 0]. One
    that is periodic comes in at the other end, and keeps its velocity.
    """
    there = X + V
    out = ((there < 0.0) | (there > 1.0)) & ~box.wraps
    return box.put_back(there), np.where(out, V * rebound, V)


def improved(F: np.ndarray, best: np.ndarray, coin: np.ndarray) -> np.ndarray:
    """Whether particles (n,) take F (n, m) for their best instead of `best` (n, m): if it dominates; by `coin` (n,) if neither does.

    Eq. (20).
    """
    return dominates(F, best) | (~dominates(best, F) & coin)
