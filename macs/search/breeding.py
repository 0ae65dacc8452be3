"""Breeding: offspring of the points of the archive, by crossover and by differences.

The agents are few, and each searches near its own position. The archive covers the whole front, and the differences of its points lead
along the front: crossover exchanges coordinates between two points, and the difference of two points is a step for a third. Crossover suits
separable problems with many local fronts, differences suit coupled variables. The operator with more archived offspring is preferred.

As long as nothing is feasible the archive is empty, and the least violated points are bred likewise: they are ordered by one number, and a
generation of children with coordinates of both parents lowers it sooner than steps of single agents. Tournaments of two then choose the
parents (Goldberg and Deb 1991), and mutation steps are longer. Later, infeasible points with better objectives than the archive's are bred
with it: the feasible set may have separate parts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..evaluation.evaluator import UnitBox
from ..pareto.dominance import CURVE
from ..pareto.niches import MANY
from .state import update_archives
from .trials import Trials

FEW_MATES = 4
"""An archive of at most so many points is too small for mates: the agents are mates too."""
NEAREST_MATES = 20
"""Mates are mostly drawn from so many nearest points (Zhang and Li 2007; Li and Zhang 2009)."""
LEAST_SHARE = 0.05
"""Least share of crossover, and of differences, so that it can succeed later."""
DIFFERENCE_WEIGHT = 0.5
"""Weight of the difference of two mates (Li and Zhang 2009)."""


@dataclass(frozen=True)
class Breeding:
    """Parameters of breeding. Indices are those of distributions: a higher one puts offspring nearer to their parents (Deb and Agrawal
    1995)."""

    # Part of the children that are made by differences, the others by crossover; None: by what the archive has kept of both.
    differences: float | None = None
    wide: float = 0.3  # probability that mates are drawn from the whole pool instead of the nearest points
    crossover: float = 15.0  # index
    from_mate: float = 0.25  # part of the crossed coordinates in which a child is near the mate
    mutation: float = 20.0  # index


ALONG_CURVE = Breeding()
ON_SURFACE = replace(ALONG_CURVE, crossover=30.0, from_mate=0.5)
"""With three objectives: as in NSGA-III (Deb and Jain 2014)."""
MANY_OBJECTIVES = replace(ON_SURFACE, differences=0.05, wide=1.0, mutation=10.0)
"""With more, where nearly every new point is non-dominated: the archive keeps points of poor local fronts for long, and longer steps leave
these sooner."""
INFEASIBLE_POINTS = replace(ON_SURFACE, differences=0.05, wide=1.0, mutation=5.0)
"""As long as nothing is feasible: the least violated points are soon nearly alike, often at a local optimum of the violation."""


def mates(box: UnitBox, X: np.ndarray, pool: np.ndarray, rng: np.random.Generator, wide: float) -> np.ndarray:
    """Three different points of the pool (p, d) for each of X (k, d), mostly near it and never equal to it: (3, k, d).

    With the probability `wide` they are drawn from the whole pool. If it has too few other points, the point itself takes their places; its
    difference to itself is zero.
    """
    squared = box.squared_distances(X, pool)
    squared[squared == 0.0] = np.inf
    order = np.argsort(squared, axis=1, kind="stable")
    others = np.isfinite(squared).sum(axis=1)
    eligible = np.where(rng.random(len(X)) < wide, others, np.minimum(others, NEAREST_MATES))
    rank = np.arange(len(pool))
    score = np.where(rank < eligible[:, None], rng.random(order.shape), 1.0)
    picked = np.argsort(score, axis=1)[:, :3]
    exists = picked < eligible[:, None]
    missing = 3 - picked.shape[1]
    if missing > 0:
        picked, exists = np.pad(picked, ((0, 0), (0, missing))), np.pad(exists, ((0, 0), (0, missing)))
    rows = np.take_along_axis(order, picked, axis=1)
    return np.where(exists.T[:, :, None], pool[rows.T], X)


def crossover(box: UnitBox, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator, index: float, from_mate: float) -> np.ndarray:
    """Children (k, d) by simulated binary crossover (Deb and Agrawal 1995): half of the coordinates are crossed with those of the first
    mate.

    In a part `from_mate` of these coordinates a child is near the mate, in the others near its parent. Distances scale with the difference
    of parent and mate, and are the shorter, the higher the `index`.
    """
    u = rng.random(X.shape)
    ratio = np.where(u < 0.5, 2.0 * u, 0.5 / (1.0 - u)) ** (1.0 / (index + 1.0))
    share = 0.5 * np.where(rng.random(X.shape) < from_mate, 1.0 + ratio, 1.0 - ratio)
    return X + np.where(rng.random(X.shape) < 0.5, share * box.difference(mates[0], X), 0.0)


def difference(box: UnitBox, X: np.ndarray, mates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Children (k, d) by differential evolution from the parent: x + F (m2 - m3); every second child in half of the coordinates only."""
    moving = rng.random(X.shape) < np.where(rng.random((len(X), 1)) < 0.5, 1.0, 0.5)
    return X + np.where(moving, DIFFERENCE_WEIGHT * box.difference(mates[1], mates[2]), 0.0)


