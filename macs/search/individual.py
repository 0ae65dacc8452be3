"""Individual actions of the agents, in this order: inertia, pattern search, differential evolution.

The functions `inertia`, `coordinate_step` and `differential` return one proposal for each of k agents, from their positions X (k, d) in the
unit box; they evaluate nothing. The proposals of all agents are evaluated together, and the agents without success try the next action
(Ricciardi and Vasile 2015, section 3.1).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..evaluation.box import Box
from .trials import Trials

Proposal = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Function of the rows (k,) and positions (k, d) of agents that returns proposals (k, d)."""


def inertia(box: Box, X: np.ndarray, velocity: np.ndarray, rho: np.ndarray, shorten: bool, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) along the velocity, by a random fraction of it.

    Parameters
    ----------
    box : Box
    X, velocity : arrays (k, d)
    rho : array (k,)
        Relative radius of each agent.
    shorten : bool
        True: the step is shortened until it stays in the box, as in the paper. False: its end is put back into the box, so that one
        variable near a bound does not stop the others.
    rng : numpy.random.Generator

    Returns
    -------
    array (k, d)
        A row equals that of X if the velocity is zero or points out of the box.
    """
    step = box.stop_outward(X, rho[:, None] * velocity)
    fraction = rng.random(len(X)) * (box.reach(X, step) if shorten else 1.0)
    return box.put_back(X + fraction[:, None] * step)


def coordinate_step(box: Box, X: np.ndarray, coordinate: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Proposals (k, d) that differ from X in one coordinate each, by a step (k,) in units of span; put back into the box."""
    trial = X.copy()
    trial[np.arange(len(X)), coordinate] += step
    return np.where(trial == X, X, box.put_back(trial))


def differential(box: Box, X: np.ndarray, donors: np.ndarray, F: float, CR: float, rng: np.random.Generator) -> np.ndarray:
    """Proposals (k, d) of differential evolution: from x along (x3 - x) + F (x1 - x2), in some of the coordinates, by a random fraction.

    Parameters
    ----------
    box : Box
    X : array (k, d)
    donors : array (3, k, d)
        x1, x2 and x3 for each agent: three different other agents (Storn and Price 1997).
    F, CR : float
        Weight of the difference; probability that a coordinate changes. At least one coordinate always does.
    rng : numpy.random.Generator

    Returns
    -------
    array (k, d)
    """
    first, second, third = donors
    step = box.difference(third, X) + F * box.difference(first, second)
    part = rng.random(X.shape) < CR
    part[np.arange(len(X)), rng.integers(X.shape[1], size=len(X))] = True
    step = box.stop_outward(X, np.where(part, step, 0.0))
    fraction = rng.random(len(X)) * box.reach(X, step)
    return box.put_back(X + fraction[:, None] * step)


def distinct_others(agents: np.ndarray, population: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """Rows (count, k) of `count` different other members of a population for each of k agents; if there are too few, they are repeated."""
    scores = rng.random((len(agents), population))
    scores[np.arange(len(agents)), agents] = np.inf
    return np.argsort(scores, axis=1)[:, np.arange(count) % max(population - 1, 1)].T


def acting_agents(count: int, others: int, rng: np.random.Generator) -> np.ndarray:
    """Rows of the agents that act in an iteration: the first `others`, and of the lone ones after them at most as many, drawn anew.

    Each lone agent may need long, but together they leave most evaluations to what improves the archive.
    """
    lone = max(count - others, 0)
    if lone <= others:
        return np.arange(count)
    return np.concatenate([np.arange(others), others + np.sort(rng.choice(lone, others, replace=False))])


def individual_actions(trials: Trials) -> None:
    """Try inertia, pattern search and differential evolution in turn with the agents that act; each stops at its first success."""
    state, settings, box = trials.state, trials.settings, trials.box
    agents, rng = state.agents, state.rng
    count, d = len(agents), len(box.lower)
    waiting = acting = acting_agents(count, settings.agents, rng)

    def attempt(propose: Proposal, velocity: bool = True) -> None:
        nonlocal waiting
        if waiting.size:
            X = trials.positions(waiting)
            waiting = waiting[~trials.evaluate_and_accept(waiting, X, propose(waiting, X), velocity)]

    def along_velocity(rows: np.ndarray, X: np.ndarray) -> np.ndarray:
        return inertia(box, X, agents.velocity[rows], agents.rho[rows], settings.shorten, rng)

    def along_coordinate(coordinate: np.ndarray, step: np.ndarray) -> Proposal:
        return lambda rows, X: coordinate_step(box, X, coordinate[rows], step[rows])

    attempt(along_velocity, settings.keep_velocity)
    order = rng.permuted(np.tile(np.arange(d), (count, 1)), axis=1)
    filled = state.parents if settings.breeding != 0.0 else state.archive  # where nothing is bred, agents alone lower violations
    scanned = settings.coordinates_to_scan(d, len(filled), state.directions.shape[1], trials.planned)
    for coordinate in order.T[:scanned]:
        length = rng.random((2, count)) ** settings.concentration * agents.rho / 2
        side = rng.choice([-1.0, 1.0], count)
        for step in (side * length[0], -side * length[1]):
            attempt(along_coordinate(coordinate, step))

    def by_differences(rows: np.ndarray, X: np.ndarray) -> np.ndarray:
        donors = trials.positions()[distinct_others(rows, count, 3, rng)]
        return differential(box, X, donors, settings.F, settings.CR, rng)

    attempt(by_differences, settings.keep_velocity)
    agents.adapt_radius(acting, trials.credited, settings.rho, settings.contraction, settings.max_contractions)
