"""The loop of the search: individual actions, archive, social actions, archive, and agents sent to where they are useful next."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..evaluation.box import box_of
from ..evaluation.evaluator import Evaluation, Evaluator
from ..gradients import polish
from ..gradients.polish import Polishing, Solves
from ..pareto import archive as archives
from ..pareto import directions
from ..pareto.archive import Archive
from ..pareto.dominance import dominates, nondominated
from . import breeding
from . import gradient_action as refinement
from .breeding import breed_archive
from .individual import individual_actions
from .social import assign, social_actions
from .state import SearchState, agents_at, remember
from .trials import Attempts

if TYPE_CHECKING:
    from .macs import MACS


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
        agents=agents_at(seen, np.arange(0), len(evaluator.free), settings),
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
    state.agents = agents_at(seen, _choose(seen, settings.agents, evaluator.tolerance, settings.exponent), len(evaluator.free), settings)
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
