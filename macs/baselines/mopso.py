"""MOPSO: a swarm led by points of thinly populated hypercubes of an archive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..evaluation.box import Box
from ..evaluation.evaluator import Evaluator
from ..pareto.archive import Archive
from ..pareto.dominance import dominates, nondominated
from . import constraints as handlings
from .population import Members, PopulationSolver, State, distinct, evaluate, full_vectors, thinned

WAITING = -1


@dataclass
class FlightState(State):
    """The members are the particles, in their order.

    Attributes
    ----------
    best : Members
        The best point that each particle has been at.
    leaders : Members
        What the swarm may follow: the algorithm's own archive.
    velocity : array (n, d)
        In spans of the variables.
    launched : int
        After how many evaluations the swarm was complete and began to fly; -1 as long as first particles are sought.
    """

    best: Members
    leaders: Members
    velocity: np.ndarray
    launched: int


@dataclass(frozen=True)
class MOPSO(PopulationSolver):
    """MOPSO after Coello Coello, Pulido and Lechuga (2004), in the variant of Armellin and Lavagna (2008), section 4.1.

    Each particle is drawn to the best place where it has been and to a point of the archive, which a roulette prefers from thinly populated
    hypercubes of an adaptive grid; of a full archive, points of the fullest hypercubes are left out. Inertia decreases linearly. Their
    velocity formula, eq. (22), has a slip of sign, which is mended here; see `particles`. For any number of objectives.

    Feasible solutions are preserved (with handling="feasible-first"): the swarm begins with feasible particles only, for which candidates
    are drawn, a swarm at a time, until there are enough. Each of these counts as an evaluation, and no more than `search` of the budget
    is spent on it: then the least violated ones fly too, towards less violation, until they are feasible. A feasible place is never given
    up for an infeasible one. If nothing feasible is found at all, the front is empty; its `message` and `closest` say what is nearest.

    Beyond that, as for the other baselines: a failed evaluation counts as infeasible, behind all others; where the evaluator moves
    candidates, particles take the points that come back; of a last flight for which the budget is too small, the first particles fly;
    `start` takes the first places of the swarm. Periodic variables are closed: particles fly through their bounds, and the short way round.

    Parameters
    ----------
    particles : int, default 100
        At least 1.
    archive : int, default 100
        Largest number of points in the archive, and so on the front.
    cells : int, default 30
        Into how many parts the grid divides each objective.
    inertia, final_inertia : float, default 0.4 and 0
        Weight of a particle's velocity, when the swarm begins to fly and when the budget is spent; at least 0. With the paper's 1.4 and
        0.4, see `paper`, a swarm of many variables flies from bound to bound for most of its time.
    cognitive, social : float, default 2
        Weights of the step to a particle's own best place and of that to its leader, each times a random number; at least 0.
    max_velocity : float, default 1
        Largest step in a variable, in spans of it, in (0, 1].
    search : float, default 0.2
        Share of the budget, in [0, 1], that may be spent in search of feasible first particles, the first swarm included. 0: that one is
        taken as it is drawn.
    handling, penalty, degree
        As for `NSGA2`. With "penalty" and "objective", the first swarm is taken as it is drawn.

    Raises
    ------
    ValueError
        Where a setting is out of its range; the message names it.
    """

    particles: int = 100
    archive: int = 100
    cells: int = 30
    inertia: float = 0.4
    final_inertia: float = 0.0
    cognitive: float = 2.0
    social: float = 2.0
    max_velocity: float = 1.0
    search: float = 0.2
    handling: str = "feasible-first"
    penalty: float = 1000.0
    degree: str = "largest"

    def __post_init__(self) -> None:
        weights = dict.fromkeys(("inertia", "final_inertia", "cognitive", "social"), (0.0, np.inf))
        counts = {"particles": 1, "archive": 1, "cells": 1}
        self._check(counts, {**weights, "max_velocity": (1e-9, 1), "search": (0, 1)})

    @classmethod
    def paper(cls, **overrides: Any) -> MOPSO:
        """The settings of Armellin and Lavagna: 20 particles, an archive of 100, inertia from 1.4 to 0.4; `overrides` as for MOPSO itself.

        What stays different: it spends its budget, where theirs also ends when the mean of the front stands still; and theirs knows no
        limit of the search for feasible first particles, nor of velocities.
        """
        return cls(**({"particles": 20, "archive": 100, "inertia": 1.4, "final_inertia": 0.4} | overrides))

    def begin(self, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> FlightState:
        """Evaluate a first swarm; see `Solver.begin`."""
        if budget <= evaluator.counts.evaluations:
            raise ValueError(f"evaluations: the budget of {budget} leaves none")
        Z = self._candidates(evaluator, thinned(distinct(start), self.particles), self.particles, rng)
        swarm = evaluate(evaluator, Z[: budget - evaluator.counts.evaluations], self.degree)
        state = FlightState(
            members=swarm,
            archive=Archive.of(swarm, np.arange(0)),
            closest=Archive.of(swarm, np.arange(0)),
            iteration=0,
            first_feasible=0,
            all_feasible=0,
            rng=rng,
            best=swarm,
            leaders=swarm.take(np.arange(0)),
            velocity=np.zeros((len(swarm), len(evaluator.free))),
            launched=WAITING,
        )
        self._learn(state, swarm, evaluator, budget)
        return state

    def advance(self, state: FlightState, evaluator: Evaluator, budget: int) -> None:
        """One flight, or one more draw of first particles, within the budget of evaluations; changes `state`."""
        left = budget - evaluator.counts.evaluations
        if left <= 0:
            return
        if state.launched == WAITING:
            seen = self._drawn(state, evaluator, min(left, int(self.search * budget) - evaluator.counts.evaluations))
        else:
            seen = self._flown(state, evaluator, left, budget)
        state.iteration += 1
        self._learn(state, seen, evaluator, budget)

    def _drawn(self, state: FlightState, evaluator: Evaluator, most: int) -> Members:
        """Draw more first particles, at most `most`: the first that are feasible stay, and the least violated of the others."""
        count = len(state.members)
        seen = evaluate(evaluator, self._candidates(evaluator, np.empty((0, 0)), count, state.rng)[:most], self.degree)
        every = state.members.joined(seen)
        cv = handlings.excess(every.F, every.violation, evaluator.tolerance, every.degree)
        state.members = state.best = every.take(np.argsort(cv, kind="stable")[:count])
        return seen

    def _flown(self, state: FlightState, evaluator: Evaluator, left: int, budget: int) -> Members:
        """Let the particles fly once, the first `left` of them if they are more."""
        box, rng, tolerance, free = evaluator.box, state.rng, evaluator.tolerance, evaluator.free
        swarm, d = len(state.members), len(free)
        share = (evaluator.counts.evaluations - state.launched) / (budget - state.launched)
        followed = roulette(hypercubes(self._goals(state.leaders, tolerance), self.cells), swarm, rng)
        chance, rebound, coin = rng.random((2, swarm, d)), -rng.random((swarm, d)), rng.random(swarm) < 0.5

        X, best, leaders = (box.to_unit(some.Z[:, free]) for some in (state.members, state.best, state.leaders.take(followed)))
        weights = inertia(share, self.inertia, self.final_inertia), self.cognitive, self.social
        V = velocities(box, X, state.velocity, best, leaders, weights=weights, chance=chance, largest=self.max_velocity)
        X, V = moved(box, X, V, rebound)

        seen = evaluate(evaluator, full_vectors(evaluator, state.members, box.to_values(X))[:left], self.degree)
        n = len(seen)
        state.members = seen.joined(state.members.take(np.arange(n, swarm)))
        state.velocity = np.concatenate([V[:n], state.velocity[n:]])
        better = improved(self._goals(seen, tolerance), self._goals(state.best, tolerance)[:n], coin[:n])
        rows = np.arange(swarm)
        rows[np.flatnonzero(better)] += swarm
        state.best = state.best.joined(seen).take(rows)
        return seen

    def _learn(self, state: FlightState, seen: Members, evaluator: Evaluator, budget: int) -> None:
        """Offer what was seen to the archive; let the swarm fly from now on if it is complete."""
        tolerance = evaluator.tolerance
        every = state.leaders.joined(seen)
        goals = self._goals(every, tolerance)
        rows = np.flatnonzero(nondominated(goals))
        if len(rows) > self.archive:
            rows = rows[thin_out(hypercubes(goals[rows], self.cells), self.archive, state.rng)]
        state.leaders = every.take(rows)
        state.show(tolerance, seen, state.leaders, state.members)
        state.note(tolerance)
        spent = evaluator.counts.evaluations
        complete = self.handling != "feasible-first" or state.all_feasible or spent >= int(self.search * budget)
        if state.launched == WAITING and complete:
            state.launched = spent

    def _goals(self, points: Members, tolerance: float) -> np.ndarray:
        """What is minimised (n, m): objectives that say all, also of constraints; see `handling.by_objectives`."""
        return handlings.by_objectives(*self._told(points, tolerance))


def hypercubes(F: np.ndarray, cells: int) -> np.ndarray:
    """The hypercube of each of the points F (n, m), (n,) of int: those that are occupied are numbered from 0.

    Each objective's range is cut into `cells` equal parts; the greatest value belongs to the last. An objective that does not vary has one.
    """
    low, span = F.min(axis=0), np.ptp(F, axis=0)
    share = np.divide(F - low, span, out=np.zeros_like(F), where=span > 0.0)
    places = np.minimum((share * cells).astype(int), cells - 1)
    return np.unique(places, axis=0, return_inverse=True)[1].reshape(-1)


def roulette(cube: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw `count` points, with repetitions, by their hypercubes (n,): rows (count,).

    A hypercube is drawn in inverse proportion to the points in it, then one of these, all alike.
    """
    occupancy = np.bincount(cube)
    wheel = np.cumsum(1.0 / occupancy)
    drawn = np.searchsorted(wheel[:-1], wheel[-1] * rng.random(count), side="right")
    first = np.cumsum(occupancy) - occupancy
    within = (rng.random(count) * occupancy[drawn]).astype(int)
    return np.argsort(cube, kind="stable")[first[drawn] + within]


