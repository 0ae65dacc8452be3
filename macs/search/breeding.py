"""Breeding: new points from those of the archive, by several operators that are called the more often the more of theirs it kept.

The agents are few and look around where they are. The archive holds a whole front, whose points differ by what leads along it: crossover
exchanges coordinates between its points, differences of two of them are steps for a third. No operator is best everywhere: crossover
solves what is separable and full of local fronts, differences solve what is coupled. So all are used, each as far as it earns it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..evaluation.box import Box
from .settings import Settings
from .state import SearchState, remember
from .trials import Trials

NEAR, WIDE = 20, 0.3
"""Among how many of the nearest mates are chosen; the probability that they are chosen among all (Zhang and Li 2007; Li and Zhang 2009)."""


DIFFERENCE = 0.5
"""Weight of a difference of two mates, the usual one (Li and Zhang 2009)."""


INDEX_CROSSOVER, INDEX_MUTATION = 15.0, 20.0
"""Distribution indices: the higher, the nearer offspring are to their parents (Deb and Agrawal 1995)."""


LEAST_SHARE, FORGET = 0.05, 0.1
"""Least share of an operator in the offspring, so that it may show its worth later; which part of the credit is forgotten each time."""


def mates(box: Box, X: np.ndarray, pool: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Three different points of the pool (p, d) for each of X (k, d), mostly near it and none equal to it: (3, k, d).

    Where the pool has too few others, the point itself stands in for them: differences to it are zero.
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
    """Simulated binary crossover (Deb and Agrawal 1995): half of the coordinates are bred with the first mate's.

    A child is near its parent in three of four of them, and near the mate in the others, at distances in the scale of their difference.
    """
    u = rng.random(X.shape)
    ratio = np.where(u < 0.5, 2.0 * u, 0.5 / (1.0 - u)) ** (1.0 / (INDEX_CROSSOVER + 1.0))
    share = 0.5 * np.where(rng.random(X.shape) < 0.25, 1.0 + ratio, 1.0 - ratio)
    return X + np.where(rng.random(X.shape) < 0.5, share * box.difference(mates[0], X), 0.0)


def differential(box: Box, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Differential evolution from the point itself: x + F (m2 - m3), every second time in half of the coordinates only."""
    return X + np.where(_part(X, rng), DIFFERENCE * box.difference(mates[1], mates[2]), 0.0)


def toward_mate(box: Box, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Part of the way to the first mate, and a difference of the others: x + K (m1 - x) + F (m2 - m3), K uniform in (0, 1)."""
    step = rng.random((len(X), 1)) * box.difference(mates[0], X) + DIFFERENCE * box.difference(mates[1], mates[2])
    return X + np.where(_part(X, rng), step, 0.0)


def draw_anew(box: Box, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One coordinate from anywhere in its bounds: the way out where all that has been found is on one side of a barrier."""
    trial = X.copy()
    trial[np.arange(len(X)), rng.integers(X.shape[1], size=len(X))] = rng.random(len(X))
    return trial


Operator = Callable[[Box, np.ndarray, np.ndarray, np.random.Generator], np.ndarray]


OPERATORS: tuple[tuple[Operator, bool], ...] = ((crossover, True), (differential, True), (toward_mate, True), (draw_anew, False))
"""The operators, and whether their offspring also mutate."""


def mutate(X: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Polynomial mutation (Deb and Goyal 1996) of one coordinate on average, in units of its span; not put back in the box."""
    u = rng.random(X.shape)
    size = 1.0 - (1.0 - np.abs(2.0 * u - 1.0)) ** (1.0 / (INDEX_MUTATION + 1.0))
    return X + np.where(rng.random(X.shape) < 1.0 / X.shape[1], np.copysign(size, u - 0.5), 0.0)


def breed(box: Box, X: np.ndarray, pool: np.ndarray, credit: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """One proposal for each parent.

    Parameters
    ----------
    X : array (k, d)
        The parents.
    pool : array (p, d)
        Where their mates are from.
    credit : array (number of operators, 2)
        See `learn`.

    Returns
    -------
    array (k, d)
    array (k,) of int
        Which operator made each.
    """
    operator = rng.choice(len(OPERATORS), size=len(X), p=shares(credit))
    others = mates(box, X, pool, rng)
    trial = X.copy()
    for index, (propose, mutates) in enumerate(OPERATORS):
        rows = np.flatnonzero(operator == index)
        if rows.size:
            children = propose(box, X[rows], others[:, rows], rng)
            trial[rows] = mutate(children, rng) if mutates else children
    return box.put_back(trial), operator


def no_credit() -> np.ndarray:
    """The credit to begin with, alike for all operators: as if each had been tried a few times, some of them with success."""
    return np.tile([1.0, 5.0], (len(OPERATORS), 1))


def learn(credit: np.ndarray, operator: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The credit of the operators, (o, 2): how many of their offspring were kept, and how many there were, the older the less.

    Parameters
    ----------
    credit : array (o, 2)
    operator, kept : arrays (k,) of int and bool
        Which operator made each child, and whether the archive kept it.
    """
    tried = np.bincount(operator, minlength=len(credit))
    won = np.bincount(operator, weights=kept, minlength=len(credit))
    return (1.0 - FORGET) * credit + np.stack([won, tried], axis=1)


def shares(credit: np.ndarray) -> np.ndarray:
    """Probability matching: each operator's share is proportional to its rate of success, but for a least share (Thierens 2005)."""
    rate = (credit[:, 0] + 0.1) / (credit[:, 1] + 1.0)
    return LEAST_SHARE + (1.0 - LEAST_SHARE * len(rate)) * rate / rate.sum()


def _part(X: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Which coordinates take part, (k, d) of bool: all of them, or every second time half of them."""
    return rng.random(X.shape) < np.where(rng.random((len(X), 1)) < 0.5, 1.0, 0.5)


def breed_archive(state: SearchState, settings: Settings, box: Box, trials: Trials) -> None:
    """Offspring of points of the archive, of as many as possible; the operators whose offspring it keeps will make more."""
    archive, evaluator, rng = state.archive, trials.evaluator, state.rng
    count = settings.offspring(len(archive))
    if not count:
        return
    rounds = [rng.permutation(len(archive)) for _ in range(-(-count // len(archive)))]
    rows = np.concatenate(rounds)[:count]
    points = box.to_unit(archive.Z[:, evaluator.free])
    pool = points if len(points) > FEW else np.vstack([points, trials.positions()])
    trial, operator = breed(box, points[rows], pool, state.credit, rng)
    bred, result = trials.evaluate(archive.Z[rows], points[rows], trial)
    if result is None:
        return
    remember(state, trials.seen, settings, evaluator)
    kept = (result.F[:, None] == state.archive.F).all(axis=2).any(axis=1)
    state.credit = learn(state.credit, operator[bred], kept)


FEW = 4
"""An archive of so many points is too small to find mates in: the agents are mates too."""
