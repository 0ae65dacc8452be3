"""The loop of the search: individual actions, archive, social actions, archive, and agents sent to where they are useful next."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..evaluation.box import Box
from ..evaluation.evaluator import Evaluation, Evaluator
from ..gradients import polish
from ..gradients.polish import Polishing, Solves
from ..pareto import archive as archives
from ..pareto import directions
from ..pareto.archive import Archive
from ..pareto.dominance import dominates, nondominated
from . import breeding, individual, social
from . import gradient_action as refinement
from .state import NO_DIRECTION, Agents
from .trials import Attempts

if TYPE_CHECKING:
    from .macs import MACS

FEW = 4
"""An archive of so many points is too small to find mates in: the agents are mates too."""


@dataclass
class SearchState:
    """Everything a search knows between two iterations: with it, and the same evaluator and settings, it goes on as if never stopped.

    Attributes
    ----------
    agents : Agents
    archive : Archive
    closest : Archive
        The least violated point seen, one row, as long as none was feasible; no row before and after.
    ideal, nadir : arrays (m,)
        The best feasible values ever seen; the worst ones in the archive. NaN before there are any.
    directions : array (k, m)
        The pool that the agents' directions are drawn from.
    experience : array (k, d)
        The displacements of the last improvements of any agent, in units of span, oldest first.
    credit : array (o, 2)
        Of the operators that breed from the archive: how many of their offspring it kept, and how many there were, the older the less.
    iteration, evaluations, refinements : int
        Iterations done; evaluations spent by the evaluator so far; gradient solves of agents.
    rng : numpy.random.Generator
        Its `bit_generator.state` is data, and all there is to keep of it.
    polishing : Polishing, optional
        Of a polish that has begun and is not finished: where to go on.
    """

    agents: Agents
    archive: Archive
    closest: Archive
    ideal: np.ndarray
    nadir: np.ndarray
    directions: np.ndarray
    experience: np.ndarray
    credit: np.ndarray
    iteration: int
    evaluations: int
    rng: np.random.Generator
    refinements: int = 0
    polishing: Polishing | None = None


def box_of(evaluator: Evaluator) -> Box:
    """The box of an evaluator's free variables."""
    return Box(evaluator.lower, evaluator.upper, evaluator.period > 0.0)


