"""Breeding: offspring of the points of the archive, by several operators.

The agents are few, and each searches near its own position. The archive covers the whole front, and the differences of its points lead
along the front: crossover exchanges coordinates between two points, and the difference of two points is a step for a third. No operator is
best on every problem. Crossover suits separable problems with many local fronts, differences suit coupled variables. So all are used, and
with at most three objectives those more often whose offspring the archive keeps.

With more objectives nearly every new point is non-dominated, and a point elsewhere on a poor front stays as long as one nearer to the true
front: what stays says little of progress. The shares are then fixed, most of them crossover's, and mates are drawn from the whole archive.

As long as nothing is feasible the archive is empty, and the least violated points are bred likewise: they are ordered by one number, and a
generation of children with coordinates of both parents lowers it sooner than steps of single agents. Parents are then the better of two
(Goldberg and Deb 1991), and steps of mutation longer. Later, infeasible points with better objectives than the archive's are bred with it:
feasible parts may be apart from each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..evaluation.evaluator import Box
from ..pareto.dominance import CURVE
from ..pareto.niches import MANY
from .state import remember
from .trials import Trials

FEW = 4
"""An archive of at most so many points is too small for mates: the agents are mates too."""


NEAR, WIDE = 20, 0.3
"""Mates are drawn from so many nearest points, or with this probability from all (Zhang and Li 2007; Li and Zhang 2009); with many
objectives always from all (Deb and Jain 2014)."""


DIFFERENCE = 0.5
"""Weight of the difference of two mates (Li and Zhang 2009)."""


INDEX_CROSSOVER, INDEX_MUTATION = 15.0, 20.0
"""Distribution indices; a higher index puts offspring nearer to their parents (Deb and Agrawal 1995)."""


INDEX_MUTATION_INFEASIBLE = 5.0
"""That of mutation as long as nothing is feasible. The least violated points are soon nearly alike, often at a local optimum of the
violation, and crossover leads nowhere new: longer steps leave it."""


INDEX_MUTATION_MANY = 10.0
"""That of mutation with many objectives. Children of a whole archive are near their parents in most coordinates, and the archive keeps
points of poor local fronts for long: longer steps leave these sooner, and cost little accuracy where there are none."""


FROM_MATE = 0.25
"""Part of the crossed coordinates in which a child is near the mate."""


INDEX_SURFACE, FROM_MATE_SURFACE = 30.0, 0.5
"""The same of crossover with three and more objectives, and as long as nothing is feasible (Deb and Jain 2014)."""


LEAST_SHARE, FORGET = 0.05, 0.1
"""Least share of an operator in the offspring, so that it can succeed later; fraction of the credit that is forgotten in each iteration."""


def mates(box: Box, X: np.ndarray, pool: np.ndarray, rng: np.random.Generator, wide: float = WIDE) -> np.ndarray:
    """Three different points of the pool (p, d) for each of X (k, d), mostly near it and never equal to it: (3, k, d).

    With the probability `wide` they are drawn from the whole pool. If it has too few other points, the point itself takes their places; its
    difference to itself is zero.
    """
    squared = box.squared_distances(X, pool)
    squared[squared == 0.0] = np.inf
    order = np.argsort(squared, axis=1, kind="stable")
    others = np.isfinite(squared).sum(axis=1)
    eligible = np.where(rng.random(len(X)) < wide, others, np.minimum(others, NEAR))
    rank = np.arange(len(pool))
    score = np.where(rank < eligible[:, None], rng.random(order.shape), 1.0)
    picked = np.argsort(score, axis=1)[:, :3]
    found = picked < eligible[:, None]
    missing = 3 - picked.shape[1]
    if missing > 0:
        picked, found = np.pad(picked, ((0, 0), (0, missing))), np.pad(found, ((0, 0), (0, missing)))
    rows = np.take_along_axis(order, picked, axis=1)
    return np.where(found.T[:, :, None], pool[rows.T], X)


def crossover(
    box: Box,
    X: np.ndarray,
    mates: np.ndarray,
    rng: np.random.Generator,
    index: float = INDEX_CROSSOVER,
    from_mate: float = FROM_MATE,
) -> np.ndarray:
    """Children (k, d) by simulated binary crossover (Deb and Agrawal 1995): half of the coordinates are crossed with those of the first
    mate.

    In a part `from_mate` of these coordinates a child is near the mate, in the others near its parent. Distances scale with the difference
    of parent and mate, and are the shorter, the higher the `index`.
    """
    u = rng.random(X.shape)
    ratio = np.where(u < 0.5, 2.0 * u, 0.5 / (1.0 - u)) ** (1.0 / (index + 1.0))
    share = 0.5 * np.where(rng.random(X.shape) < from_mate, 1.0 + ratio, 1.0 - ratio)
    return X + np.where(rng.random(X.shape) < 0.5, share * box.difference(mates[0], X), 0.0)


def even_crossover(box: Box, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Children (k, d) by crossover that are nearer to the parents, and have coordinates of both alike."""
    return crossover(box, X, mates, rng, INDEX_SURFACE, FROM_MATE_SURFACE)


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


