"""The ends of a front: the lexicographic optima of its objectives, sought from each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np

from transcription.nlp.scalarized import Solved
from transcription.nlp.scaling import nlp_scales

from ..evaluation.evaluator import CONVERGED
from .multistart import LIMIT, MultistartSolver, single_task

LOOSE = 1e-2
"""Part of an objective's range that is more than the tolerance of those before it explains: if it falls by more while these keep their
least values, it was not determined by them, and a point where it is lower by more lies in another valley."""


SLACK, SOON, TIES = 1e-5, 50, 150
"""Where the others cannot be improved without any loss in an objective, how much of it may be lost, in its range between the ends; most
iterations of a solve that is to improve the others without a loss, and of one with it."""


SMALL = 600
"""Most variables of a program whose iterations take so little that `TIES` are spent without slack, too, and more where they gain."""


UNSURE = 0.2
"""Part of what a slack is worth, as its multipliers say, that is not known: a gain that exceeds it by more was not all for the slack."""


ROUNDS, MORE = 5, 1e-6
"""Most rounds in which optima are sought from each other; what counts as a gain then, in scales."""


def lexicographic_ends(solver: MultistartSolver, singles: Sequence[Solved] = ()) -> list[Solved]:
    """The lexicographic optimum of each objective: its least value, then those of the others in their order.

    Each is without a loss in those before, or, where no solve achieves that, with a loss of `SLACK`. It begins at the `singles`, the optima
    of each objective alone, in their order; those that are not given are found first. Each is also sought from the ends of the others: they
    are found in different valleys.
    """
    m = len(solver.nlp.problem.goals)
    optima, tried = list(singles), dict[tuple[int, int], np.ndarray]()
    while (i := len(optima)) < m:
        begun = solver.nearest(*single_task(i, m))
        optima.append(solver.single(i))
        tried |= {(i, k): optima[k].F for k in range(i) if begun is not None and np.array_equal(begun, optima[k].z)}
    ends: list[Solved | None] = [None] * m
    for _ in range(ROUNDS):
        _from_each_other(solver, optima, tried)
        for i in range(m):
            if optima[i] is not ends[i]:
                ends[i] = _lexicographic(solver, i, optima)
        if all(one is end for one, end in zip(optima, ends, strict=True)):
            break
        optima = [end for end in ends if end is not None]
    return optima


def _from_each_other(solver: MultistartSolver, optima: list[Solved], tried: dict[tuple[int, int], np.ndarray]) -> None:
    """Replace optima of single objectives by better ones that short solves from those of the others find, until there are none.

    `tried` has the objectives of the optimum k from which objective i was sought before, by (i, k); a solve from another one like it is
    not worth its time.
    """
    m, scales = len(optima), nlp_scales(solver.nlp)
    for _ in range(ROUNDS):
        improved = False
        for i, k in permutations(range(m), 2):
            if optima[k].status != CONVERGED or solver.is_least(optima[i], single_task(i, m)[0]):
                continue
            spans = _spans(optima)
            if (i, k) in tried and (np.abs(optima[k].F - tried[i, k]) <= LOOSE * spans).all():
                continue
            tried[i, k] = optima[k].F
            with solver.solves.at_most(TIES):
                found = solver.from_vector(optima[k].z, *single_task(i, m))
                found = _gone_on(solver, found, optima[i].F[i] - LOOSE * spans[i], *single_task(i, m))
            # What an end has lost to the others is none.
            gain = max(MORE * scales[i], 2 * SLACK * spans[i])
            if found.status == CONVERGED and (optima[i].status != CONVERGED or optima[i].F[i] - found.F[i] > gain):
                optima[i], improved = found, True
        if not improved:
            break


def _lexicographic(solver: MultistartSolver, i: int, optima: Sequence[Solved]) -> Solved:
    """The end of objective i; see `lexicographic_ends`."""
    best, m = optima[i], len(optima)
    if best.status != CONVERGED:
        return best
    ceiling, least, spans = np.full(m, np.inf), best.F[i], _spans(optima)
    for j in (k for k in range(m) if k != i):
        ceiling[i] = best.F[i]
        if not solver.is_least(best, single_task(j, m)[0]):
            best, ceiling = _tied(solver, j, best, ceiling, spans, optima[j])
        ceiling[j] = best.F[j]
    # A range may be no more than rounding, where objectives are in no conflict: no solve can tell such a loss.
    if best.F[i] - least > LIMIT * max(spans[i], nlp_scales(solver.nlp)[i]):
        # What was lost for the others is worth a little of what they gained.
        near = np.where(np.arange(m) == i, np.inf, best.F + SLACK * spans)
        with solver.solves.at_most(TIES):
            again = solver.from_vector(best.z, *single_task(i, m), near)
        best = again if again.status == CONVERGED and again.F[i] < best.F[i] else best
    return best


def _tied(
    solver: MultistartSolver, j: int, best: Solved, ceiling: np.ndarray, spans: np.ndarray, optimum: Solved
) -> tuple[Solved, np.ndarray]:
    """The least value of objective j, with that of `optimum`, among the points within a ceiling (m,), which `best` attains; and the
    ceiling, with `SLACK` where it was needed.

    Often there is but one such point; nothing is then strictly inside, and a solve would take long to find nothing.
    """
    alone, large = single_task(j, len(spans)), LOOSE * abs(best.F[j] - optimum.F[j])
    small = len(best.z) <= SMALL
    with solver.solves.at_most(TIES if small else SOON):
        # No slack: where the front is steep, a small loss in one objective changes another by its square root.
        solved = solver.solve(*alone, ceiling, best.z)
        for _ in range(ROUNDS if small else 0):
            if solved.status == CONVERGED or not best.F[j] - solved.F[j] > large:
                break
            # Much was gained before the iterations ran out.
            solved = solver.solve(*alone, ceiling, solved.z)
    if solved.status != CONVERGED:
        solved, ceiling = _tied_with_slack(solver, j, best, ceiling, SLACK * spans, large)
    if optimum.status == CONVERGED and best.F[j] - solved.F[j] > large:
        # Many points have the least values of the objectives before, and the one at hand may lie in a poor valley of this one.
        # A small gain is none: it may be no more than what a loss within the tolerance, in those before, is worth.
        with solver.solves.at_most(TIES):
            other = solver.from_vector(optimum.z, *alone, ceiling)
        if other.status == CONVERGED and solved.F[j] - other.F[j] > large:
            solved = other
    return solved, ceiling


def _tied_with_slack(
    solver: MultistartSolver, j: int, best: Solved, ceiling: np.ndarray, slack: np.ndarray, large: float
) -> tuple[Solved, np.ndarray]:
    """See `_tied`: what is found with slack (m,) first, in fewer iterations, and then without if more was gained than that is worth."""
    alone, freer = single_task(j, len(slack)), ceiling + slack
    with solver.solves.at_most(TIES):
        near = solver.near(best.z, *alone, freer)
        if near.status != CONVERGED:
            near = _gone_on(solver, solver.from_vector(best.z, *alone, freer), best.F[j] - large, *alone, freer)
        if near.status != CONVERGED:
            return best, ceiling
        gain, explained = best.F[j] - near.F[j], (1 + UNSURE) * _worth(near, j, np.where(freer < np.inf, slack, 0.0))
        if gain <= max(slack[j], explained):
            return best, ceiling
        # However a solve without slack ends, it counts if it keeps the objectives before, and lacks only what the slack is worth.
        enough = np.where(np.arange(len(slack)) == j, near.F[j] + max(large, explained), ceiling + LIMIT / SLACK * slack)
        exact = solver.near(near.z, *alone, ceiling)
        if not _within(solver, exact, enough):
            exact = _gone_on(solver, exact, best.F[j] - large, *alone, ceiling)
    if exact.status == CONVERGED or _within(solver, exact, enough):
        return (replace(exact, status=CONVERGED), ceiling) if exact.F[j] < best.F[j] else (best, ceiling)
    return (near, freer) if gain > large else (best, ceiling)


def _within(solver: MultistartSolver, solved: Solved, enough: np.ndarray) -> bool:
    """Whether a result is feasible, and its objectives are at most as large as `enough` (m,)."""
    return bool(solved.violation <= solver.tolerance and (enough >= solved.F).all())


def _gone_on(
    solver: MultistartSolver, solved: Solved, enough: float, reference: np.ndarray, weights: np.ndarray, ceiling: np.ndarray | None = None
) -> Solved:
    """A result for one objective; where it did not converge but is below a value that is `enough`, that of a solve near it."""
    promising = solved.status != CONVERGED and solved.F[weights > 0][0] < enough
    return solver.near(solved.z, reference, weights, ceiling) if promising else solved


def _worth(solved: Solved, j: int, slack: np.ndarray) -> float:
    """What slacks (m,) of the other objectives are worth in objective j, at its optimum within them: their multipliers are its slopes.

    Where the front is vertical, the gain is as the square root of the slack, twice what the slope says.
    """
    assert solved.multipliers is not None
    return float(2 * solved.multipliers[: len(slack)] @ slack / solved.multipliers[j])


def _spans(optima: Sequence[Solved]) -> np.ndarray:
    """Ranges (m,) of the objectives between the optima that were found, at least one."""
    return np.ptp([one.F for one in optima if one.status == CONVERGED], axis=0)
