"""The loop of the search: individual actions, archive, social actions, archive, and agents sent to where they are useful next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from macs import archive as archives
from macs import directions, individual, social
from macs.agent import NO_DIRECTION, Agents
from macs.archive import Archive
from macs.box import Box
from macs.dominance import dominates
from macs.evaluation import Evaluation, Evaluator

if TYPE_CHECKING:
    from macs.macs import MACS


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
    iteration, evaluations : int
        Iterations done; evaluations spent by the evaluator so far.
    rng : numpy.random.Generator
        Its `bit_generator.state` is data, and all there is to keep of it.
    """

    agents: Agents
    archive: Archive
    closest: Archive
    ideal: np.ndarray
    nadir: np.ndarray
    directions: np.ndarray
    iteration: int
    evaluations: int
    rng: np.random.Generator


def box_of(evaluator: Evaluator) -> Box:
    """The box of an evaluator's free variables."""
    return Box(evaluator.lower, evaluator.upper, evaluator.period > 0.0)


def begin(settings: MACS, evaluator: Evaluator, budget: int, rng: np.random.Generator, start: np.ndarray | None = None) -> SearchState:
    """Sample, evaluate and archive the first population (see `MACS.begin`)."""
    if budget <= evaluator.counts.evaluations:
        raise ValueError(f"evaluations: the budget of {budget} leaves none")
    box = box_of(evaluator)
    missing = settings.agents - (0 if start is None else len(start))
    batches = [] if start is None else [np.asarray(start, dtype=float)]
    if missing > 0:
        batches.append(evaluator.first_guess(box.to_values(box.sample(missing, rng))))
    Z = np.vstack(batches)
    seen = evaluator.evaluate(Z[: budget - evaluator.counts.evaluations])
    m = seen.F.shape[1]
    settings.check_objectives(m)
    state = SearchState(
        agents=_population(seen, np.arange(0), len(evaluator.free), settings),
        archive=Archive(seen.Z[:0], seen.F[:0], seen.violation[:0]),
        closest=Archive(seen.Z[:0], seen.F[:0], seen.violation[:0]),
        ideal=np.full(m, np.nan),
        nadir=np.full(m, np.nan),
        directions=directions.pool(m, settings.directions or 100 * m),
        iteration=0,
        evaluations=evaluator.counts.evaluations,
        rng=rng,
    )
    remember(state, [seen], settings, evaluator)
    state.agents = _population(seen, _choose(seen, settings.agents, evaluator.tolerance), len(evaluator.free), settings)
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
    assign(state, settings, box, evaluator)
    state.iteration += 1


class Attempts:
    """The one door between proposals and the evaluator: evaluates, keeps what was seen, moves who had success, and stays in budget."""

    def __init__(self, settings: MACS, state: SearchState, evaluator: Evaluator, box: Box, budget: int) -> None:
        self.settings, self.state, self.evaluator, self.box, self.budget = settings, state, evaluator, box, budget
        self.seen: list[Evaluation] = []

    def positions(self, rows: np.ndarray) -> np.ndarray:
        """Unit coordinates (k, d) of agents."""
        return self.box.to_unit(self.state.agents.Z[np.ix_(rows, self.evaluator.free)])

    def try_out(self, rows: np.ndarray, X: np.ndarray, trial: np.ndarray) -> np.ndarray:
        """Evaluate the proposals `trial` (k, d) of the agents `rows`, at X (k, d); put those that had success there.

        Returns
        -------
        array (k,) of bool
            Who had success. A proposal that did not move, or for which no budget is left, is not evaluated and has none.
        """
        success = np.zeros(len(rows), dtype=bool)
        moved = np.flatnonzero((trial != X).any(axis=1))[: self.budget - self.state.evaluations]
        if not moved.size:
            return success
        rows, X, trial = rows[moved], X[moved], trial[moved]
        agents, free = self.state.agents, self.evaluator.free
        Z = agents.Z[rows]
        Z[:, free] = np.where(trial != X, self.box.to_values(trial), Z[:, free])
        result = self.evaluator.evaluate(Z)
        self.state.evaluations = self.evaluator.counts.evaluations
        self.seen.append(result)
        better = self.improves(rows, result)
        success[moved] = better
        achieved = self.box.difference(self.box.to_unit(result.Z[:, free]), X)
        agents.velocity[rows[better]] = achieved[better] + self.settings.momentum * agents.velocity[rows[better]]
        agents.place(rows[better], result.Z[better], result.F[better], result.violation[better])
        return success

    def improves(self, rows: np.ndarray, result: Evaluation) -> np.ndarray:
        """Which results (k,) are a success for the agents `rows`: they dominate, or are better for the agent's own direction."""
        agents, state, tolerance = self.state.agents, self.state, self.evaluator.tolerance
        feasible, was_feasible = result.violation <= tolerance, agents.violation[rows] <= tolerance
        pull = (agents.direction[rows] != NO_DIRECTION) & np.isfinite(state.ideal).all()
        weights = state.directions[agents.direction[rows]]
        now = directions.tchebycheff(result.F, weights, state.ideal, state.nadir)
        before = directions.tchebycheff(agents.F[rows], weights, state.ideal, state.nadir)
        by_objectives = dominates(result.F, agents.F[rows]) | (pull & (now < before))
        by_violation = ~was_feasible & (feasible | (result.violation < agents.violation[rows]))
        return np.where(feasible & was_feasible, by_objectives, by_violation)