OPERATORS_SURFACE: tuple[tuple[Operator, bool], ...] = ((even_crossover, True), *OPERATORS[1:])
"""The same where a front is a surface, and as long as nothing is feasible."""


SHARES = np.array([1.0 - (len(OPERATORS) - 1) * LEAST_SHARE] + [LEAST_SHARE] * (len(OPERATORS) - 1))
"""Fixed shares of the operators."""


def no_credit(count: int) -> np.ndarray:
    """Initial credit (count, 2), equal for all operators: one success in five trials."""
    return np.tile([1.0, 5.0], (count, 1))


def updated_credit(credit: np.ndarray, operator: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Credit of the operators (o, 2): number of offspring that stayed in the archive, and of all offspring; older ones count less. credit
    (o, 2), operator, kept (k,)."""
    tried = np.bincount(operator, minlength=len(credit))
    won = np.bincount(operator, weights=kept, minlength=len(credit))
    return (1.0 - FORGET) * credit + np.stack([won, tried], axis=1)


def success_rates(credit: np.ndarray) -> np.ndarray:
    """Success rates (o,), positive, from the credit (o, 2)."""
    return (credit[:, 0] + 0.1) / (credit[:, 1] + 1.0)


def operator_shares(credit: np.ndarray) -> np.ndarray:
    """Probabilities (o,) of the operators: by their success rates, with a least share for each (Thierens 2005)."""
    rate = success_rates(credit)
    return LEAST_SHARE + (1.0 - LEAST_SHARE * len(rate)) * rate / rate.sum()


def mutate(X: np.ndarray, rng: np.random.Generator, index: float = INDEX_MUTATION) -> np.ndarray:
    """Points (k, d) after polynomial mutation (Deb and Goyal 1996) of one coordinate on average; they may be outside the box."""
    u = rng.random(X.shape)
    size = 1.0 - (1.0 - np.abs(2.0 * u - 1.0)) ** (1.0 / (index + 1.0))
    return X + np.where(rng.random(X.shape) < 1.0 / X.shape[1], np.copysign(size, u - 0.5), 0.0)


def breed(
    box: Box,
    X: np.ndarray,
    pool: np.ndarray,
    shares: np.ndarray,
    rng: np.random.Generator,
    operators: Sequence[tuple[Operator, bool]] = OPERATORS,
    wide: float = WIDE,
    mutation: float = INDEX_MUTATION,
) -> tuple[np.ndarray, np.ndarray]:
    """One offspring of each parent, and the operator that made it. X (k, d), pool (p, d), shares (number of operators,) -> (k, d), (k,)."""
    operator = rng.choice(len(operators), size=len(X), p=shares)
    others = mates(box, X, pool, rng, wide)
    trial = X.copy()
    for index, (propose, mutates) in enumerate(operators):
        rows = np.flatnonzero(operator == index)
        if rows.size:
            children = propose(box, X[rows], others[:, rows], rng)
            trial[rows] = mutate(children, rng, mutation) if mutates else children
    return box.put_back(trial), operator


def _moving_coordinates(X: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Mask (k, d) of the coordinates that change: all of a row or, with probability one half, each with probability one half."""
    return rng.random(X.shape) < np.where(rng.random((len(X), 1)) < 0.5, 1.0, 0.5)


def breed_archive(trials: Trials) -> None:
    """Breed offspring of the archive's points, or of the least violated ones as long as nothing is feasible, from as many parents as
    possible, and one of each point outside; update the credit of the operators, unless shares are fixed."""
    state, settings, evaluator, box = trials.state, trials.settings, trials.evaluator, trials.box
    parents, m, rng = state.parents, len(state.ideal), state.rng
    lone = min(max(len(state.agents) - settings.agents, 0), settings.agents)
    count = settings.offspring(len(parents), m, lone, len(state.archive) > 0)
    if not count:
        return
    if len(state.archive):
        rows = np.concatenate([rng.permutation(len(parents)) for _ in range(-(-count // len(parents)))])[:count]
    else:
        rows = rng.integers(len(parents), size=(count, 2)).min(axis=1)  # the first are the least violated
    rows = np.concatenate([rows, len(parents) + np.arange(len(state.outside))])
    parents = parents.joined(state.outside)
    points = box.to_unit(parents.Z[:, evaluator.free])
    pool = points if len(points) > FEW else np.vstack([points, trials.positions()])
    infeasible = not len(state.archive)
    fixed = m > MANY or infeasible
    trial, operator = breed(
        box,
        points[rows],
        pool,
        SHARES if fixed else operator_shares(state.credit),
        rng,
        OPERATORS_SURFACE if fixed or m > CURVE else OPERATORS,
        1.0 if fixed else WIDE,
        INDEX_MUTATION_INFEASIBLE if infeasible else INDEX_MUTATION_MANY if m > MANY else INDEX_MUTATION,
    )
    bred, result = trials.evaluate(parents.Z[rows], points[rows], trial)
    if result is None:
        return
    remember(state, trials.seen, settings, evaluator)
    if not fixed:
        # A copy of a known point, as where only coordinates changed that no objective depends on, is no success.
        kept = state.archive.joined(state.outside).has(result.F) & ~parents.has(result.F)
        state.credit = updated_credit(state.credit, operator[bred], kept)
