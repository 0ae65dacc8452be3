"""The scalarised problems of a sweep: between the ends of a front, evenly spread."""

from __future__ import annotations

from itertools import product

import numpy as np

from ..pareto.directions import divisions_below, simplex_lattice

MOVED = 0.05
"""Where the ends of a front move by more than this part of its range, the points between them move along."""
METHODS = ("pascoletti-serafini", "epsilon")


Task = tuple[np.ndarray, np.ndarray]
"""Reference and weights, as `transcription.nlp.scalarized.scalarize` takes them."""


def check_points(points: int, m: int) -> None:
    """Raise ValueError if so many points are too few for a front of m objectives."""
    if m == 1:
        raise ValueError("a problem with one objective has no front to sweep; use optimize")
    if points < m:
        raise ValueError(f"points must be at least {m}, one for each objective, not {points}")


def targets(ends: np.ndarray, ranges: np.ndarray, points: int, method: str) -> list[Task]:
    """Scalarised problems whose solutions, with the ends, make a front of at most `points` points. ends (m, m), ranges (m,)."""
    if np.count_nonzero(ranges) < 2:
        return []
    return (_from_simplex if method == "pascoletti-serafini" else _at_limits)(ends, ranges, points)


def _from_simplex(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Task]:
    """Tasks from a lattice on the simplex between the ends, with the ranges as weights."""
    m = len(ends)
    inner = [share for share in simplex_lattice(m, divisions_below(m, points)) if share.max() < 1.0]
    # An objective with zero range has weight 0: its reference is a hard limit.
    level = np.where(ranges > 0, ends, ends.max(axis=0))
    return [(share @ level, ranges) for share in inner]


def _at_limits(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Task]:
    """Tasks for the first objective that is in conflict, at all combinations of evenly spread limits of the others."""
    m = len(ends)
    first, *others = np.flatnonzero(ranges > 0)
    levels = int((points - m) ** (1.0 / len(others)) + 1e-9)
    # With two objectives the loosest limit gives an end; with more, combinations with it are new points.
    shares = np.arange(1, levels + 1) / (levels + (len(others) == 1))
    tasks = []
    for combination in product(shares, repeat=len(others)):
        reference = ends.max(axis=0)
        reference[first] = 0.0
        reference[others] -= (1.0 - np.array(combination)) * ranges[others]
        tasks.append((reference, np.where(np.arange(m) == first, ranges, 0.0)))
    return tasks


def moved_along(F: np.ndarray, old: np.ndarray, new: np.ndarray, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where points of a front are solved from when it is solved again, and along which weights.

    That is where they are, unless the ends of the front have moved; then it is the same place between these. F (k, m), old, new (m, m),
    units (m,).
    """
    if not len(old) or len(units) == 1 or np.abs((new - old) / units).max() <= MOVED:
        return F, units
    before, after = np.ptp(old, axis=0), np.ptp(new, axis=0)
    if not ((before > 0) & (after > 0)).all():
        return F, units
    return new.min(axis=0) + (F - old.min(axis=0)) * (after / before), after
