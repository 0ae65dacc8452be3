"""Social actions: proposals from population, archive and past improvements; directions of agents (Ricciardi and Vasile 2015)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..evaluation.box import Box
from ..evaluation.evaluator import Evaluator
from ..pareto import archive as archives
from ..pareto import directions
from ..pareto.ranges import normalised
from .settings import Settings
from .state import NO_DIRECTION, SearchState
from .trials import Trials

FEWEST = 4
"""Fewest points that parents are drawn from, and fewest improvements that are an experience."""


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
    """Move like past improvements: by normal deviates with the mean and the second moments of their displacements.

    A step that improves one point of a front tends to improve its neighbours, and such steps are longest where there is most to gain. This
    estimates a covariance from successful steps (Hansen and Ostermeier 2001), without its matrix.

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


@dataclass(frozen=True)
class Surroundings:
    """All that a social action may use, positions in the unit box.

    Attributes
    ----------
    box : Box
    X : array (k, d)
        Positions of the social agents.
    population, archive : arrays (n, d), (a, d)
        Positions of all agents, and of the points of the archive.
    experience : array (e, d)
        Displacements of the last improvements.
    settings : Settings
    rng : numpy.random.Generator
    """

    box: Box
    X: np.ndarray
    population: np.ndarray
    archive: np.ndarray
    experience: np.ndarray
    settings: Settings
    rng: np.random.Generator


def among_population(s: Surroundings) -> np.ndarray:
    """DE/current-to-rand/1 with parents among the nearest agents."""
    return current_to_rand(s.box, s.X, s.population, max(len(s.X), FEWEST), s.settings.F, s.rng)


def among_archive(s: Surroundings) -> np.ndarray:
    """DE/current-to-rand/1 with parents among the nearest points of the archive."""
    return current_to_rand(s.box, s.X, s.archive, max(len(s.X), FEWEST), s.settings.F, s.rng)


def along_experience(s: Surroundings) -> np.ndarray:
    """Displacements like those of the last improvements."""
    return follow_experience(s.box, s.X, s.experience, s.rng)


def archive_probability(s: Surroundings) -> float | None:
    """The larger the archive relative to the population, the more often it gives the parents; None while it is too small."""
    if len(s.archive) < FEWEST:
        return None
    return 1.0 - float(np.exp(-len(s.archive) / len({row.tobytes() for row in s.population})))


def experience_probability(s: Surroundings) -> float | None:
    """The setting `experience`; None until there are enough improvements."""
    return s.settings.experience if len(s.experience) >= FEWEST else None


ACTIONS: tuple[tuple[Callable[[Surroundings], np.ndarray], Callable[[Surroundings], float | None]], ...] = (
    (among_archive, archive_probability),
    (along_experience, experience_probability),
)
"""Proposals (k, d), each with the probability that an agent takes it instead of an earlier one; the first of all is `among_population`. An
action without a probability is left out."""


def social_actions(state: SearchState, settings: Settings, box: Box, trials: Trials, evaluator: Evaluator) -> None:
    """One proposal for each social agent, by one of the `ACTIONS`."""
    agents, rng = state.agents, state.rng
    rows = np.flatnonzero(agents.direction != NO_DIRECTION)
    if not rows.size:
        return
    archive = box.to_unit(state.archive.Z[:, evaluator.free])
    around = Surroundings(box, trials.positions(rows), trials.positions(), archive, state.experience, settings, rng)
    trial = among_population(around)
    for propose, probability in ACTIONS:
        share = probability(around)
        if share is not None:
            taken = rng.random(len(rows)) < share
            trial = np.where(taken[:, None], propose(around), trial)
    if settings.social_moves:
        trials.evaluate_and_accept(rows, around.X, trial, settings.keep_velocity)
    else:
        trials.evaluate(agents.Z[rows], around.X, trial)


def assign(state: SearchState, settings: Settings, box: Box, evaluator: Evaluator) -> None:
    """Give the social agents their directions, and place them on the points of the archive that are best for these.

    While the archive has fewer points than there are objectives, no agent is placed; or, as in the authors' code, the nearest of the
    agents that own the orthogonal directions are.
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
        apart = normalised(archive.F[:, None] - agents.F[owners], np.zeros(m), state.nadir - state.ideal)
        costs = np.nan_to_num(np.linalg.norm(apart, axis=-1), nan=np.finfo(float).max)
    else:
        return
    points, columns = directions.pair_up(costs)
    rows = owners[columns]
    agents.place(rows, archive.Z[points], archive.F[points], archive.violation[points])
