"""Individual actions: what an agent tries by itself, in the order inertia, pattern search, differential evolution.

Each function proposes one point for each of k agents, from their positions X (k, d) in the unit box; none evaluates anything. The search
sends the proposals of all agents together, and goes on with those that had no success (Ricciardi and Vasile 2015, section 3.1).
"""

from __future__ import annotations

import numpy as np

from ..evaluation.box import Box
from .settings import Settings
from .state import SearchState
from .trials import Trials


def inertia(box: Box, X: np.ndarray, velocity: np.ndarray, rho: np.ndarray, shorten: bool, rng: np.random.Generator) -> np.ndarray:
    """Go on along the velocity, by a random fraction of it.

    Parameters
    ----------
    X, velocity : arrays (k, d)
    rho : array (k,)
        Relative radius of each agent.
    shorten : bool
        Whether the step is shortened until it stays in the box, as in the paper. Otherwise its end is put back into the box: one variable
        close to a bound does not stop all the others.

    Returns
    -------
    array (k, d)
        The proposals. A row equals that of X where the velocity is zero or pushes out of the box.
    """
    step = box.stop_outward(X, rho[:, None] * velocity)
    fraction = rng.random(len(X)) * (box.reach(X, step) if shorten else 1.0)
    return box.put_back(X + fraction[:, None] * step)


def coordinate_step(box: Box, X: np.ndarray, coordinate: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Move one coordinate of each point by a step (k,) in units of span, and put it back in the box."""
    trial = X.copy()
    trial[np.arange(len(X)), coordinate] += step
    return np.where(trial == X, X, box.put_back(trial))


def differential(box: Box, X: np.ndarray, donors: np.ndarray, F: float, CR: float, rng: np.random.Generator) -> np.ndarray:
    """Differential evolution: from x along (x3 - x) + F (x1 - x2), in a random part of the coordinates, by a random fraction.

    Parameters
    ----------
    X : array (k, d)
    donors : array (3, k, d)
        x1, x2 and x3 of each agent: three others, all different (Storn and Price 1997).
    F, CR : float
        Weight of the difference; probability that a coordinate takes part. One coordinate always does.

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
    """For each of k agents, `count` different others of a population, (count, k) of int; too few others are repeated in turn."""
    scores = rng.random((len(agents), population))
    scores[np.arange(len(agents)), agents] = np.inf
    return np.argsort(scores, axis=1)[:, np.arange(count) % max(population - 1, 1)].T


def individual_actions(state: SearchState, settings: Settings, box: Box, trials: Trials) -> None:
    """Inertia, pattern search, differential evolution: the agents go through them in step, and each leaves at its first success."""
    agents, rng = state.agents, state.rng
    waiting = np.arange(len(agents))
    count, d = len(agents), len(box.lower)

    def attempt(propose, velocity=True) -> None:
        nonlocal waiting
        if waiting.size:
            X = trials.positions(waiting)
            waiting = waiting[~trials.evaluate_and_accept(waiting, X, propose(waiting, X), velocity)]

    def along_velocity(who: np.ndarray, X: np.ndarray) -> np.ndarray:
        return inertia(box, X, agents.velocity[who], agents.rho[who], settings.shorten, rng)

    attempt(along_velocity, settings.keep_velocity)
    order = rng.permuted(np.tile(np.arange(d), (count, 1)), axis=1)
    scanned = settings.coordinates_to_scan(d, len(state.archive), state.directions.shape[1], trials.budget)
    for coordinate in order.T[:scanned]:
        length = rng.random((2, count)) ** settings.concentration * agents.rho / 2
        side = rng.choice([-1.0, 1.0], count)
        attempt(lambda who, X, c=coordinate, s=side * length[0]: coordinate_step(box, X, c[who], s[who]))
        attempt(lambda who, X, c=coordinate, s=-side * length[1]: coordinate_step(box, X, c[who], s[who]))

    def by_differences(who: np.ndarray, X: np.ndarray) -> np.ndarray:
        donors = trials.positions()[distinct_others(who, count, 3, rng)]
        return differential(box, X, donors, settings.F, settings.CR, rng)

    attempt(by_differences, settings.keep_velocity)
    agents.adapt_radius(trials.credited, settings.rho, settings.contraction, settings.max_contractions)
