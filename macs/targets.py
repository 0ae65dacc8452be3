"""Which scalarised problems make a front: references and weights spread evenly between its ends."""

from __future__ import annotations

from itertools import product
from math import comb

import numpy as np

from .pareto.directions import simplex_lattice

METHODS = ("pascoletti-serafini", "epsilon")

Task = tuple[np.ndarray, np.ndarray]
"""Reference and weights, as `transcription.nlp.scalarized.scalarize` takes them."""


def check_points(points: int, m: int) -> None:
    """Raise ValueError for a number of points with which m objectives make no front."""
    if m == 1:
        raise ValueError("a problem with one objective has no front to sweep; use optimize")
    if points < m:
        raise ValueError(f"points must be at least {m}, one for each objective, not {points}")


def targets(ends: np.ndarray, ranges: np.ndarray, points: int, method: str) -> list[Task]:
    """Problems whose answers, with the ends, make a front of at most `points` points.

    Parameters
    ----------
    ends : array (m, m)
        Objectives, minimised, of the end that is best in each of them.
    ranges : array (m,)
        Of the objectives between the ends; 0 for one that is in conflict with no other.
    points : int
        Ends included.
    method : "pascoletti-serafini" or "epsilon"

    Returns
    -------
    list of (reference (m,), weights (m,))
        Neighbours in the list are neighbours on the front, as far as there is such an order. Empty if the objectives are not in conflict.
    """
    if np.count_nonzero(ranges) < 2:
        return []
    return (_down if method == "pascoletti-serafini" else _limited)(ends, ranges, points)


def _down(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Task]:
    """From a lattice on the simplex between the ends, all ranges at once."""
    m = len(ends)
    divisions = 1
    while comb(divisions + m, m - 1) <= points:
        divisions += 1
    inner = [share for share in simplex_lattice(m, divisions) if share.max() < 1.0]
    # An objective without a range has no weight, so that the least value is its limit.
    level = np.where(ranges > 0, ends, ends.max(axis=0))
    return [(share @ level, ranges) for share in inner]


def _limited(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Task]:
    """The first objective that is in conflict, at all combinations of evenly spread limits of the others."""
    m = len(ends)
    first, *others = np.flatnonzero(ranges > 0)
    levels = int((points - m) ** (1.0 / len(others)) + 1e-9)
    # Of two objectives, the loosest limit gives an end; of more, combinations with it are new.
    shares = np.arange(1, levels + 1) / (levels + (len(others) == 1))
    tasks = []
    for combination in product(shares, repeat=len(others)):
        reference = ends.max(axis=0)
        reference[first] = 0.0
        reference[others] -= (1.0 - np.array(combination)) * ranges[others]
        tasks.append((reference, np.where(np.arange(m) == first, ranges, 0.0)))
    return tasks
