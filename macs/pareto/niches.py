"""Niches of a front of many objectives: the best point near each of evenly spread reference directions.

With many objectives nearly all points are mutually non-dominated, and a point has the more room around it, the farther it is from the
front: if only spacing counts, points move away from the front. So points compete along directions instead (Zhang and Li 2007; Deb and Jain
2014; Yuan, Xu, Wang and Yao 2016).
"""

from __future__ import annotations

import numpy as np

from .directions import reference_directions

MANY = 3
"""With more than so many objectives, points compete along directions."""
PENALTY = 3.0
"""Weight of the distance from a direction, relative to the distance along it (Zhang and Li 2007)."""


def best_of_niches(F: np.ndarray, limit: int) -> np.ndarray:
    """Mask (n,) of `limit` of the points F (n, m), n > limit: the best of each objective, and of each direction.

    There are as many directions as points to choose. Each point belongs to the direction that it is nearest to, and is the better, the less
    its penalised distance from the ideal point (penalty-based boundary intersection). Directions without a point leave places to the second
    of others, and so on.
    """
    N = (F - F.min(axis=0)) / intercepts(F)
    axes = _unit_directions(F.shape[1], limit)
    along = np.einsum("nm,km->nk", N, axes)  # no matrix product: with more threads BLAS may sum in another order
    aside = np.sqrt(np.maximum((N**2).sum(axis=1)[:, None] - along**2, 0.0))
    niche = aside.argmin(axis=1)
    rows = np.arange(len(F))
    distance = along[rows, niche] + PENALTY * aside[rows, niche]
    rank = _ranks(niche, distance)
    inside = np.zeros(len(F), dtype=bool)
    inside[nearly_best(F, N.sum(axis=1))] = True
    others = np.lexsort((distance, rank, inside))
    inside[others[: limit - np.count_nonzero(inside)]] = True
    return inside


def intercepts(F: np.ndarray) -> np.ndarray:
    """Scales (m,) of the objectives F (n, m): from the ideal point to where the plane through the corners of the front meets the axes.

    The corner of an objective is the point nearest to its axis. No scale is more than the range; if the plane meets an axis behind the
    ideal point, or is none, all are the ranges (Deb and Jain 2014). An objective that does not vary has the scale 1.
    """
    N = F - F.min(axis=0)
    span = N.max(axis=0)
    span[span == 0.0] = 1.0
    N /= span
    # A corner is the point nearest to an axis: the objective of the axis hardly counts.
    weights = np.where(np.eye(F.shape[1], dtype=bool), 1e-6, 1.0)
    corners = N[(N[:, None] * weights).max(axis=2).argmin(axis=0)]
    with np.errstate(divide="ignore", over="ignore"):
        try:
            cut = 1.0 / np.linalg.solve(corners, np.ones(len(span)))
        except np.linalg.LinAlgError:
            return span
    if not (cut > 1e-6).all():
        return span
    return span * np.minimum(cut, 1.0)


def nearly_best(F: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Rows (m,) of the best point of each objective of F (n, m); of those whose values differ from the best by less
    than a millionth of the range, the one with the least `total` (n,)."""
    span = np.ptp(F, axis=0)
    away = (F - F.min(axis=0)) / np.where(span > 0.0, span, 1.0)
    return np.array([np.lexsort((total, np.maximum(column, 1e-6)))[0] for column in away.T], dtype=int)


def _unit_directions(m: int, count: int) -> np.ndarray:
    """Evenly spread directions (count, m) of Euclidean length 1."""
    directions = reference_directions(m, count, None)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _ranks(niche: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Rank (n,) of each point in its niche: 0 for the least distance."""
    order = np.lexsort((distance, niche))
    rows = np.arange(len(niche))
    first = np.r_[True, niche[order][1:] != niche[order][:-1]]
    rank = np.empty(len(niche), dtype=int)
    rank[order] = rows - np.maximum.accumulate(np.where(first, rows, 0))
    return rank
