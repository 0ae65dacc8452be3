"""Histories of an indicator over many runs as one line and a band: median and quartiles at each moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .statistics import summarise

History = tuple[np.ndarray, np.ndarray]
"""Increasing moments (k,) - evaluations, inner iterations or seconds - and the indicator (k,) from each of them on."""


@dataclass(frozen=True, eq=False)
class Band:
    """Median and quartiles (g,) over the runs at moments `x` (g,); infinite where that share of the runs had no front."""

    x: np.ndarray
    lower: np.ndarray
    median: np.ndarray
    upper: np.ndarray
    runs: int


def band(histories: Sequence[History], *, larger: bool = False, moments: int = 400) -> Band:
    """The band of several runs, each with samples of its own.

    A run keeps its last value until its next sample, and for good after its end. Before its first sample, and where its value is NaN or
    infinite, it has failed, which is worse than any value. histories (k,).
    """
    runs = [(np.asarray(x, dtype=float), np.asarray(y, dtype=float)) for x, y in histories]
    if not runs:
        raise ValueError("there is no run to draw the history of")
    for i, (x, y) in enumerate(runs):
        if x.ndim != 1 or x.shape != y.shape or not len(x) or not np.all(np.diff(x) >= 0):
            raise ValueError(f"run {i}: moments {x.shape} and values {y.shape} must be as many, one at least, and moments increase")
    grid = np.unique(np.concatenate([x for x, _ in runs]))
    if len(grid) > moments:
        grid = grid[np.unique(np.linspace(0, len(grid) - 1, moments).astype(int))]
    values = np.array([at(x, y, grid) for x, y in runs])
    found = [summarise(column, larger=larger) for column in values.T]
    lower, median, upper = (np.array([getattr(s, name) for s in found]) for name in ("lower", "median", "upper"))
    return Band(grid, lower, median, upper, len(runs))


def at(x: np.ndarray, y: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Value of one run at some moments: that of its last sample; NaN before the first."""
    last = np.searchsorted(x, moments, side="right") - 1
    return np.where(last >= 0, y[np.maximum(last, 0)], np.nan)
