"""Social actions: proposals from the population, the archive and past improvements; directions of agents (Ricciardi and Vasile 2015)."""

from __future__ import annotations

import numpy as np

from ..evaluation.evaluator import UnitBox
from ..pareto import directions
from ..pareto.dominance import normalised
from ..pareto.spread import Guide, spread
from .settings import Settings
from .state import NO_DIRECTION, SearchState
from .trials import Trials

FEWEST_PARENTS = 4
"""Least number of points that parents are drawn from, and of past improvements that are repeated."""


def nearest_rows(box: UnitBox, X: np.ndarray, pool: np.ndarray, count: int) -> np.ndarray:
    """Rows (k, <= count) of the `count` points of the pool (p, d) nearest to each of X (k, d), without points equal to it.

    Missing rows are -1.
    """
    squared = box.squared_distances(X, pool)
    squared[squared == 0.0] = np.inf
    order = np.argsort(squared, axis=1, kind="stable")[:, :count]
    return np.where(np.isfinite(np.take_along_axis(squared, order, axis=1)), order, -1)


def current_to_rand(box: UnitBox, X: np.ndarray, pool: np.ndarray, count: int, F: float, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) of DE/current-to-rand/1 with parents of the pool (p, d) near each agent at X (k, d):
    y = x + K (p3 - x) + K F (p1 - p2), K uniform in (0, 1)."""
    if not len(pool):
        return X.copy()
    rows = nearest_rows(box, X, pool, count)
    scores = np.where(rows >= 0, rng.random(rows.shape), np.inf)
    K = rng.random((len(X), 1))
    parents = np.take_along_axis(rows, np.argsort(scores, axis=1)[:, :3], axis=1)
    parents = np.hstack([parents, np.full((len(X), 3 - parents.shape[1]), -1)])
    has = parents >= 0
    first, second, third = (pool[parents[:, i]] for i in range(3))
    step = np.where(has[:, 2:], box.difference(third, X), 0.0) + np.where(has[:, 1:2], F * box.difference(first, second), 0.0)
    return box.put_back(X + K * step)


def like_improvements(box: UnitBox, X: np.ndarray, experience: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) by normally distributed steps with the mean and the second moments of past displacements (e, d).

    A step that improved one point of a front often improves its neighbours, too, and the longest such steps gained most. The covariance is
    estimated from successful steps, as by Hansen and Ostermeier (2001), without forming its matrix.
    """
    count = len(experience)
    weights = rng.standard_normal((len(X), count)) / np.sqrt(count) + 1.0 / count
    # No matrix product: with another number of threads BLAS may sum in another order.
    return box.put_back(X + np.einsum("ke,ed->kd", weights, experience))


def social_actions(trials: Trials) -> None:
    """Evaluate one proposal for each social agent, and move the agents with success if the variant says so.

    Parents are agents or, with a probability that grows with the archive's size relative to the population's, points of the archive. Some
    proposals repeat past improvements instead.
    """
    state, settings, box = trials.state, trials.settings, trials.box
    agents, rng, variant = state.agents, state.rng, settings.variant
    rows = np.flatnonzero(agents.direction != NO_DIRECTION)
    if not rows.size:
        return
    X, population = trials.positions(rows), trials.positions()
    archive = box.to_unit(state.archive.Z[:, trials.evaluator.free])
    near = max(len(rows), FEWEST_PARENTS)
    trial = current_to_rand(box, X, population, near, variant.F, rng)
    if len(archive) >= FEWEST_PARENTS:
        share = 1.0 - float(np.exp(-len(archive) / len({row.tobytes() for row in population})))
        taken = rng.random(len(rows)) < share
        trial = np.where(taken[:, None], current_to_rand(box, X, archive, near, variant.F, rng), trial)
    if variant.experience and len(state.experience) >= FEWEST_PARENTS:
        taken = rng.random(len(rows)) < variant.experience
        trial = np.where(taken[:, None], like_improvements(box, X, state.experience, rng), trial)
    if variant.social_moves:
        trials.evaluate_and_accept(rows, X, trial)
    else:
        trials.evaluate(agents.Z[rows], X, trial)


def direction_shares(state: SearchState, guide: Guide | None) -> np.ndarray | None:
    """Shares (k,) of the directions in the draw, by the wanted density of points where they lead; None if that is uniform.

    A direction leads to the point of the archive that is best in it.
    """
    archive, m = state.archive, state.directions.shape[1]
    if guide is None or len(archive) < m:
        return None
    wanted = guide.factors(archive.F, archive.F) ** max(m - 1, 1)  # so many in an area, if m = 3
    return wanted[directions.best_points(archive.F, state.directions, state.ideal, state.nadir)]


def assign(state: SearchState, settings: Settings, guide: Guide | None = None) -> None:
    """Give the social agents their directions, and move them to the points of the archive that are best in these directions: of a larger
    archive to as many points as there are agents, well spread.

    While the archive has fewer points than objectives, those agents are moved that have the orthogonal directions and are nearest to the
    points, as in the authors' code.
    """
    agents, archive, m = state.agents, state.archive, state.directions.shape[1]
    social_count = min(settings.social_agents(m), len(agents))
    if not social_count:
        return
    if settings.variant.redraw or not (agents.direction != NO_DIRECTION).any():
        agents.direction[:] = NO_DIRECTION
        agents.direction[:social_count] = directions.draw(state.directions, social_count, state.rng, direction_shares(state, guide))
    owners = np.flatnonzero(agents.direction != NO_DIRECTION)
    if len(archive) >= m:
        if len(archive) > len(owners) >= m:
            archive = archive.take(spread(archive.F, len(owners), exponent=settings.variant.energy_exponent, guide=guide))
        weights = state.directions[agents.direction[owners]]
        costs = directions.tchebycheff(archive.F[:, None], weights, state.ideal, state.nadir)
    else:
        owners = owners[agents.direction[owners] < m]
        apart = normalised(archive.F[:, None] - agents.F[owners], np.zeros(m), state.nadir - state.ideal)
        costs = np.nan_to_num(np.linalg.norm(apart, axis=-1), nan=np.finfo(float).max)
    points, columns = directions.pair_up(costs)
    rows = owners[columns]
    agents.place(rows, archive.Z[points], archive.F[points], archive.violation[points])
