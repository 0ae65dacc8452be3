"""Passages for populations: interpolation in the logarithm of the ballistic coefficient, on which alone they depend.

The nodes are Chebyshev's over the whole of `passage.RANGE`, and the values there are the solver's. Between them, too, it agrees with the
solver to 1e-6 of each value, and better: `tests/problems/aerocapture/test_passage_table.py`.
"""

from __future__ import annotations

from dataclasses import fields
from functools import cache

import numpy as np

from transcription.numerics.polynomials import lagrange_matrix, nodes

from .passage import PASSAGE, RANGE, Passage, Passages, passages

DEGREE = 20
COLUMNS = tuple(f.name for f in fields(Passages) if f.name != "ballistic")


def outside(ballistic: np.ndarray) -> np.ndarray:
    """Why ballistic coefficients (n,) have no entry in the table: text, empty where they have one."""
    bc = np.atleast_1d(np.asarray(ballistic, float))
    text = np.array([f"ballistic coefficient {one:g} kg/m2, outside the table ({RANGE[0]:g} to {RANGE[1]:g})" for one in bc], object)
    return np.where((bc >= RANGE[0]) & (bc <= RANGE[1]), "", text)


def tabulated(ballistic: np.ndarray, passage: Passage = PASSAGE) -> Passages:
    """The passages of ballistic coefficients (n,), kg/m2, from the table; it is made when it is first asked for.

    Raises
    ------
    ValueError
        One is outside the table.
    """
    bc = np.atleast_1d(np.asarray(ballistic, float))
    reasons = outside(bc)
    if reasons.any():
        raise ValueError(next(filter(None, reasons)))
    places = 2.0 * np.log(bc / RANGE[0]) / np.log(RANGE[1] / RANGE[0]) - 1.0
    values = lagrange_matrix(nodes("chebyshev", DEGREE), np.clip(places, -1.0, 1.0)) @ _values(passage)
    found = dict(zip(COLUMNS, values.T, strict=True))
    return Passages(bc, **found | {"heat": np.exp(found["heat"])})


@cache
def _values(passage: Passage) -> np.ndarray:
    """Values at the nodes (DEGREE + 1, columns); of the heat load, its logarithm."""
    share = 0.5 * (nodes("chebyshev", DEGREE) + 1.0)
    ballistic = RANGE[0] * (RANGE[1] / RANGE[0]) ** share
    solved = passages(np.clip(ballistic, *RANGE), passage)
    values = np.column_stack([np.log(solved.heat) if name == "heat" else getattr(solved, name) for name in COLUMNS])
    values.setflags(write=False)
    return values
