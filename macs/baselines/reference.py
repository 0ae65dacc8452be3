"""Reference directions: points of the unit simplex that an algorithm spreads its population along."""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from ..pareto.archive import spread
from ..pareto.directions import simplex_lattice

DEFAULT = 100
"""Without any wish: the finest lattice that has no more directions. 100 for two objectives and 91 for three, as is customary."""
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
