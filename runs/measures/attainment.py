"""What many runs attain: empirical attainment surfaces (Fonseca and others; exact, by moocore), and an indicator over the cost of runs.

A point is attained by a run if a point of that run's front is nowhere worse. The surface of k of n runs is the border of the region that
at least k of them attain: k = 1 the best surface, k = n the worst, half of them the median. A run whose front is empty attains nothing,
and counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moocore
import numpy as np

from .indicators import Points, goals_of, minimised
from .statistics import summarise


@dataclass(frozen=True, eq=False)
class Attainment:
    """The surfaces of n runs, those with empty fronts included."""

    # (p, m) each, in the user's units and senses: the non-dominated corners of the surface that at least k runs attain, k = 1, ..., n, in
    # the order of the first objective. Empty where fewer than k runs have points.
    corners: Sequence[np.ndarray]
    signs: np.ndarray  # (m,): +1 or -1: times this, a corner is minimised

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return len(self.corners)

    @property
    def best(self) -> np.ndarray:
        """Corners of the surface that any run attains."""
        return self.corners[0]

    @property
    def median(self) -> np.ndarray:
        """Corners of the surface that half of the runs attain."""
        return self.corners[(self.runs - 1) // 2]

    @property
    def worst(self) -> np.ndarray:
        """Corners of the surface that all runs attain."""
        return self.corners[-1]


def attainment(fronts: Sequence[Points]) -> Attainment:
    """The attainment surfaces of several runs of two or three objectives, some of which are Fronts or have points."""
    goals = goals_of(fronts)
    rows = [minimised(front, goals, f"front {i}") for i, front in enumerate(fronts)]
    filled = [part for part in rows if part.size]
    m = len(goals) if goals else filled[0].shape[1]
    signs = np.array([goal.sign for goal in goals]) if goals else np.ones(m)
    corners = [np.empty((0, m))] * len(rows)
    if filled:
        # moocore 0.3.2 loses points unless the numbers of the sets increase from row to row.
        found = moocore.eaf(np.vstack(filled), np.repeat(np.arange(len(filled)), [len(part) for part in filled]))
        attained = np.rint(found[:, m] * len(filled) / 100).astype(int)
        for k in range(1, len(filled) + 1):
            own = found[attained == k, :m]
            corners[k - 1] = own[np.lexsort(own.T[::-1])] * signs
    return Attainment(corners, signs)


def staircase(corners: np.ndarray, signs: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """The border (q, 2) of the region that the corners (p, 2) of a surface dominate, up to `ends` (2,), for drawing."""
    F = corners * signs
    F = F[np.lexsort(F.T[::-1])]
    worst = np.asarray(ends) * signs
    xs = np.concatenate([np.repeat(F[:, 0], 2), [max(worst[0], F[-1, 0])]])
    ys = np.concatenate([[max(worst[1], F[0, 1])], np.repeat(F[:, 1], 2)])
    return np.column_stack([xs, ys]) * signs


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
    infinite, it has failed, which is worse than any value.
    """
    runs = [(np.asarray(x, dtype=float), np.asarray(y, dtype=float)) for x, y in histories]
    grid = np.unique(np.concatenate([x for x, _ in runs]))
    if len(grid) > moments:
        grid = grid[np.unique(np.linspace(0, len(grid) - 1, moments).astype(int))]
    # The place of the last sample at each moment: none before the first.
    last = [np.searchsorted(x, grid, side="right") - 1 for x, _ in runs]
    values = np.array([np.where(k >= 0, y[np.maximum(k, 0)], np.nan) for k, (_, y) in zip(last, runs, strict=True)])
    found = [summarise(column, larger=larger) for column in values.T]
    lower, median, upper = (np.array([getattr(s, name) for s in found]) for name in ("lower", "median", "upper"))
    return Band(grid, lower, median, upper, len(runs))
