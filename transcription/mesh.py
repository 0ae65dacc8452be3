"""Where a mesh needs more: pure functions from edges, order and errors to new edges and a new order.

h and p, as in Darby, Hager and Rao, "An hp-adaptive pseudospectral method for solving optimal control problems", Optim. Control Appl. Meth.
32, 2011: where a solution is smooth a higher degree pays off exponentially; where it is not, only shorter elements help. What is smooth is
told by how fast its Legendre coefficients decay (Liu, Hager and Rao, "Adaptive mesh refinement method for optimal control using decay rates
of Legendre polynomial coefficients", IEEE Trans. Control Syst. Technol. 26(4), 2018).
"""

from __future__ import annotations

import numpy as np

SMOOTH = 0.8
"""Rate of decay of Legendre coefficients from which on a higher degree is worth more than shorter elements."""
SLOWEST = 1e-3
"""A rate below this is none."""
HIGHEST = 10
"""Highest order."""
WORST_SHARE = 0.1
"""Elements whose error is at least this share of the largest are refined together."""
LAYER = 0.3
"""Half width, on [-1, 1], of the element that is put around a place where a control changes steeply."""
MARGIN = 0.1
"""How near the ends of an element, on [-1, 1], it is not cut."""


def refine(
    edges: np.ndarray, order: int, error: np.ndarray, rate: np.ndarray, steep: np.ndarray, *, most: int, shortest: float = 1e-7
) -> tuple[np.ndarray, int]:
    """A finer mesh of one phase.

    The elements of large error are refined; if none reaches the goal, those with the largest ones. Of these, the smooth ones ask for a
    higher order, as far as their rate promises to be enough, if that is not above the highest; the others are cut: around the place where a
    control is steep, else in halves.

    Parameters
    ----------
    edges : array (N + 1,)
        Increasing from 0 to 1.
    order : int
        Degree of the states on all elements.
    error : array (N,)
        What is to become at most 1. Infinite or no number: as bad as can be.
    rate : array (N,)
        At which coefficients decay with the degree; see `errors.decay_rates`.
    steep : array (N,)
        Where, on [-1, 1], a control is much steeper than elsewhere on the element; NaN if it is not.
    most : int
        Number of elements that is not exceeded.
    shortest : float
        Length, relative to the phase, below which elements are not cut.

    Returns
    -------
    edges : array
        All the old ones among them.
    order : int
        The same arrays and order where nothing more may be done.
    """
    error = np.where(np.isnan(error), np.inf, error)
    marked = error >= min(1.0, WORST_SHARE * error.max(initial=0.0))
    more = np.array([degrees(e, r) for e, r in zip(error, rate, strict=True)])
    smooth = np.isnan(steep) & (rate >= SMOOTH) & (order + more <= HIGHEST)
    raised = order + int(min(more[marked & smooth].max(initial=0.0), max(2, order // 2 + 1)))
    cut = [j for j in np.flatnonzero(marked & ~smooth) if edges[j + 1] - edges[j] >= 2.0 * shortest]
    worst_first = sorted(cut, key=lambda j: (-error[j], j))
    return split(edges, {int(j): cuts(steep[j]) for j in worst_first}, most), raised


def degrees(error: float, rate: float) -> float:
    """How many degrees more bring a smooth element's error down to 1: at its ends it falls by exp(-2 rate) with each. At least one."""
    if error <= 1.0 or rate == np.inf:
        return 1.0 if np.isfinite(error) else np.inf
    return max(1.0, float(np.ceil(np.log(error) / (2.0 * rate)))) if rate > SLOWEST else np.inf


def cuts(steep: float) -> list[float]:
    """Where, on (-1, 1), to cut an element: on both sides of the place where a control is steep, else in the middle."""
    if np.isnan(steep):
        return [0.0]
    return [tau for tau in (steep - LAYER, steep + LAYER) if abs(tau) < 1.0 - MARGIN] or [0.0]


def split(edges: np.ndarray, cut: dict[int, list[float]], most: int) -> np.ndarray:
    """Cut elements, in the order in which they are given, as long as there are at most `most` elements."""
    added: list[float] = []
    for j, places in cut.items():
        if len(edges) - 1 + len(added) + len(places) > most:
            continue
        added += [edges[j] + 0.5 * (1.0 + tau) * (edges[j + 1] - edges[j]) for tau in places]
    return np.sort(np.concatenate([edges, added])) if added else edges
