"""Social actions: proposals from the population, the archive and past improvements; directions of agents (Ricciardi and Vasile 2015)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..evaluation.evaluator import Box
from ..pareto import directions
from ..pareto.dominance import normalised
from ..pareto.spread import Guide, spread
from .settings import Settings
from .state import NO_DIRECTION, SearchState
from .trials import Trials

FEWEST = 4
"""Least number of points that parents are drawn from, and of improvements that `follow_experience` uses."""


def nearest(box: Box, X: np.ndarray, pool: np.ndarray, count: int) -> np.ndarray:
    """Rows (k, <= count) of the `count` points of the pool (p, d) that are nearest to each of X (k, d), points equal to it left out.

    Missing rows are -1.
    """
    squared = box.squared_distances(X, pool)
    squared[squared == 0.0] = np.inf
    order = np.argsort(squared, axis=1, kind="stable")[:, :count]
    return np.where(np.isfinite(np.take_along_axis(squared, order, axis=1)), order, -1)


def current_to_rand(box: Box, X: np.ndarray, pool: np.ndarray, count: int, F: float, rng: np.random.Generator) -> np.ndarray:
    """Proposals of DE/current-to-rand/1 with parents near each agent: y = x + K (p3 - x) + K F (p1 - p2), K uniform in (0, 1). X (k, d),
    pool (p, d) -> (k, d)."""
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
    """Proposals by random steps with the mean and the second moments of the displacements of past improvements.

    A step that improved one point of a front often improves its neighbours too, and the longest such steps gained most. This samples from a
    covariance estimated from successful steps (Hansen and Ostermeier 2001), without forming its matrix. X (k, d), experience (e, d) -> (k,
    d).
    """
    count = len(experience)
    weights = rng.standard_normal((len(X), count)) / np.sqrt(count) + 1.0 / count
    # No matrix product: with another number of threads BLAS may sum in another order.
    return box.put_back(X + np.einsum("ke,ed->kd", weights, experience))


@dataclass(frozen=True)
class Surroundings:
    """Input of a social action; positions are in the unit box."""

    box: Box
    X: np.ndarray  # (k, d): Positions of the social agents
    population: np.ndarray  # population, archive: (n, d), (a, d): Positions of all agents, and of the points of the archive
    archive: np.ndarray
    experience: np.ndarray  # (e, d): Displacements of the last improvements
    settings: Settings
    rng: np.random.Generator


def among_population(s: Surroundings) -> np.ndarray:
    """Proposals (k, d) of DE/current-to-rand/1 with parents among the nearest agents."""
    return current_to_rand(s.box, s.X, s.population, max(len(s.X), FEWEST), s.settings.F, s.rng)


def among_archive(s: Surroundings) -> np.ndarray:
    """Proposals (k, d) of DE/current-to-rand/1 with parents among the nearest points of the archive."""
    return current_to_rand(s.box, s.X, s.archive, max(len(s.X), FEWEST), s.settings.F, s.rng)


def along_experience(s: Surroundings) -> np.ndarray:
    """Proposals (k, d) by displacements like those of the last improvements."""
    return follow_experience(s.box, s.X, s.experience, s.rng)


def archive_probability(s: Surroundings) -> float | None:
    """Probability that parents are from the archive: it grows with the archive's size relative to the population's; None if too small."""
    if len(s.archive) < FEWEST:
        return None
    return 1.0 - float(np.exp(-len(s.archive) / len({row.tobytes() for row in s.population})))


def experience_probability(s: Surroundings) -> float | None:
    """The setting `experience`; None as long as there are too few improvements."""
    return s.settings.experience if len(s.experience) >= FEWEST else None


ACTIONS: tuple[tuple[Callable[[Surroundings], np.ndarray], Callable[[Surroundings], float | None]], ...] = (
    (among_archive, archive_probability),
    (along_experience, experience_probability),
)
"""Social actions, each with the probability that its proposal replaces an earlier one. The first proposal is that of `among_population`. An
action whose probability is None is left out."""


def social_actions(trials: Trials) -> None:
    """Evaluate one proposal for each social agent, and move the agents with success if the settings say so."""
    state, settings, box = trials.state, trials.settings, trials.box
    agents, rng = state.agents, state.rng
    rows = np.flatnonzero(agents.direction != NO_DIRECTION)
    if not rows.size:
        return
    archive = box.to_unit(state.archive.Z[:, trials.evaluator.free])
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


def shares(state: SearchState, guide: Guide | None) -> np.ndarray | None:
    """Shares (k,) of the directions in what is drawn, as densely as points are wanted where they lead; None if that is even.

    A direction leads to the point of the archive that is best in it.
    """
    archive, m = state.archive, state.directions.shape[1]
    if guide is None or len(archive) < m:
        return None
    wanted = guide.factors(archive.F, archive.F) ** max(m - 1, 1)  # so many in an area, if m = 3
    return wanted[directions.best_points(archive.F, state.directions, state.ideal, state.nadir)]


def assign(state: SearchState, settings: Settings, guide: Guide | None = None) -> None:
    """Give the social agents their directions, and move them to the points of the archive that are best in these directions.

    While the archive has fewer points than objectives, no agent is moved, except with `reseed="spread"`: then, as in the authors' code,
    those agents that have the orthogonal directions and are nearest to the points.
    """
    agents, archive, m = state.agents, state.archive, state.directions.shape[1]
    social_count = min(settings.social_agents(m), len(agents))
    if not social_count:
        return
    if settings.redraw or not (agents.direction != NO_DIRECTION).any():
        agents.direction[:] = NO_DIRECTION
        agents.direction[:social_count] = directions.draw(state.directions, social_count, state.rng, shares(state, guide))
    owners = np.flatnonzero(agents.direction != NO_DIRECTION)
    if len(archive) >= m:
        if settings.reseed == "spread" and len(archive) > len(owners) >= m:
            archive = archive.take(spread(archive.F, len(owners), exponent=settings.exponent, guide=guide))
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
