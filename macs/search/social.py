"""Social actions: what agents try with what all have found, and where they start from next (Ricciardi and Vasile 2015)."""

from __future__ import annotations

import numpy as np

from ..evaluation.box import Box
from ..evaluation.evaluator import Evaluator
from ..pareto import archive as archives
from ..pareto import directions
from .settings import Settings
from .state import NO_DIRECTION, SearchState
from .trials import Trials


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


def social_actions(state: SearchState, settings: Settings, box: Box, trials: Trials, evaluator: Evaluator) -> None:
    """One proposal for each social agent: from the points near it, of the archive or of the population, or from what has helped others."""
    agents, rng = state.agents, state.rng
    rows = np.flatnonzero(agents.direction != NO_DIRECTION)
    if not rows.size:
        return
    X = trials.positions(rows)
    everyone = trials.positions()
    archive = box.to_unit(state.archive.Z[:, evaluator.free])
    trial = current_to_rand(box, X, everyone, max(len(rows), 4), settings.F, rng)
    if len(archive) > 3:
        pick = rng.random(len(rows)) < 1.0 - np.exp(-len(archive) / len({row.tobytes() for row in everyone}))
        trial = np.where(pick[:, None], current_to_rand(box, X, archive, max(len(rows), 4), settings.F, rng), trial)
    if len(state.experience) > 3:
        pick = rng.random(len(rows)) < settings.experience
        trial = np.where(pick[:, None], follow_experience(box, X, state.experience, rng), trial)
    if settings.social_moves:
        trials.evaluate_and_accept(rows, X, trial, settings.keep_velocity)
    else:
        trials.evaluate(agents.Z[rows], X, trial)


def assign(state: SearchState, settings: Settings, box: Box, evaluator: Evaluator) -> None:
    """Give the social agents their directions, and send them to the points of the archive that are best for these.

    While the archive has fewer points than there are objectives nobody is sent, or, as in the authors' code, the nearest of the agents
    that own the orthogonal directions.
    """
    agents, archive, m = state.agents, state.archive, state.directions.shape[1]
    social_count = min(settings.social_agents(m), len(agents))
    if not social_count:
        return
    if settings.redraw or not (agents.direction != NO_DIRECTION).any():
        agents.direction[:] = NO_DIRECTION
        agents.direction[:social_count] = directions.draw(state.directions, social_count, state.rng)
    owners = np.flatnonzero(agents.direction != NO_DIRECTION)
    if len(archive) >= m:
        if settings.reseed == "spread" and len(archive) > len(owners) >= m:
            archive = archive.take(archives.spread(archive.F, len(owners), exponent=settings.exponent))
        weights = state.directions[agents.direction[owners]]
        costs = directions.tchebycheff(archive.F[:, None], weights, state.ideal, state.nadir)
    elif settings.reseed == "spread":
        owners = owners[agents.direction[owners] < m]
        apart = directions.normalised(archive.F[:, None] - agents.F[owners], np.zeros(m), state.nadir - state.ideal)
        costs = np.nan_to_num(np.linalg.norm(apart, axis=-1), nan=np.finfo(float).max)
    else:
        return
    points, columns = directions.pair_up(costs)
    rows = owners[columns]
    agents.place(rows, archive.Z[points], archive.F[points], archive.violation[points])
