"""Individual actions of the agents, in this order: inertia, pattern search, differential evolution.

The functions `inertia`, `coordinate_step`, `differential` and `along_archive` return one proposal for each of k agents, from their
positions X (k, d) in the unit box; they evaluate nothing. The proposals of all agents are evaluated together, and the agents without
success try the next action (Ricciardi and Vasile 2015, section 3.1).

Where a front is a surface, lone agents try all coordinates, and then differences of points of the archive.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..evaluation.evaluator import Box
from ..pareto.dominance import CURVE
from .breeding import FEW, mates
from .state import SearchState
from .trials import Trials

Proposal = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Function of the rows (k,) and positions (k, d) of agents that returns proposals (k, d)."""
SHORTEST = 0.01
"""Least part of a difference of two points of the archive that a lone agent tries."""
LONE = 1
"""Row of the lone agents in `SearchState.progress`."""
LEAST, FORGET = 0.05, 0.05
"""Least share of the lone agents, and of the others; part of the progress that is forgotten in each iteration."""


def inertia(box: Box, X: np.ndarray, velocity: np.ndarray, rho: np.ndarray, shorten: bool, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) along the velocity, by a random fraction of it. X, velocity (k, d), rho (k,)."""
    step = box.stop_outward(X, rho[:, None] * velocity)
    fraction = rng.random(len(X)) * (box.reach(X, step) if shorten else 1.0)
    return box.put_back(X + fraction[:, None] * step)


def coordinate_step(box: Box, X: np.ndarray, coordinate: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Proposals (k, d) that differ from X in one coordinate each, by a step (k,) in units of span; put back into the box."""
    trial = X.copy()
    trial[np.arange(len(X)), coordinate] += step
    return np.where(trial == X, X, box.put_back(trial))


def differential(box: Box, X: np.ndarray, donors: np.ndarray, F: float, CR: float, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) of differential evolution: from x along (x3 - x) + F (x1 - x2), in some of the coordinates, by a random fraction. X
    (k, d), donors (3, k, d)."""
    first, second, third = donors
    step = box.difference(third, X) + F * box.difference(first, second)
    part = rng.random(X.shape) < CR
    part[np.arange(len(X)), rng.integers(X.shape[1], size=len(X))] = True
    step = box.stop_outward(X, np.where(part, step, 0.0))
    fraction = rng.random(len(X)) * box.reach(X, step)
    return box.put_back(X + fraction[:, None] * step)


def along_archive(box: Box, X: np.ndarray, archive: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) by a part of the difference of two points of the archive (a, d) near each agent. The logarithm of the part is
    uniform, from that of `SHORTEST` to 0."""
    first, second, _ = mates(box, X, archive, rng, wide=0.0)
    part = SHORTEST ** rng.random((len(X), 1))
    return box.put_back(X + part * box.difference(first, second))


def distinct_others(agents: np.ndarray, population: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """Rows (count, k) of `count` different other members of a population for each of k agents; if there are too few, they are repeated."""
    scores = rng.random((len(agents), population))
    scores[np.arange(len(agents)), agents] = np.inf
    return np.argsort(scores, axis=1)[:, np.arange(count) % max(population - 1, 1)].T


def lone_share(progress: np.ndarray) -> float:
    """Share of the lone agents in the evaluations of all agents: by what they gain in one, and what the others do, with a least share for
    each. progress (2, 2)."""
    gained, tried = progress.T
    rate = gained / np.maximum(tried, 1.0)
    part = rate[LONE] / rate.sum() if rate.any() else 0.5
    return float(LEAST + (1.0 - 2.0 * LEAST) * part)


def acting_agents(count: int, others: int, ahead: float, rng: np.random.Generator) -> np.ndarray:
    """Rows of the agents that act in an iteration: the first `others`, and of the lone ones after them at most as many, drawn anew; none of
    these if they are `ahead` of their share."""
    lone = max(count - others, 0)
    if not lone or ahead > 0.0:
        return np.arange(min(count, others))
    if lone <= others:
        return np.arange(count)
    return np.concatenate([np.arange(others), others + np.sort(rng.choice(lone, others, replace=False))])


def account(state: SearchState, gained: np.ndarray, tried: np.ndarray, others: int) -> None:
    """Count what the agents gained (n,), in so many evaluations (n,); the first `others` are not lone."""
    parts = (slice(None, others), slice(others, None))
    state.progress = (1.0 - FORGET) * state.progress + [[gained[part].sum(), tried[part].sum()] for part in parts]
    share = lone_share(state.progress)
    state.ahead = max(state.ahead + float(tried[others:].sum() - share / (1.0 - share) * tried[:others].sum()), 0.0)


def individual_actions(trials: Trials) -> None:
    """Try inertia, pattern search and differential evolution in turn with the agents that act; each stops at its first success."""
    state, settings, box = trials.state, trials.settings, trials.box
    agents, rng = state.agents, state.rng
    count, d, m = len(agents), len(box.lower), state.directions.shape[1]
    waiting = acting = acting_agents(count, settings.agents, state.ahead, rng)
    # Those that search alone on a surface.
    alone = (np.arange(count) >= settings.agents) & (m > CURVE)

    def attempt(propose: Proposal, velocity: bool = True, able: np.ndarray | None = None) -> None:
        nonlocal waiting
        rows = waiting if able is None else waiting[able[waiting]]
        if rows.size:
            X = trials.positions(rows)
            better = rows[trials.evaluate_and_accept(rows, X, propose(rows, X), velocity)]
            waiting = waiting[~np.isin(waiting, better)]

    def along_velocity(rows: np.ndarray, X: np.ndarray) -> np.ndarray:
        return inertia(box, X, agents.velocity[rows], agents.rho[rows], settings.shorten, rng)

    def along_coordinate(coordinate: np.ndarray, step: np.ndarray) -> Proposal:
        return lambda rows, X: coordinate_step(box, X, coordinate[rows], step[rows])

    attempt(along_velocity, settings.keep_velocity)
    order = rng.permuted(np.tile(np.arange(d), (count, 1)), axis=1)
    filled = state.parents if settings.breeding != 0.0 else state.archive  # where nothing is bred, agents alone lower violations
    every, some = (settings.coordinates_to_scan(d, points, m, trials.planned) for points in (0, len(filled)))
    scanned = np.where(alone, every, some)
    for tried, coordinate in enumerate(order.T[: scanned[acting].max()]):
        length = rng.random((2, count)) ** settings.concentration * agents.rho / 2
        side = rng.choice([-1.0, 1.0], count)
        for step in (side * length[0], -side * length[1]):
            attempt(along_coordinate(coordinate, step), able=scanned > tried)

    def by_differences(rows: np.ndarray, X: np.ndarray) -> np.ndarray:
        donors = trials.positions()[distinct_others(rows, count, 3, rng)]
        trial = differential(box, X, donors, settings.F, settings.CR, rng)
        lone = alone[rows]
        if lone.any() and len(state.archive) > FEW:
            trial[lone] = along_archive(box, X[lone], box.to_unit(state.archive.Z[:, trials.evaluator.free]), rng)
        return trial

    attempt(by_differences, settings.keep_velocity)
    if count > settings.agents:
        account(state, trials.gained, trials.tried, settings.agents)
    agents.adapt_radius(acting, trials.credited, settings.rho, settings.contraction, settings.max_contractions)
