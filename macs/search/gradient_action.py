"""Gradient action: gradient refinement of single agents during the search. See `gradients.polish` for the end of the search.

Each solve leads from a point to the front by the scalarisation of Pascoletti and Serafini (1984): minimise alpha subject to
F - reference <= alpha weights. If the reference is the objectives of the point itself, no objective may get worse, wherever the solve
begins: such a solve is called guarded. Its result is used only if it is feasible and indeed no worse.
"""

from __future__ import annotations

import numpy as np

from ..evaluation.evaluator import Evaluation, Evaluator
from ..pareto.dominance import CURVE, feasible_and_no_worse, nearest, ranges
from ..pareto.spread import Guide
from . import social
from .state import NO_DIRECTION, SearchState

FLAT = 0.05
"""Least component of a direction in the weights: a smaller one would leave its objective without control."""


def allowed(evaluations: int, every: int, solves: int) -> int:
    """Number of gradient solves that a search may make now: one for every `every` evaluations, less the `solves` already made."""
    return max(evaluations // every - solves, 0)


def individual_action(state: SearchState, evaluator: Evaluator, F: float, guide: Guide | None = None) -> list[Evaluation]:
    """Make one gradient solve for the agent whose turn it is, along its own direction.

    For a feasible agent the solve is guarded. Its start changes from turn to turn: the position of the agent, that of its nearest neighbour
    in the archive, or the proposal of a social action. The last two allow the agent to leave its basin of attraction. For an infeasible
    agent the solve starts at its position and makes it feasible as well.

    In the first turn, an agent whose direction is a single objective minimises that objective alone, without regard to the others: the
    archive needs the ends of the front to be spread along it. After the first turn the ends are known, and with more than two objectives
    such an agent gets a random direction. With more than two objectives, all other solves start their line at the ideal point instead of
    the agent's objectives: a surface is too large to be covered from the positions of the agents alone.
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
        box = evaluator.box
        pool = box.to_unit(state.archive.Z[:, evaluator.free])
        X = box.to_unit(start[evaluator.free])[None]
        start[evaluator.free] = box.to_values(social.current_to_rand(box, X, pool, max(len(pool), 4), F, state.rng)[0])
    direction = np.ones(m) if agents.direction[i] == NO_DIRECTION else state.directions[agents.direction[i]]
    if m > CURVE and turn and np.count_nonzero(direction) == 1:
        direction = state.directions[_any_inner(state, guide)]
    weights = np.where(direction > 0, ranges_of(state) / np.maximum(direction, FLAT), 0.0)
    alone = turn == 0 and m > 1 and np.count_nonzero(direction) == 1
    reference = state.ideal if m > CURVE and len(state.archive) >= m and not (weights == 0.0).any() else agents.F[i]
    reference = np.where(direction > 0, reference, np.inf) if alone else reference
    found = evaluator.descend(start[None], reference[None], weights[None])
    if not len(found.F):  # asked to end early
        return []
    limit = agents.F[i] if feasible else np.full(m, np.inf)
    if feasible_and_no_worse(found, limit[None], agents.violation[i : i + 1], ranges_of(state))[0]:
        agents.place(np.array([i]), found.Z, found.F, found.violation)
    return [found]


def _any_inner(state: SearchState, guide: Guide | None) -> int:
    """The row of a random direction that is not a single objective."""
    m, count = state.directions.shape[1], len(state.directions)
    wanted = social.shares(state, guide)
    if wanted is None:
        return int(state.rng.integers(m, count))
    return int(state.rng.choice(np.arange(m, count), p=wanted[m:] / wanted[m:].sum()))


def ranges_of(state: SearchState) -> np.ndarray:
    """The `ranges` (m,) of the archive, or of the agents while the archive is empty."""
    return ranges(state.archive.F if len(state.archive) else state.agents.F[np.isfinite(state.agents.F).all(axis=1)])
