"""Gradient action: gradient refinement of single agents during the search. See `gradients.polish` for the end of the search.

Each solve leads from a point to the front by the scalarisation of Pascoletti and Serafini (1984): minimise alpha subject to
F - reference <= alpha weights. If the reference is the objectives of the point itself, no objective may get worse, wherever the solve
begins: such a solve is called guarded. Its result is used only if it is feasible and indeed no worse.
"""

from __future__ import annotations

import numpy as np

from ..evaluation.bilevel import Bilevel
from ..evaluation.evaluator import CONVERGED, Evaluation, Evaluator
from ..gradients.along import along
from ..gradients.multistart import GradientSolves, MultistartSolver, guessed_start
from ..gradients.targets import METHODS, targets
from ..pareto.archive import Guide
from ..pareto.ranges import CURVE, feasible_and_no_worse, nearest, ranges
from . import social
from .state import NO_DIRECTION, SearchState

FLAT = 0.05
"""Least component of a direction in the weights: a smaller one would leave its objective without control."""


OPENING = 0.5
"""Most work of the starts with which a search begins, as a part of what its budget would take if all were made feasible as the first
candidates were."""


def allowed(evaluations: int, every: int, solves: int) -> int:
    """Number of gradient solves that a search may make now: one for every `every` evaluations, less the `solves` already made."""
    return max(evaluations // every - solves, 0)


def first_optima(
    seen: Evaluation, given: np.ndarray | None, evaluator: Bilevel, rng: np.random.Generator, points: int, budget: int
) -> Evaluation:
    """The ends of the front, and a compromise of them, for a search that begins with nothing feasible; where the search chooses the way of
    its proposals, so many points along the front, each from as many starts as pay. Fewer if asked to end early, or where none was found.

    They are sought from the best of the vectors (k, D) that were given, with which `seen` begins; where none were, from the problem's
    guess, as gradient tools seek them; without one, from the candidate that misses least.
    """
    known = np.isfinite(seen.F).all(axis=1) & np.isfinite(seen.Z).all(axis=1)
    violation = np.where(known, seen.violation, np.inf)
    start = guessed_start(evaluator.nlp)
    if given is not None and known[: len(given)].any():
        start = given[[np.argmin(violation[: len(given)])]]
    elif start is None and known.any():
        start = seen.Z[[np.argmin(violation)]]
    if start is None:
        return seen.take(np.flatnonzero(known))
    solves = GradientSolves(evaluator.tolerance)
    solves.before, solves.counts = evaluator.before_batch, evaluator.counts
    solver = MultistartSolver(evaluator.nlp, start, None if evaluator.ways else 1, rng, solves)
    spent, done = evaluator.counts.work, max(evaluator.counts.evaluations, 1)
    solver.most_work = spent + OPENING * spent * budget / done
    found = solver.ends()
    if 1 < len(found) == sum(one.status == CONVERGED for one in found):
        F = np.array([one.F for one in found])
        if evaluator.ways:
            found += along(solver, targets(F, ranges(F), max(points, len(F) + 1), METHODS[0]))
        else:
            found.append(solver.solve(F.min(axis=0), ranges(F)))
    good = [one for one in found if one.violation <= evaluator.tolerance]
    return Evaluation(
        Z=np.array([one.z for one in good]).reshape(-1, seen.Z.shape[1]),
        F=np.array([one.F for one in good]).reshape(-1, seen.F.shape[1]),
        violation=np.array([one.violation for one in good]),
        status=np.array([one.status for one in good], dtype="<U10"),
    )


def individual_action(state: SearchState, evaluator: Evaluator, F: float, guide: Guide | None = None) -> list[Evaluation]:
    """Make one gradient solve for the agent whose turn it is, along its own direction.

    For a feasible agent the solve is guarded. Its start changes from turn to turn: the position of the agent, that of its nearest neighbour
    in the archive, or the proposal of a social action. The last two allow the agent to leave its basin of attraction. For an infeasible
    agent the solve starts at its position and makes it feasible as well.

    In the first turn, an agent whose direction is a single objective minimises that objective alone, without regard to the others: the
    archive needs the ends of the front to be spread along it. After the first turn the ends are known, and with more than two objectives
    such an agent gets a random direction. With more than two objectives, all other solves start their line at the ideal point instead of
    the agent's objectives: a surface is too large to be covered from the positions of the agents alone.

    Returns
    -------
    list of Evaluation
        Points to be offered to the archive: one, or none.
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
