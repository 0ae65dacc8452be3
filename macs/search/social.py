"""Social actions: what agents try with what all have found, and where they start from next (Ricciardi and Vasile 2015)."""

from __future__ import annotations

import numpy as np

from ..evaluation.box import Box


def nearest(box: Box, X: np.ndarray, pool: np.ndarray, count: int) -> np.ndarray:
    """Rows (k, <= count) of the `count` points of the pool (p, d) nearest to each of X (k, d), without the point itself.

    A pool with copies of the point has fewer others; the missing rows are -1.
    """
    squared = box.squared_distances(X, pool)
    squared[squared == 0.0] = np.inf
    order = np.argsort(squared, axis=1, kind="stable")[:, :count]
    return np.where(np.isfinite(np.take_along_axis(squared, order, axis=1)), order, -1)


def current_to_rand(box: Box, X: np.ndarray, pool: np.ndarray, count: int, F: float, rng: np.random.Generator) -> np.ndarray:
    """DE/current-to-rand/1 with parents near each agent: y = x + K (p3 - x) + K F (p1 - p2), K uniform in (0, 1).

    Parameters
    ----------
    X : array (k, d)
        Positions of the agents.
    pool : array (p, d)
        Where the parents are from.
    count : int
        Among how many of the nearest the three parents are drawn.
    F : float
        Weight of the difference.

    Returns
    -------
    array (k, d)
        Proposals; with only two parents near there is no p3, with fewer the agent stays.
    """
    if not len(pool):
        return X.copy()
    rows = nearest(box, X, pool, count)
    scores = np.where(rows >= 0, rng.random(rows.shape), np.inf)
    K = rng.random((len(X), 1))
    parents = np.take_along_axis(rows, np.argsort(scores, axis=1)[:, :3], axis=1)
    parents = np.hstack([parents, np.full((len(X), 3 - parents.shape[1]), -1)])
    has = parents >= 0
    first, second, third = (pool[parents[:, i]] for i in range(3))
    step = np.where(has[:, 2:], box.difference(third, X), 0.0) + np.where(has[:, 1:2], F * box.difference(first, second), 0.0)
    return box.put_back(X + K * step)


def follow_experience(box: Box, X: np.ndarray, experience: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Move as others did when they improved: by normal deviates with the mean and the second moments of their displacements.

    What improves one point of a front tends to improve its neighbours, and steps that did so are longest where there is most to gain; this
    is the estimate of a covariance from successful steps (Hansen and Ostermeier 2001), without its matrix.

    Parameters
    ----------
    X : array (k, d)
        Positions of the agents.
    experience : array (e, d)
        Displacements, e > 0.

    Returns
    -------
    array (k, d)
    """
    count = len(experience)
    weights = rng.standard_normal((len(X), count)) / np.sqrt(count) + 1.0 / count
    # Not a matrix product: those of BLAS may sum in another order with another number of threads.
    return box.put_back(X + np.einsum("ke,ed->kd", weights, experience))


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
