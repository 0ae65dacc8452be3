"""The order of points by the stages of a preference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .stage import ATTAINED, SLACK, Stage


@dataclass(frozen=True, eq=False)
class Ordering:
    """Points in the order of a preference.

    Attributes
    ----------
    values : array (n, number of stages)
        Of the stages: smaller is better, infinite where a hard limit is exceeded or an objective is not finite, NaN where a stage does not
        follow (see `Stage.after_zero`).
    excess : array (n,)
        By how much the hard limits are exceeded, 0 where they are met.
    order : array (n,) of int
        Rows, best first.
    """

    values: np.ndarray
    excess: np.ndarray
    order: np.ndarray


def ordering(
    stages: Sequence[Stage], objectives: np.ndarray, kind: np.ndarray, tie: np.ndarray | None = None, same: float = ATTAINED
) -> Ordering:
    """Points by their kind, then by the excess over hard limits, then by the stages, each as far as those before tell no difference.

    Parameters
    ----------
    stages : sequence of Stage
    objectives : array (n, m)
    kind : array (n,)
        What comes before all preference, as whether a point is feasible; less is better.
    tie : array (n,), optional
        What tells points apart whose values are equal; else they keep their places.
    same : float
        Values of all stages but the last count as equal if they differ by less than this part of their size, and of 1 at least.
    """
    columns: list[np.ndarray] = []
    for stage in stages:
        found = stage.numbers(objectives)
        follows = columns[-1] <= same if columns and stage.after_zero else np.ones(len(found), dtype=bool)
        columns.append(np.where(follows, found, np.nan))
    excess = np.max([stage.excess(objectives) for stage in stages], axis=0)
    excess = np.where(excess > SLACK, excess, 0.0)
    keys = [*((kind, 0.0), (excess, 0.0)), *((one, same) for one in columns[:-1]), (columns[-1], 0.0)]
    if tie is not None:
        keys.append((tie, 0.0))
    order = _sorted(np.arange(len(excess)), [(np.where(np.isnan(key), 0.0, key), slack) for key, slack in keys])
    return Ordering(np.stack(columns, axis=1), excess, order)


def _sorted(rows: np.ndarray, keys: Sequence[tuple[np.ndarray, float]]) -> np.ndarray:
    """Rows by the first key; those that are as good as the least of them, within its slack, by the next keys, and so on."""
    if not keys or len(rows) < 2:
        return rows
    key, slack = keys[0]
    rows = rows[np.argsort(key[rows], kind="stable")]
    values = key[rows]
    found, begin = [], 0
    while begin < len(rows):
        least, end = values[begin], len(rows)
        if np.isfinite(least):
            end = int(np.searchsorted(values, least + slack * max(abs(least), 1.0), side="right"))
        # Equal values keep their places, so that the next key is what counts.
        found.append(_sorted(np.sort(rows[begin:end]), keys[1:]))
        begin = end
    return np.concatenate(found)
