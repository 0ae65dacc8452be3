"""Individual actions of the agents, in this order: inertia, pattern search, differential evolution.

The functions `inertia`, `coordinate_step`, `differential` and `along_archive` return one proposal for each of k agents, from their
positions X (k, d) in the unit box; they evaluate nothing. The proposals of all agents are evaluated together, and the agents without
success try the next action (Ricciardi and Vasile 2015, section 3.1).

In long searches, agents without a direction reach parts of the front that the archive of presently non-dominated points has lost. Where a
front is a surface, they try all coordinates, and then differences of points of the archive.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..evaluation.evaluator import UnitBox
from ..pareto.dominance import CURVE
from .breeding import FEW_MATES, mates
from .state import SearchState
from .trials import Trials

Proposal = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Function of the rows (k,) and positions (k, d) of agents that returns proposals (k, d)."""
UNDIRECTED_SHARE = 0.05
"""Least share of the agents without a direction in the evaluations of all agents, and of the others."""


def inertia(box: UnitBox, X: np.ndarray, velocity: np.ndarray, rho: np.ndarray, shorten: bool, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) along the velocity (k, d), by a random fraction of it and of the radius (k,)."""
    step = box.stop_outward(X, rho[:, None] * velocity)
    fraction = rng.random(len(X)) * (box.reach(X, step) if shorten else 1.0)
    return box.put_back(X + fraction[:, None] * step)


def coordinate_step(box: UnitBox, X: np.ndarray, coordinate: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Proposals (k, d) that differ from X in one coordinate each, by a step (k,) in units of span; put back into the box."""
    trial = X.copy()
    trial[np.arange(len(X)), coordinate] += step
    return np.where(trial == X, X, box.put_back(trial))


def differential(box: UnitBox, X: np.ndarray, donors: np.ndarray, F: float, CR: float, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) of differential evolution with donors (3, k, d): from x along (x3 - x) + F (x1 - x2), in some of the coordinates, by
    a random fraction."""
    first, second, third = donors
    step = box.difference(third, X) + F * box.difference(first, second)
    part = rng.random(X.shape) < CR
    part[np.arange(len(X)), rng.integers(X.shape[1], size=len(X))] = True
    step = box.stop_outward(X, np.where(part, step, 0.0))
    fraction = rng.random(len(X)) * box.reach(X, step)
    return box.put_back(X + fraction[:, None] * step)


def along_archive(box: UnitBox, X: np.ndarray, archive: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) by a part of the difference of two points of the archive (a, d) near each agent. The logarithm of the part is
    uniform, from that of 0.01 to 0."""
    first, second, _ = mates(box, X, archive, rng, wide=0.0)
    part = 0.01 ** rng.random((len(X), 1))
    return box.put_back(X + part * box.difference(first, second))


def distinct_others(agents: np.ndarray, population: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """Rows (count, k) of `count` different other members of a population for each of k agents; if there are too few, they are repeated."""
    scores = rng.random((len(agents), population))
    scores[np.arange(len(agents)), agents] = np.inf
    return np.argsort(scores, axis=1)[:, np.arange(count) % max(population - 1, 1)].T


def acting_agents(count: int, directed: int, excess: float, rng: np.random.Generator) -> np.ndarray:
    """Rows of the agents that act in an iteration: the `directed` ones, and at most as many of the others after them, drawn at random; none
    of these while their evaluations exceed their share."""
    others = max(count - directed, 0)
    if not others or excess > 0.0:
        return np.arange(min(count, directed))
    if others <= directed:
        return np.arange(count)
    return np.concatenate([np.arange(directed), directed + np.sort(rng.choice(others, directed, replace=False))])


def share_evaluations(state: SearchState, gained: np.ndarray, tried: np.ndarray, directed: int) -> None:
    """Credit agents for gains (n,) in so many evaluations (n,): the share of evaluations of agents without a direction, after the
    `directed` ones, is their gain for each evaluation relative to that of the others."""
    parts = (slice(None, directed), slice(directed, None))
    state.undirected.add(*(np.array([one[part].sum() for part in parts]) for one in (gained, tried)))
    rates = state.undirected.rates()
    share = UNDIRECTED_SHARE + (1.0 - 2.0 * UNDIRECTED_SHARE) * (rates[1] / rates.sum() if rates.any() else 0.5)
    state.excess = max(float(state.excess + tried[directed:].sum() - share / (1.0 - share) * tried[:directed].sum()), 0.0)


def individual_actions(trials: Trials) -> None:
    """Try inertia, pattern search and differential evolution in turn with the agents that act; each stops at its first success."""
    state, settings, box = trials.state, trials.settings, trials.box
    agents, rng, variant = state.agents, state.rng, settings.variant
    count, d, m = len(agents), len(box.lower), state.directions.shape[1]
    waiting = acting = acting_agents(count, settings.agents, state.excess, rng)
    undirected = (np.arange(count) >= settings.agents) & (m > CURVE)  # of those on a surface

    def attempt(propose: Proposal, able: np.ndarray | None = None, scan: bool = False) -> None:
        nonlocal waiting
        rows = waiting if able is None else waiting[able[waiting]]
        if rows.size:
            X = trials.positions(rows)
            better = rows[trials.evaluate_and_accept(rows, X, propose(rows, X), scan)]
            waiting = waiting[~np.isin(waiting, better)]

    def along_velocity(rows: np.ndarray, X: np.ndarray) -> np.ndarray:
        return inertia(box, X, agents.velocity[rows], agents.rho[rows], variant.shorten, rng)

    def along_coordinate(coordinate: np.ndarray, step: np.ndarray) -> Proposal:
        return lambda rows, X: coordinate_step(box, X, coordinate[rows], step[rows])

    def by_differences(rows: np.ndarray, X: np.ndarray) -> np.ndarray:
        donors = trials.positions()[distinct_others(rows, count, 3, rng)]
        trial = differential(box, X, donors, variant.F, variant.CR, rng)
        alone = undirected[rows]
        if alone.any() and len(state.archive) > FEW_MATES:
            trial[alone] = along_archive(box, X[alone], box.to_unit(state.archive.Z[:, trials.evaluator.free]), rng)
        return trial

    attempt(along_velocity)
    order = rng.permuted(np.tile(np.arange(d), (count, 1)), axis=1)
    filled = state.parents if variant.breeding else state.archive  # where nothing is bred, agents alone lower violations
    every, some = (settings.coordinates_to_scan(d, points, m, trials.planned) for points in (0, len(filled)))
    some = some if box.whole is None else int(np.isinf(box.designs))  # steps of whole numbers are those of `try_neighbours`
    scanned = np.where(undirected, every, some)
    for tried, coordinate in enumerate(order.T[: scanned[acting].max()]):
        length = rng.random((2, count)) * agents.rho / 2
        side = rng.choice([-1.0, 1.0], count)
        for step in (side * length[0], -side * length[1]):
            attempt(along_coordinate(coordinate, step), able=scanned > tried, scan=True)
    attempt(by_differences)
    if count > settings.agents:
        share_evaluations(state, trials.gained, trials.tried, settings.agents)
    agents.adapt_radius(acting, trials.successful, variant.rho, variant.contraction, variant.max_contractions)