def thin_out(cube: np.ndarray, limit: int, rng: np.random.Generator) -> np.ndarray:
    """Which of the points in hypercubes (n,) to keep, (n,) of bool, `limit` of them.

    One at a time is left out, any of those in the fullest hypercube, which is drawn if there are several. (A roulette by occupancy would
    give every point the same chance, whatever its neighbours.)
    """
    keep, occupancy = np.ones(len(cube), dtype=bool), np.bincount(cube)
    for _ in range(len(cube) - limit):
        fullest = rng.choice(np.flatnonzero(occupancy == occupancy.max()))
        keep[rng.choice(np.flatnonzero(keep & (cube == fullest)))] = False
        occupancy[fullest] -= 1
    return keep


def inertia(share: float, first: float, last: float) -> float:
    """The weight w of the old velocity when this share of the search is over: on a line from `first` to `last`."""
    return first + (last - first) * min(max(share, 0.0), 1.0)


def velocities(
    box: Box,
    X: np.ndarray,
    V: np.ndarray,
    best: np.ndarray,
    leaders: np.ndarray,
    *,
    weights: tuple[float, float, float],
    chance: np.ndarray,
    largest: float,
) -> np.ndarray:
    """New velocities, for an interval of 1: w V + c1 r1 (best - X) + c2 r2 (leaders - X).

    Eq. (22), which is printed with a slip: its differences have the opposite sign, and particles would flee what they are to follow.

    Parameters
    ----------
    box : Box
    X, V, best, leaders : arrays (n, d)
        Positions and velocities of the particles, the best place of each, and the point of the archive that each follows. Across periodic
        bounds differences go the short way round.
    weights : (w, c1, c2)
    chance : array (2, n, d)
        r1 and r2, in [0, 1].
    largest : float
        In each coordinate; faster ones are slowed down to it.
    """
    w, c1, c2 = weights
    V = w * V + c1 * chance[0] * box.difference(best, X) + c2 * chance[1] * box.difference(leaders, X)
    return np.clip(V, -largest, largest)


def moved(box: Box, X: np.ndarray, V: np.ndarray, rebound: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n, d) after an interval of 1.

    A coordinate that leaves the box is set to the bound, and its velocity is multiplied by a number of `rebound` (n, d), in [-1, 0]. One
    that is periodic comes in at the other end, and keeps its velocity.
    """
    there = X + V
    out = ((there < 0.0) | (there > 1.0)) & ~box.wraps
    return box.put_back(there), np.where(out, V * rebound, V)


def improved(F: np.ndarray, best: np.ndarray, coin: np.ndarray) -> np.ndarray:
    """Whether particles (n,) take F (n, m) for their best instead of `best` (n, m): if it dominates; by `coin` (n,) if neither does.

    Eq. (20).
    """
    return dominates(F, best) | (~dominates(best, F) & coin)