def mutate(X: np.ndarray, rng: np.random.Generator, index: float) -> np.ndarray:
    """Points (k, d) after polynomial mutation (Deb and Goyal 1996) of one coordinate on average; they may be outside the box."""
    u = rng.random(X.shape)
    size = 1.0 - (1.0 - np.abs(2.0 * u - 1.0)) ** (1.0 / (index + 1.0))
    return X + np.where(rng.random(X.shape) < 1.0 / X.shape[1], np.copysign(size, u - 0.5), 0.0)


def breed(
    box: UnitBox, X: np.ndarray, pool: np.ndarray, how: Breeding, share: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """One offspring (k, d) of each parent at X (k, d), with mates of the pool (p, d), and the mask (k,) of the share that differences
    have made."""
    others = mates(box, X, pool, rng, how.wide)
    differs = rng.random(len(X)) < share
    crossed = crossover(box, X, others, rng, how.crossover, how.from_mate)
    children = np.where(differs[:, None], difference(box, X, others, rng), crossed)
    return box.put_back(mutate(children, rng, how.mutation)), differs


def try_neighbours(trials: Trials) -> None:
    """Evaluate designs that differ from points of the archive, or from the least violated ones, in a few whole numbers or choices: at most
    four for each agent. Most are those that the difference of two points leads to."""
    state, box = trials.state, trials.box
    if box.whole is None or box.unordered is None or not len(state.parents):
        return
    rows = np.concatenate([state.rng.permutation(len(state.parents)) for _ in range(3)])[: 4 * trials.settings.agents]
    points = box.to_unit(state.parents.Z[rows][:, trials.evaluator.free])
    first, second, _ = mates(box, points, box.to_unit(state.parents.Z[:, trials.evaluator.free]), state.rng, 0.0)
    along = np.where(box.unordered, first, points + first - second) if len(state.parents) > FEW_MATES else points
    near = box.neighbours(points, 1, state.rng)
    trial = np.where(box.whole & (state.rng.random((len(points), 1)) < 0.7), box.put_back(along), near)
    trials.evaluate(state.parents.Z[rows], points, trial)
    update_archives(state, trials.seen, trials.settings, trials.evaluator)


def breed_archive(trials: Trials) -> None:
    """Breed offspring of the archive's points, or of the least violated points as long as nothing is feasible, from as many parents as
    possible; and one of each infeasible point with better objectives than the archive."""
    state, settings, evaluator, box, rng = trials.state, trials.settings, trials.evaluator, trials.box, trials.state.rng
    parents, m, feasible = state.parents, len(state.ideal), len(state.archive) > 0
    undirected = min(max(len(state.agents) - settings.agents, 0), settings.agents)
    count = settings.offspring(len(parents), m, undirected, feasible)
    if not count:
        return
    if feasible:
        rows = np.concatenate([rng.permutation(len(parents)) for _ in range(-(-count // len(parents)))])[:count]
        rows = np.concatenate([rows, len(parents) + np.arange(len(state.infeasible))])
        parents = parents.joined(state.infeasible)
    else:
        rows = rng.integers(len(parents), size=(count, 2)).min(axis=1)  # the first are the least violated
    points = box.to_unit(parents.Z[:, evaluator.free])
    pool = points if len(points) > FEW_MATES else np.vstack([points, trials.positions()])
    how = INFEASIBLE_POINTS if not feasible else ALONG_CURVE if m <= CURVE else ON_SURFACE if m <= MANY else MANY_OBJECTIVES
    rates = state.operators.rates(prior=0.1)
    share = LEAST_SHARE + (1.0 - 2.0 * LEAST_SHARE) * rates[1] / rates.sum() if how.differences is None else how.differences
    children, differs = breed(box, points[rows], pool, how, share, rng)
    bred, result = trials.evaluate(parents.Z[rows], points[rows], children)
    update_archives(state, trials.seen, settings, evaluator)
    if result is not None and how.differences is None:
        # A copy of a known point, as where only coordinates changed that no objective depends on, is no success.
        kept = state.archive.joined(state.infeasible).has(result.F) & ~parents.has(result.F)
        made = np.stack([~differs[bred], differs[bred]])
        state.operators.add((made & kept).sum(axis=1), made.sum(axis=1))
