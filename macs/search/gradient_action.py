"""Refinement by gradients: an individual action of agents during the search; see `polish` for what comes at its end.

Every solve goes from a point down to the front (Pascoletti and Serafini 1984): F - reference <= alpha weights, least alpha. With the
point's own objectives as reference it is guarded: no objective gets worse, whichever basin the solve began in. What it finds is taken only
if it is feasible and keeps that promise.
"""

from __future__ import annotations

import numpy as np

from ..evaluation.box import Box
from ..evaluation.evaluator import Evaluation, Evaluator
from ..pareto.ranges import CURVE, feasible_and_no_worse, nearest, ranges
from . import social
from .state import NO_DIRECTION, SearchState

FLAT = 0.05
"""Least component of a direction that still counts: a smaller one would let its objective go anywhere."""


def allowed(evaluations: int, every: int, solves: int) -> int:
    """How many gradient solves a search may make now: one for every so many evaluations, less those that it has made."""
    return max(evaluations // every - solves, 0)


def individual_action(state: SearchState, box: Box, evaluator: Evaluator, F: float) -> list[Evaluation]:
    """One solve for the agent whose turn it is, towards its own direction.

    Of an agent that is feasible it is guarded, and begins, in turn, where the agent is, where its nearest neighbour in the archive is, and
    where a social action would have led it: the last two so that it may leave the basin that it is in. One that is infeasible is made
    feasible on the way, from where it is. In the first turn, those whose direction is one objective go for its best there is, whatever
    becomes of the others: where the ends of the front are, the archive has to know to be spread along it. With more than two objectives,
    all but these look from the ideal point, along their direction: a surface has too many places to wait until each has been visited by
    somebody. After the first turn, there is nothing to be gained at the ends, and another direction is drawn.

    Returns
    -------
    list of Evaluation
        What there is to tell the archive.
    """
    agents, m = state.agents, state.directions.shape[1]
    turn, i = divmod(state.refinements, len(agents))
    state.refinements += 1
    feasible = agents.violation[i] <= evaluator.tolerance
    if not np.isfinite(agents.F[i]).all():
        return []
    start = agents.Z[i].copy()
    others = np.flatnonzero((agents.F[i] != state.archive.F).any(axis=1) & feasible)
    if turn % 3 == 1 and others.size:
        start = state.archive.Z[others[nearest(agents.F[i], state.archive.F[others], ranges_of(state))[0]]]
    elif turn % 3 == 2 and feasible:
        pool = box.to_unit(state.archive.Z[:, evaluator.free])
        X = box.to_unit(start[evaluator.free])[None]
        start[evaluator.free] = box.to_values(social.current_to_rand(box, X, pool, max(len(pool), 4), F, state.rng)[0])
    direction = np.ones(m) if agents.direction[i] == NO_DIRECTION else state.directions[agents.direction[i]]
    if m > CURVE and turn and np.count_nonzero(direction) == 1:
        direction = state.directions[state.rng.integers(m, len(state.directions))]
    weights = np.where(direction > 0, ranges_of(state) / np.maximum(direction, FLAT), 0.0)
    alone = turn == 0 and m > 1 and np.count_nonzero(direction) == 1
    reference = state.ideal if m > CURVE and len(state.archive) >= m and not (weights == 0.0).any() else agents.F[i]
    reference = np.where(direction > 0, reference, np.inf) if alone else reference
    found = evaluator.descend(start[None], reference[None], weights[None])
    if not len(found.F):  # the search is to end
        return []
    promised = agents.F[i] if feasible else np.full(m, np.inf)
    if feasible_and_no_worse(found, promised[None], agents.violation[i : i + 1], ranges_of(state))[0]:
        agents.place(np.array([i]), found.Z, found.F, found.violation)
    return [found]


def ranges_of(state: SearchState) -> np.ndarray:
    """The `ranges` of the archive, or of the agents while it is empty."""
    return ranges(state.archive.F if len(state.archive) else state.agents.F[np.isfinite(state.agents.F).all(axis=1)])