def begin(settings: MACS, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> SearchState:
    """Sample, evaluate and archive the first population (see `MACS.begin`)."""
    if budget <= evaluator.counts.evaluations:
        raise ValueError(f"evaluations: the budget of {budget} leaves none")
    box = box_of(evaluator)
    missing = settings.points_to_sample(budget) - (0 if start is None else len(start))
    batches = [] if start is None else [np.asarray(start, dtype=float)]
    if missing > 0:
        batches.append(evaluator.first_guess(evaluator.opening(box.to_values(box.sample(missing, rng)))))
    Z = np.vstack(batches)[: budget - evaluator.counts.evaluations]
    Z[:, evaluator.free] = box.confine(Z[:, evaluator.free])
    seen = evaluator.evaluate(Z)
    m = seen.F.shape[1]
    settings.check_objectives(m)
    state = SearchState(
        agents=_population(seen, np.arange(0), len(evaluator.free), settings),
        archive=Archive(seen.Z[:0], seen.F[:0], seen.violation[:0]),
        closest=Archive(seen.Z[:0], seen.F[:0], seen.violation[:0]),
        ideal=np.full(m, np.nan),
        nadir=np.full(m, np.nan),
        directions=directions.pool(m, settings.directions or 100 * m),
        experience=np.empty((0, len(evaluator.free))),
        credit=breeding.no_credit(),
        iteration=0,
        evaluations=evaluator.counts.evaluations,
        rng=rng,
    )
    remember(state, [seen], settings, evaluator)
    seen = replace(seen, Z=np.where(np.isfinite(seen.Z), seen.Z, Z))  # a failure may bring nothing back to start from again
    state.agents = _population(seen, _choose(seen, settings.agents, evaluator.tolerance, settings.exponent), len(evaluator.free), settings)
    assign(state, settings, box, evaluator)
    return state


def advance(settings: MACS, state: SearchState, evaluator: Evaluator, budget: int) -> None:
    """One iteration (see `MACS.advance`)."""
    if state.evaluations >= budget:
        return
    box = box_of(evaluator)
    attempts = Attempts(settings, state, evaluator, box, budget)
    individual_actions(state, settings, box, attempts)
    remember(state, attempts.seen, settings, evaluator)
    attempts = Attempts(settings, state, evaluator, box, budget)
    social_actions(state, settings, box, attempts, evaluator)
    remember(state, attempts.seen, settings, evaluator)
    breed_archive(state, settings, box, Attempts(settings, state, evaluator, box, budget))
    if settings.refines and evaluator.has_gradients:
        for _ in range(refinement.allowed(state.evaluations, settings.refine_every, state.refinements)):
            remember(state, refinement.individual_action(state, box, evaluator, settings.F), settings, evaluator)
    assign(state, settings, box, evaluator)
    state.iteration += 1


def conclude(settings: MACS, state: SearchState, evaluator: Evaluator) -> None:
    """The last thing a search does (see `MACS.conclude`)."""
    if not (settings.refines and evaluator.has_gradients):
        return
    if state.polishing is None:
        state.polishing = Polishing.of(state.archive)
    before = evaluator.counts.gradient_solves - len(state.polishing)
    solves = Solves(evaluator, state.evaluations // settings.polish_every - before, state.polishing)
    state.archive = polish.polish(state.polishing.archive, solves, settings.archive, settings.exponent)
    if not solves.stopped:
        state.polishing = None


def individual_actions(state: SearchState, settings: MACS, box: Box, attempts: Attempts) -> None:
    """Inertia, pattern search, differential evolution: the agents go through them in step, and each leaves at its first success."""
    agents, rng = state.agents, state.rng
    waiting = np.arange(len(agents))
    count, d = len(agents), len(box.lower)

    def attempt(propose, velocity=True) -> None:
        nonlocal waiting
        if waiting.size:
            X = attempts.positions(waiting)
            waiting = waiting[~attempts.try_out(waiting, X, propose(waiting, X), velocity)]

    def inertia(who: np.ndarray, X: np.ndarray) -> np.ndarray:
        return individual.inertia(box, X, agents.velocity[who], agents.rho[who], settings.shorten, rng)

    attempt(inertia, settings.keep_velocity)
    order = rng.permuted(np.tile(np.arange(d), (count, 1)), axis=1)
    scanned = settings.coordinates_to_scan(d, len(state.archive), state.directions.shape[1], attempts.budget)
    for coordinate in order.T[:scanned]:
        length = rng.random((2, count)) ** settings.concentration * agents.rho / 2
        side = rng.choice([-1.0, 1.0], count)
        attempt(lambda who, X, c=coordinate, s=side * length[0]: individual.coordinate_step(box, X, c[who], s[who]))
        attempt(lambda who, X, c=coordinate, s=-side * length[1]: individual.coordinate_step(box, X, c[who], s[who]))

    def differential(who: np.ndarray, X: np.ndarray) -> np.ndarray:
        donors = attempts.positions()[individual.distinct_others(who, count, 3, rng)]
        return individual.differential(box, X, donors, settings.F, settings.CR, rng)

    attempt(differential, settings.keep_velocity)
    agents.adapt_radius(attempts.credited, settings.rho, settings.contraction, settings.max_contractions)


def social_actions(state: SearchState, settings: MACS, box: Box, attempts: Attempts, evaluator: Evaluator) -> None:
    """One proposal for each social agent: from the points near it, of the archive or of the population, or from what has helped others."""
    agents, rng = state.agents, state.rng
    rows = np.flatnonzero(agents.direction != NO_DIRECTION)
    if not rows.size:
        return
    X = attempts.positions(rows)
    everyone = attempts.positions()
    archive = box.to_unit(state.archive.Z[:, evaluator.free])
    trial = social.current_to_rand(box, X, everyone, max(len(rows), 4), settings.F, rng)
    if len(archive) > 3:
        pick = rng.random(len(rows)) < 1.0 - np.exp(-len(archive) / len({row.tobytes() for row in everyone}))
        trial = np.where(pick[:, None], social.current_to_rand(box, X, archive, max(len(rows), 4), settings.F, rng), trial)
    if len(state.experience) > 3:
        pick = rng.random(len(rows)) < settings.experience
        trial = np.where(pick[:, None], social.follow_experience(box, X, state.experience, rng), trial)
    if settings.social_moves:
        attempts.try_out(rows, X, trial, settings.keep_velocity)
    else:
        attempts.look(agents.Z[rows], X, trial)


def breed_archive(state: SearchState, settings: MACS, box: Box, attempts: Attempts) -> None:
    """Offspring of points of the archive, of as many as possible; the operators whose offspring it keeps will make more."""
    archive, evaluator, rng = state.archive, attempts.evaluator, state.rng
    count = settings.offspring(len(archive))
    if not count:
        return
    rounds = [rng.permutation(len(archive)) for _ in range(-(-count // len(archive)))]
    rows = np.concatenate(rounds)[:count]
    points = box.to_unit(archive.Z[:, evaluator.free])
    pool = points if len(points) > FEW else np.vstack([points, attempts.positions()])
    trial, operator = breeding.breed(box, points[rows], pool, state.credit, rng)
    bred, result = attempts.look(archive.Z[rows], points[rows], trial)
    if result is None:
        return
    remember(state, attempts.seen, settings, evaluator)
    kept = (result.F[:, None] == state.archive.F).all(axis=2).any(axis=1)
    state.credit = breeding.learn(state.credit, operator[bred], kept)


def remember(state: SearchState, seen: list[Evaluation], settings: MACS, evaluator: Evaluator) -> None:
    """Offer what was seen to the archive, and keep the ideal and nadir points, or else the least violated point."""
    if not seen:
        return
    Z, F = np.vstack([e.Z for e in seen]), np.vstack([e.F for e in seen])
    violation = np.concatenate([e.violation for e in seen])
    limit, tolerance = settings.archive, evaluator.tolerance
    state.archive = archives.insert(state.archive, Z, F, violation, limit=limit, tolerance=tolerance, exponent=settings.exponent)
    if len(state.archive):
        state.ideal = np.fmin(state.ideal, state.archive.F.min(axis=0))
        state.nadir = state.archive.F.max(axis=0)
        state.closest = state.closest.take(np.arange(0))
        return
    state.closest = archives.least_violated(state.closest, Z, F, violation)


def assign(state: SearchState, settings: MACS, box: Box, evaluator: Evaluator) -> None:
    """Give the social agents their directions, and send them to the points of the archive that are best for these.

    While the archive has fewer points than there are objectives nobody is sent, or, as in the authors' code, the nearest of the agents
    that own the orthogonal directions.
    """
    agents, archive, m = state.agents, state.archive, state.directions.shape[1]
    social_count = min(settings.social_agents(m), len(agents))
    if not social_count:
        return
    if settings.redraw or not (agents.direction != NO_DIRECTION).any():
        agents.direction[:] = NO_DIRECTION
        agents.direction[:social_count] = directions.draw(state.directions, social_count, state.rng)
    owners = np.flatnonzero(agents.direction != NO_DIRECTION)
    if len(archive) >= m:
        if settings.reseed == "spread" and len(archive) > len(owners) >= m:
            archive = archive.take(archives.spread(archive.F, len(owners), exponent=settings.exponent))
        weights = state.directions[agents.direction[owners]]
        costs = directions.tchebycheff(archive.F[:, None], weights, state.ideal, state.nadir)
    elif settings.reseed == "spread":
        owners = owners[agents.direction[owners] < m]
        apart = directions.normalised(archive.F[:, None] - agents.F[owners], np.zeros(m), state.nadir - state.ideal)
        costs = np.nan_to_num(np.linalg.norm(apart, axis=-1), nan=np.finfo(float).max)
    else:
        return
    points, columns = social.pair_up(costs)
    rows = owners[columns]
    agents.place(rows, archive.Z[points], archive.F[points], archive.violation[points])


def _choose(seen: Evaluation, count: int, tolerance: float, exponent: float | None) -> np.ndarray:
    """Rows, in order, of the points to start from: all, or of too many the best.

    Feasible ones come before infeasible ones, and these by violation; of the feasible ones those that no other dominates come first, well
    spread if they are too many, and then those that the fewest dominate.
    """
    if len(seen.F) <= count:
        return np.arange(len(seen.F))
    feasible = np.flatnonzero(seen.violation <= tolerance)
    front = feasible[nondominated(seen.F[feasible])]
    if len(front) > count:
        return front[archives.spread(seen.F[front], count, exponent=exponent)]
    worth = np.where(seen.violation <= tolerance, 0.0, seen.violation)
    dominators = [np.count_nonzero(dominates(seen.F[feasible], F)) for F in seen.F]
    return np.sort(np.lexsort((dominators, ~np.isin(np.arange(len(seen.F)), front), worth))[:count])


def _population(seen: Evaluation, rows: np.ndarray, d: int, settings: MACS) -> Agents:
    """Agents at rest on the evaluated points `rows`."""
    count = len(rows)
    return Agents(
        Z=seen.Z[rows],
        F=seen.F[rows],
        violation=seen.violation[rows],
        velocity=np.zeros((count, d)),
        rho=np.full(count, settings.rho),
        contractions=np.zeros(count, dtype=int),
        direction=np.full(count, NO_DIRECTION),
    )