def individual_actions(state: SearchState, settings: MACS, box: Box, attempts: Attempts) -> None:
    """Inertia, pattern search, differential evolution: the agents go through them in step, and each leaves at its first success."""
    agents, rng = state.agents, state.rng
    waiting = np.arange(len(agents))
    count, d = len(agents), len(box.lower)

    def attempt(propose) -> None:
        nonlocal waiting
        if waiting.size:
            X = attempts.positions(waiting)
            waiting = waiting[~attempts.try_out(waiting, X, propose(waiting, X))]

    attempt(lambda who, X: individual.inertia(box, X, agents.velocity[who], agents.rho[who], settings.shorten, rng))
    order = rng.permuted(np.tile(np.arange(d), (count, 1)), axis=1)
    for coordinate in order.T[: settings.coordinates_to_scan(d, len(state.archive), state.directions.shape[1])]:
        step = rng.uniform(-1.0, 1.0, count) * agents.rho / 2
        back = -np.sign(step) * rng.random(count) * agents.rho / 2
        attempt(lambda who, X, c=coordinate, s=step: individual.coordinate_step(box, X, c[who], s[who]))
        attempt(lambda who, X, c=coordinate, s=back: individual.coordinate_step(box, X, c[who], s[who]))

    def differential(who: np.ndarray, X: np.ndarray) -> np.ndarray:
        donors = attempts.positions(np.arange(count))[individual.distinct_others(who, count, 3, rng)]
        return individual.differential(box, X, donors, settings.F, settings.CR, rng)

    attempt(differential)
    success = np.ones(count, dtype=bool)
    success[waiting] = False
    agents.adapt_radius(success, settings.rho, settings.contraction, settings.max_contractions)


def social_actions(state: SearchState, settings: MACS, box: Box, attempts: Attempts, evaluator: Evaluator) -> None:
    """One proposal for each social agent from the points near it, of the archive or of the population."""
    agents, rng = state.agents, state.rng
    rows = np.flatnonzero(agents.direction != NO_DIRECTION)
    if not rows.size:
        return
    X = attempts.positions(rows)
    everyone = attempts.positions(np.arange(len(agents)))
    archive = box.to_unit(state.archive.Z[:, evaluator.free])
    trial = social.current_to_rand(box, X, everyone, max(len(rows), 4), settings.F, rng)
    if len(archive) > 3:
        pick = rng.random(len(rows)) < 1.0 - np.exp(-len(archive) / len(np.unique(everyone, axis=0)))
        trial = np.where(pick[:, None], social.current_to_rand(box, X, archive, max(len(rows), 4), settings.F, rng), trial)
    attempts.try_out(rows, X, trial)


def remember(state: SearchState, seen: list[Evaluation], settings: MACS, evaluator: Evaluator) -> None:
    """Offer what was seen to the archive, and keep the ideal and nadir points, or else the least violated point."""
    if not seen:
        return
    Z, F = np.vstack([e.Z for e in seen]), np.vstack([e.F for e in seen])
    violation = np.concatenate([e.violation for e in seen])
    state.archive = archives.insert(state.archive, Z, F, violation, limit=settings.archive, tolerance=evaluator.tolerance)
    if len(state.archive):
        state.ideal = np.fmin(state.ideal, state.archive.F.min(axis=0))
        state.nadir = state.archive.F.max(axis=0)
        state.closest = state.closest.take(np.arange(0))
        return
    every = Archive(np.vstack([state.closest.Z, Z]), np.vstack([state.closest.F, F]), np.concatenate([state.closest.violation, violation]))
    state.closest = every.take(np.argsort(every.violation, kind="stable")[:1])


def assign(state: SearchState, settings: MACS, box: Box, evaluator: Evaluator) -> None:
    """Give the social agents their directions, and send them to the points of the archive that are best for these."""
    agents, archive, m = state.agents, state.archive, state.directions.shape[1]
    social_count = min(settings.social_agents(m), len(agents))
    if not social_count or not len(archive):
        return
    if settings.redraw or not (agents.direction != NO_DIRECTION).any():
        agents.direction[:] = NO_DIRECTION
        agents.direction[:social_count] = directions.draw(state.directions, social_count, state.rng)
    owners = np.flatnonzero(agents.direction != NO_DIRECTION)
    if len(archive) < m:
        return
    weights = state.directions[agents.direction[owners]]
    costs = directions.tchebycheff(archive.F[:, None], weights, state.ideal, state.nadir)
    points, columns = social.pair_up(costs)
    rows = owners[columns]
    agents.place(rows, archive.Z[points], archive.F[points], archive.violation[points])


def _choose(seen: Evaluation, count: int, tolerance: float) -> np.ndarray:
    """Rows of the points to start from: all, or of too many the feasible before the infeasible, in their order."""
    worth = np.where(seen.violation <= tolerance, 0.0, seen.violation)
    return np.sort(np.argsort(worth, kind="stable")[:count])


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
