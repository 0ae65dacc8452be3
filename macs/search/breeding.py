"""Breeding: offspring of the points of the archive, by several operators. An operator is used more often if the archive keeps its
offspring.

The agents are few, and each searches near its own position. The archive covers the whole front, and the differences of its points lead
along the front: crossover exchanges coordinates between two points, and the difference of two points is a step for a third. No operator is
best on every problem. Crossover suits separable problems with many local fronts, differences suit coupled variables. So all are used, and
those more often whose offspring the archive keeps, see `credit`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..evaluation.box import Box
from .credit import Offspring, judged, operator_shares
from .state import remember
from .trials import Trials

FEW = 4
"""An archive of at most so many points is too small for mates: the agents are mates too."""


NEAR, WIDE = 20, 0.3
"""Mates are drawn from so many nearest points, or with this probability from all (Zhang and Li 2007; Li and Zhang 2009)."""


DIFFERENCE = 0.5
"""Weight of the difference of two mates (Li and Zhang 2009)."""


INDEX_CROSSOVER, INDEX_MUTATION = 15.0, 20.0
"""Distribution indices; a higher index puts offspring nearer to their parents (Deb and Agrawal 1995)."""


def mates(box: Box, X: np.ndarray, pool: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Three different points of the pool (p, d) for each of X (k, d), mostly near it and never equal to it: (3, k, d).

    If the pool has too few other points, the point itself takes their places; its difference to itself is zero.
    """
    squared = box.squared_distances(X, pool)
    squared[squared == 0.0] = np.inf
    order = np.argsort(squared, axis=1, kind="stable")
    others = np.isfinite(squared).sum(axis=1)
    eligible = np.where(rng.random(len(X)) < WIDE, others, np.minimum(others, NEAR))
    rank = np.arange(len(pool))
    score = np.where(rank < eligible[:, None], rng.random(order.shape), 1.0)
    picked = np.argsort(score, axis=1)[:, :3]
    found = picked < eligible[:, None]
    missing = 3 - picked.shape[1]
    if missing > 0:
        picked, found = np.pad(picked, ((0, 0), (0, missing))), np.pad(found, ((0, 0), (0, missing)))
    rows = np.take_along_axis(order, picked, axis=1)
    return np.where(found.T[:, :, None], pool[rows.T], X)


def crossover(box: Box, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Children (k, d) by simulated binary crossover (Deb and Agrawal 1995): half of the coordinates are crossed with those of the first
    mate.

    In three of four of these coordinates a child is near its parent, in the others near the mate. Distances scale with the difference of
    parent and mate.
    """
    u = rng.random(X.shape)
    ratio = np.where(u < 0.5, 2.0 * u, 0.5 / (1.0 - u)) ** (1.0 / (INDEX_CROSSOVER + 1.0))
    share = 0.5 * np.where(rng.random(X.shape) < 0.25, 1.0 + ratio, 1.0 - ratio)
    return X + np.where(rng.random(X.shape) < 0.5, share * box.difference(mates[0], X), 0.0)


def differential(box: Box, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Children (k, d) by differential evolution from the parent: x + F (m2 - m3); every second child in half of the coordinates only."""
    return X + np.where(_moving_coordinates(X, rng), DIFFERENCE * box.difference(mates[1], mates[2]), 0.0)


def toward_mate(box: Box, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Children (k, d) on the way to the first mate, plus a difference of the others: x + K (m1 - x) + F (m2 - m3), K uniform in (0, 1)."""
    step = rng.random((len(X), 1)) * box.difference(mates[0], X) + DIFFERENCE * box.difference(mates[1], mates[2])
    return X + np.where(_moving_coordinates(X, rng), step, 0.0)


def redraw_coordinate(box: Box, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Children (k, d) with one coordinate drawn anew within its bounds: this can cross a barrier when all known points are on one side."""
    trial = X.copy()
    trial[np.arange(len(X)), rng.integers(X.shape[1], size=len(X))] = rng.random(len(X))
    return trial


Operator = Callable[[Box, np.ndarray, np.ndarray, np.random.Generator], np.ndarray]


OPERATORS: tuple[tuple[Operator, bool], ...] = ((crossover, True), (differential, True), (toward_mate, True), (redraw_coordinate, False))
"""The operators, each with whether its offspring also mutate."""


def mutate(X: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Points (k, d) after polynomial mutation (Deb and Goyal 1996) of one coordinate on average; they may be outside the box."""
    u = rng.random(X.shape)
    size = 1.0 - (1.0 - np.abs(2.0 * u - 1.0)) ** (1.0 / (INDEX_MUTATION + 1.0))
    return X + np.where(rng.random(X.shape) < 1.0 / X.shape[1], np.copysign(size, u - 0.5), 0.0)


def breed(box: Box, X: np.ndarray, pool: np.ndarray, shares: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """One offspring of each parent, and the operator that made it.

    Parameters
    ----------
    box : Box
    X : array (k, d)
        The parents, in unit coordinates.
    pool : array (p, d)
        Points that mates are chosen from.
    shares : array (number of operators,)
        Probabilities of the operators.
    rng : numpy.random.Generator

    Returns
    -------
    array (k, d)
        The offspring, inside the box.
    array (k,) of int
        Row in `OPERATORS` of the operator that made each.
    """
    operator = rng.choice(len(OPERATORS), size=len(X), p=shares)
    others = mates(box, X, pool, rng)
    trial = X.copy()
    for index, (propose, mutates) in enumerate(OPERATORS):
        rows = np.flatnonzero(operator == index)
        if rows.size:
            children = propose(box, X[rows], others[:, rows], rng)
            trial[rows] = mutate(children, rng) if mutates else children
    return box.put_back(trial), operator


def _moving_coordinates(X: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Mask (k, d) of the coordinates that change: all of a row or, with probability one half, each with probability one half."""
    return rng.random(X.shape) < np.where(rng.random((len(X), 1)) < 0.5, 1.0, 0.5)


def breed_archive(trials: Trials) -> None:
    """Breed offspring of the archive's points, from as many parents as possible; update the credit of operators by earlier offspring."""
    state, settings, evaluator, box = trials.state, trials.settings, trials.evaluator, trials.box
    archive, rng = state.archive, state.rng
    count = settings.offspring(len(archive), archive.F.shape[1])
    if not count:
        return
    rounds = [rng.permutation(len(archive)) for _ in range(-(-count // len(archive)))]
    rows = np.concatenate(rounds)[:count]
    points = box.to_unit(archive.Z[:, evaluator.free])
    pool = points if len(points) > FEW else np.vstack([points, trials.positions()])
    trial, operator = breed(box, points[rows], pool, operator_shares(state.credit, archive.F.shape[1]), rng)
    bred, result = trials.evaluate(archive.Z[rows], points[rows], trial)
    if result is None:
        return
    remember(state, trials.seen, settings, evaluator)
    young = state.bred.joined(Offspring(result.F, operator[bred], np.full(len(bred), state.iteration)))
    state.bred, state.credit = judged(young, state.credit, archive=state.archive.F, iteration=state.iteration)
