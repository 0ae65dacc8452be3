"""Directions in objective space: simplex lattices, weights of scalar sub-problems (Ricciardi and Vasile 2015), reference directions."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from math import comb

import numpy as np

from .dominance import normalised
from .spread import spread


def across(y: np.ndarray) -> np.ndarray:
    """Points (k, m) projected along the diagonal (1, ..., 1) onto the plane through the origin that is normal to it."""
    return y - y.mean(axis=1, keepdims=True)


def simplex_lattice(m: int, divisions: int) -> np.ndarray:
    """Points (comb(divisions + m - 1, m - 1), m) whose coordinates are multiples of 1/divisions and sum to 1 (Das and Dennis 1998)."""
    bars = np.array(list(combinations(range(divisions + m - 1), m - 1)), dtype=int).reshape(-1, m - 1)
    edges = np.hstack([np.full((len(bars), 1), -1), bars, np.full((len(bars), 1), divisions + m - 1)])
    return (np.diff(edges, axis=1) - 1) / divisions


def pool(m: int, size: int) -> np.ndarray:
    """Unit directions, evenly spread over the positive orthant, the m orthogonal ones first. Returns (k, m)."""
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


def draw(directions: np.ndarray, count: int, rng: np.random.Generator, shares: np.ndarray | None = None) -> np.ndarray:
    """Rows (count,) of active directions: the m orthogonal ones, then others at random; none is repeated before all have been drawn.

    With `shares` (k,), positive, a direction is drawn the more often, the larger its share.
    """
    m = directions.shape[1]
    others = rng.permutation(np.arange(m, len(directions)))
    if shares is not None and len(others):
        others = m + rng.choice(len(others), size=len(others), replace=False, p=shares[m:] / shares[m:].sum())
    chosen = np.concatenate([np.arange(m), others])[:count]
    return np.concatenate([chosen, rng.choice(len(directions), count - len(chosen))])


def tchebycheff(F: np.ndarray, directions: np.ndarray, ideal: np.ndarray, nadir: np.ndarray) -> np.ndarray:
    """Values (...,) of the Tchebycheff scalarisation: the largest weighted objective among those with a weight (Miettinen 1999, section
    3.4).

    A value below the ideal point is negative, so that a new best value of an objective is an improvement for its direction. F, directions
    (..., m), ideal, nadir (m,).
    """
    weighted = directions * normalised(F, ideal, nadir)
    return np.where(directions > 0.0, weighted, -np.inf).max(axis=-1)


def best_points(F: np.ndarray, directions: np.ndarray, ideal: np.ndarray, nadir: np.ndarray) -> np.ndarray:
    """The row (k,) of F (n, m) that is best in each of the directions (k, m); see `tchebycheff`."""
    return tchebycheff(F[:, None], directions, ideal, nadir).argmin(axis=0)


LATTICE_SIZE = 100
"""Default: the finest lattice with at most so many directions: 100 for two objectives and 91 for three, as usual."""


def lattice_size(m: int, divisions: int) -> int:
    """Number of directions of a simplex lattice."""
    return comb(divisions + m - 1, m - 1)


def divisions_below(m: int, count: int) -> int:
    """Divisions, at least 1, of the finest lattice with at most `count` directions."""
    divisions = 1
    while lattice_size(m, divisions + 1) <= count:
        divisions += 1
    return divisions


def reference_directions(m: int, population: int | None, divisions: int | None) -> np.ndarray:
    """Reference directions (k, m), rows that sum to 1, in lexicographic order."""
    return _lattice(m, population, divisions).copy()


@lru_cache(maxsize=32)
def _lattice(m: int, population: int | None, divisions: int | None) -> np.ndarray:
    if divisions is not None or population is None:
        return simplex_lattice(m, divisions_below(m, LATTICE_SIZE) if divisions is None else divisions)
    divisions = divisions_below(m, population)
    if lattice_size(m, divisions) == population:
        return simplex_lattice(m, divisions)
    finer = divisions_below(m, 4 * population)  # they are chosen from a lattice with up to so many times as many
    # With many objectives, lattices grow by more than that factor from one to the next.
    fine = simplex_lattice(m, finer if lattice_size(m, finer) > population else finer + 1)
    return fine[spread(fine, population, fine.max(axis=1) == 1.0)]


def population_size(m: int | None, population: int | None, divisions: int | None) -> int | None:
    """Number of individuals; None if it depends on the number m of objectives, which is not known."""
    if population is not None:
        return population
    return None if m is None else lattice_size(m, divisions_below(m, LATTICE_SIZE) if divisions is None else divisions)


def check_several(name: str, m: int) -> None:
    """Raise ValueError, with the `name` of the solver, for a single objective."""
    if m < 2:
        raise ValueError(f"{name} needs at least two objectives, not {m}; NSGA2 and MACS also search for the best of one")


def check_directions(name: str, m: int, population: int | None, divisions: int | None) -> None:
    """Raise ValueError if there are too few directions, or too few individuals for them."""
    check_several(name, m)
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
    """Rows and columns, (min(r, c),) each, of pairs in `costs` (r, c): greedily the cheapest remaining pair."""
    costs = costs.astype(float, copy=True)
    rows, columns = [], []
    for _ in range(min(costs.shape)):
        row, column = np.unravel_index(np.argmin(costs), costs.shape)
        rows.append(row)
        columns.append(column)
        costs[row, :] = np.inf
        costs[:, column] = np.inf
    return np.array(rows, dtype=int), np.array(columns, dtype=int)
