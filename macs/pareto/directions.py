"""Directions of objectives: simplex lattices, weights of scalar sub-problems (Ricciardi and Vasile 2015), reference directions."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from math import comb

import numpy as np

from .archive import spread
from .ranges import normalised


def across(y: np.ndarray) -> np.ndarray:
    """Points (k, m) projected along the diagonal, on which all objectives fall alike, onto the plane through the origin."""
    return y - y.mean(axis=1, keepdims=True)


def simplex_lattice(m: int, divisions: int) -> np.ndarray:
    """Points with coordinates that are multiples of 1/divisions and sum to 1, (comb(divisions + m - 1, m - 1), m) (Das and Dennis 1998)."""
    bars = np.array(list(combinations(range(divisions + m - 1), m - 1)), dtype=int).reshape(-1, m - 1)
    edges = np.hstack([np.full((len(bars), 1), -1), bars, np.full((len(bars), 1), divisions + m - 1)])
    return (np.diff(edges, axis=1) - 1) / divisions


def pool(m: int, size: int) -> np.ndarray:
    """Unit directions, evenly spread over the positive orthant, the m orthogonal ones first.

    Parameters
    ----------
    m : int
        Number of objectives.
    size : int
        How many are wanted. For m = 2 this is how many there are; for m = 1 there is one; for m >= 3 the finest simplex lattice that has no
        more is taken (with one division at least), and its centre added if it lacks it.

    Returns
    -------
    array (k, m)
        Rows of Euclidean length 1, none negative, all different.
    """
    if m == 1:
        return np.ones((1, 1))
    if m == 2:
        angle = np.linspace(0.0, np.pi / 2, max(size, 2))[1:-1]
        return np.vstack([np.eye(2), np.stack([np.sin(angle), np.cos(angle)], axis=1)])
    divisions = divisions_below(m, size)
    lattice = simplex_lattice(m, divisions)
    inner = lattice[lattice.max(axis=1) < 1.0]
    if divisions % m:
        inner = np.vstack([inner, np.full(m, 1.0 / m)])
    return np.vstack([np.eye(m), inner / np.linalg.norm(inner, axis=1, keepdims=True)])


def draw(directions: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Rows of active directions, (count,) of int: the m orthogonal ones, others at random, and none twice before all are taken."""
    m = directions.shape[1]
    chosen = np.concatenate([np.arange(m), rng.permutation(np.arange(m, len(directions)))])[:count]
    return np.concatenate([chosen, rng.choice(len(directions), count - len(chosen))])


def tchebycheff(F: np.ndarray, directions: np.ndarray, ideal: np.ndarray, nadir: np.ndarray) -> np.ndarray:
    """Tchebycheff scalarisation: the largest weighted objective, of those that have a weight (Miettinen 1999, section 3.4).

    Values better than the ideal point count as negative, so that a new best of one objective is better for the direction that owns it.

    Parameters
    ----------
    F, directions : arrays (..., m)
        Objectives and weights; leading axes broadcast.
    ideal, nadir : arrays (m,)
        Where the objectives are scaled to 0 and 1.

    Returns
    -------
    array (...,)
    """
    weighted = directions * normalised(F, ideal, nadir)
    return np.where(directions > 0.0, weighted, -np.inf).max(axis=-1)


DEFAULT = 100
"""By default: the finest lattice that has no more directions. 100 for two objectives and 91 for three, as is customary."""


FINER = 4
"""A number of directions that no lattice has is chosen from a lattice with so many times as many."""


def lattice_size(m: int, divisions: int) -> int:
    """How many directions a simplex lattice has."""
    return comb(divisions + m - 1, m - 1)


def divisions_below(m: int, count: int) -> int:
    """Divisions of the finest lattice that has no more than `count` directions, at least 1."""
    divisions = 1
    while lattice_size(m, divisions + 1) <= count:
        divisions += 1
    return divisions


def reference_directions(m: int, population: int | None, divisions: int | None) -> np.ndarray:
    """Directions by divisions or by number.

    Parameters
    ----------
    m : int
        Number of objectives, at least 2.
    population : int or None
        How many, at least m, if `divisions` do not say.
    divisions : int or None
        Of the simplex lattice (Das and Dennis 1998).

    Returns
    -------
    array (k, m)
        Rows that sum to 1, in lexicographic order. The lattice that has as many as are wanted, if there is one; otherwise so many points of
        a finer one with a low energy of all pairs, the corners among them.
    """
    return _lattice(m, population, divisions).copy()


@lru_cache(maxsize=32)
def _lattice(m: int, population: int | None, divisions: int | None) -> np.ndarray:
    if divisions is not None or population is None:
        return simplex_lattice(m, divisions_below(m, DEFAULT) if divisions is None else divisions)
    divisions = divisions_below(m, population)
    if lattice_size(m, divisions) == population:
        return simplex_lattice(m, divisions)
    fine = simplex_lattice(m, divisions_below(m, FINER * population))
    return fine[spread(fine, population, fine.max(axis=1) == 1.0)]


def population_size(m: int | None, population: int | None, divisions: int | None) -> int | None:
    """How many individuals there are; None as long as that depends on the number of objectives and this is not known."""
    if population is not None:
        return population
    return None if m is None else lattice_size(m, divisions_below(m, DEFAULT) if divisions is None else divisions)


def check_directions(name: str, m: int, population: int | None, divisions: int | None) -> None:
    """Raise ValueError where there are too few directions, or too few individuals for them.

    Parameters
    ----------
    name : str
        Of the solver, for the message.
    m : int
        Number of objectives that the directions are of.
    population, divisions : int or None
        As the user gave them.
    """
    if m < 2:
        raise ValueError(f"{name} needs at least two objectives, not {m}; NSGA2 and MACS also search for the best of one")
    if population is None:
        return
    if divisions is None:
        if population < m:
            raise ValueError(f"{name}: population={population} is too few: {m} objectives need at least as many reference directions")
        return
    count = lattice_size(m, divisions)
    directions = f"divisions={divisions} makes {count} reference directions with {m} objectives"
    if population < count:
        raise ValueError(f"{name}: {directions}, more than population={population}; leave one of the two out")
    if population > 2 * count:
        fitting = divisions_below(m, population)
        raise ValueError(f"{name}: {directions}, too few for population={population}; divisions={fitting} makes {lattice_size(m, fitting)}")


def pair_up(costs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pair rows with columns of `costs` (r, c), the globally cheapest pair first: two arrays (min(r, c),) of int."""
    costs = costs.astype(float, copy=True)
    rows, columns = [], []
    for _ in range(min(costs.shape)):
        row, column = np.unravel_index(np.argmin(costs), costs.shape)
        rows.append(row)
        columns.append(column)
        costs[row, :] = np.inf
        costs[:, column] = np.inf
    return np.array(rows, dtype=int), np.array(columns, dtype=int)
