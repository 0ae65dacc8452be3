"""The ends of a front, which are the lexicographic optima of its objectives, and the points between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from transcription.nlp.program import nlp_scales
from transcription.nlp.scalarized import Solved
from transcription.stopping import stopping

from ..evaluation.evaluator import CONVERGED
from ..io.interrupts import spending
from ..io.workers import TOGETHER
from ..pareto.directions import divisions_below, simplex_lattice
from ..pareto.dominance import ranges
from .multistart import MULTISTART, MultistartSolver
from .scalarised import END, WEAK, WORK, Scalarised, strongly_optimal, without_loss

METHODS = ("pascoletti-serafini", "epsilon")
"""Scalarisations of a sweep."""


@dataclass(frozen=True)
class EndsLimits:
    """Limits of the search for lexicographic optima; fractions of an objective refer to its range between the ends."""

    # Part that is more than the tolerance of the objectives before it explains: if an objective falls by more while these keep their least
    # values, it was not determined by them, and a point where it is lower by more lies in another valley. Also what the others count in the
    # sum whose least value is an end of a surface: they determine it where it is as loose.
    loose: float = 1e-2
    rounds: int = 5  # most rounds in which optima are sought from each other
    gain: float = 1e-6  # what counts as a gain then, in scales
    from_rivals: int = 3  # most times that results along a front are sought again from a better start that another one gave
    moved: float = 0.05  # where the ends of a front move by more than this part, the points between them move along


ENDS = EndsLimits()


@spending("ends")
def lexicographic_ends(solver: MultistartSolver, single: Callable[[int], Solved] | None = None, most: float = np.inf) -> list[Solved]:
    """The lexicographic optimum of each objective, from its optimum alone, `single(i)`, and from the ends of the others, which may lie in
    other valleys: its least value, then those of the others in their order, without a loss in those before, or one of
    `EndLimits.slack`; after the optima of single objectives, with at `most` so much work."""
    m = len(solver.nlp.problem.goals)
    optima, tried = list[Solved](), dict[tuple[int, int], np.ndarray]()
    for i in range(m):
        begun = solver.nearest(Scalarised.single(i, m))
        optima.append((single or solver.single)(i))
        tried |= {(i, k): optima[k].F for k in range(i) if begun is not None and np.array_equal(begun, optima[k].z)}
    ends: list[Solved | None] = [None] * m
    with solver.solves.within(most):
        for _ in range(ENDS.rounds):
            _from_each_other(solver, optima, tried)
            for i in range(m):
                if optima[i] is not ends[i]:
                    with solver.solves.within(most / (m + 1)):  # and as much for what is sought from each other
                        ends[i] = end = _lexicographic(solver, i, optima)
                    solver.solves.counts.keep(end is not optima[i] and end.message != WEAK)
            if all(one is end for one, end in zip(optima, ends, strict=True)):
                break
            optima = [end for end in ends if end is not None]
    return optima


@spending("ends")
def proper_ends(solver: MultistartSolver, single: Callable[[int], Solved] | None = None, most: float = np.inf) -> list[Solved]:
    """For each objective the least sum of all, in their ranges, in which the others count little: a properly efficient point (Geoffrion
    1968) near the lexicographic optimum, by two solves instead of one for each other objective. From its optimum alone, `single(i)`, and
    then from the best of the others' results; after the optima of single objectives, with at `most` so much work."""
    m = len(solver.nlp.problem.goals)
    optima = [(single or solver.single)(i) for i in range(m)]
    if any(one.status != CONVERGED for one in optima):
        return optima
    F = np.array([one.F for one in optima])
    weights = np.where(np.eye(m, dtype=bool), 1.0, ENDS.loose) / ranges(F)
    tasks = [Scalarised(F.min(axis=0), row, summed=True) for row in weights]
    with solver.solves.within(most):
        ends = solver.from_vectors([(one.z, task) for one, task in zip(optima, tasks, strict=True)])
        others = [min((ends[k] for k in range(m) if k != i), key=tasks[i].rank) for i in range(m)]
        again = solver.from_vectors([(one.z, task) for one, task in zip(others, tasks, strict=True)])
    return [min(*both, key=task.rank) for *both, task in zip(ends, again, optima, tasks, strict=True)]


def _from_each_other(solver: MultistartSolver, optima: list[Solved], tried: dict[tuple[int, int], np.ndarray]) -> None:
    """Replace optima of single objectives by better ones, from short solves that start at the other optima, until none improves; not from
    optima k like those from which objective i was sought before, whose objectives `tried` has by (i, k)."""
    m, scales = len(optima), nlp_scales(solver.nlp)
    for _ in range(ENDS.rounds):
        known = [k for k in range(m) if optima[k].status == CONVERGED]
        spans, pairs = _spans(optima) if known else np.zeros(m), list[tuple[int, int]]()
        for i, k in permutations(range(m), 2):
            if k not in known or solver.convex[i] or solver.is_least(optima[i], Scalarised.single(i, m)):
                continue
            if (i, k) not in tried or (np.abs(optima[k].F - tried[i, k]) > ENDS.loose * spans).any():
                tried[i, k] = optima[k].F
                pairs.append((i, k))
        tasks, before = [Scalarised.single(i, m) for i, _ in pairs], list(optima)
        with solver.solves.at_most(END.ties):
            found = solver.from_vectors([(optima[k].z, task) for (_, k), task in zip(pairs, tasks, strict=True)])
            for (i, _), task, one in zip(pairs, tasks, found, strict=True):
                solved = _gone_on(solver, one, optima[i].F[i] - ENDS.loose * spans[i], task)
                # What an end has lost to the others is none.
                gain = max(ENDS.gain * scales[i], 2 * END.slack * spans[i])
                if solved.status == CONVERGED and (optima[i].status != CONVERGED or optima[i].F[i] - solved.F[i] > gain):
                    optima[i] = solved
                    solver.solves.counts.keep(1)
        if all(one is other for one, other in zip(before, optima, strict=True)):
            break


def _lexicographic(solver: MultistartSolver, i: int, optima: Sequence[Solved]) -> Solved:
    """The end of objective i; see `lexicographic_ends`."""
    best, m = optima[i], len(optima)
    if best.status != CONVERGED:
        return best
    before, least, spans, weak = [i], best.F[i], _spans(optima), False
    for j in (k for k in range(m) if k != i):
        if not solver.is_least(best, Scalarised.single(j, m)):
            limits, slack = np.where(np.isin(np.arange(m), before), best.F, np.inf), END.slack * spans
            with solver.solves.at_most(END.ties):
                (best,) = solver.over_values([best], [Scalarised.single(j, m, limits + slack)])
                task = Scalarised.single(j, m, limits)
                best = without_loss(solver.from_vector, solver.nlp, solver.solves.tolerance, best, task, slack, [optima[j].z])
            weak |= best.message == WEAK
        before.append(j)
    # A range may be no more than rounding, where objectives are in no conflict: no solve can tell such a loss.
    held = solver.is_least(best, Scalarised.single(i, m))
    if not held and best.F[i] - least > MULTISTART.excess * max(spans[i], nlp_scales(solver.nlp)[i]):
        # What was lost for the others is worth a little of what they gained.
        near = np.where(np.arange(m) == i, np.inf, best.F + END.slack * spans)
        with solver.solves.at_most(END.ties):
            again = solver.from_vector(best.z, Scalarised.single(i, m, near))
        best = again if again.status == CONVERGED and again.F[i] < best.F[i] else best
    return replace(best, message=WEAK) if weak and best.message != WEAK else best


def _gone_on(solver: MultistartSolver, solved: Solved, enough: float, task: Scalarised) -> Solved:
    """A result for one objective; if it did not converge but is below the value `enough`, the result of a further solve near it."""
    promising = solved.status != CONVERGED and solved.F[task.moving][0] < enough
    return solver.from_vector(solved.z, task, near=True) if promising else solved


def _spans(optima: Sequence[Solved]) -> np.ndarray:
    """Ranges (m,) of the objectives between the optima that were found, at least one."""
    return np.ptp([one.F for one in optima if one.status == CONVERGED], axis=0)


@spending("points between")
def solve_tasks(solver: MultistartSolver, tasks: Sequence[Scalarised]) -> list[Solved]:
    """The results of all tasks: also from results of others that are better for them and, with several starts, from that of
    the next one; with as many starts as pay, from others in turn, as long as these find better ones and take no more work than the
    tasks."""
    before, found = solver.solves.counts.work, list[Solved]()
    for k in (0, 1):
        # Every second one first: the others then begin beside one that is known.
        found += solver.solve_all(tasks[k::2])
    half = (len(tasks) + 1) // 2
    found = [found[k // 2 + half * (k % 2)] for k in range(len(tasks))]
    if (solver.starts or 1) > 1:
        for k in range(len(tasks) - 2, -1, -1):
            found[k] = solver.better(found[k], solver.from_vector(found[k + 1].z, tasks[k]), tasks[k])
    _from_rivals(solver, tasks, found)
    if solver.starts is None:
        limit = solver.solves.counts.work + max(WORK.little, solver.solves.counts.work - before)
        while _from_other_starts(solver, tasks, found, limit):
            _from_rivals(solver, tasks, found)
    good = [solved for solved in found if solved.status == CONVERGED]
    return strong(solver, found, np.ptp([solved.F for solved in good], axis=0)) if good else found


def strong(solver: MultistartSolver, found: Sequence[Solved], ranges: np.ndarray) -> list[Solved]:
    """The results, those that may be optimal in the weak sense only improved; see `strongly_optimal`. ranges (m,)."""
    found = list(found)
    with solver.solves.at_most(END.ties):
        for k, solved in enumerate(found):
            if solved.status == CONVERGED and solved.multipliers is not None:
                weights, tolerance = solved.multipliers.of_objectives, solver.solves.tolerance
                found[k] = strongly_optimal(solver.from_vector, solver.nlp, tolerance, solved, weights, ranges)
                solver.solves.counts.keep(found[k] is not solved)
    return found


def _from_rivals(solver: MultistartSolver, tasks: Sequence[Scalarised], found: list[Solved]) -> None:
    """Replace results by better ones, from solves that start at the results of other tasks, as long as any improves."""
    for _ in range(ENDS.from_rivals):
        before, found[:] = found[:], solver.from_rivals(found, tasks)
        if all(one is other for one, other in zip(before, found, strict=True)):
            break


@spending("starts")
def _from_other_starts(solver: MultistartSolver, tasks: Sequence[Scalarised], found: list[Solved], limit: float) -> bool:
    """Solve each task from another start; returns whether any result was replaced."""
    replaced = False
    for k in range(0, len(tasks), TOGETHER):
        if solver.drawn_enough or solver.convex.all() or solver.solves.counts.work >= limit or stopping():
            return False
        with solver.solves.at_most(MULTISTART.iterations):
            others = solver.from_draws(tasks[k : k + TOGETHER], found[k : k + TOGETHER])
        for i, other in enumerate(others, k):
            alpha, known = tasks[i].optimum(other), tasks[i].optimum(found[i])
            if alpha is not None and (known is None or alpha < known - END.clearly):
                found[i], replaced = other, True
                solver.solves.counts.keep(1)
    return replaced


def check_points(points: int, m: int) -> None:
    """Raise ValueError if the number of points is too small for a front of m objectives."""
    if m == 1:
        raise ValueError("a problem with one objective has no front to sweep; use optimize")
    if points < m:
        raise ValueError(f"points must be at least {m}, one for each objective, not {points}")


def tasks_between(ends: np.ndarray, ranges: np.ndarray, points: int, method: str) -> list[Scalarised]:
    """Scalarised problems whose solutions, with the ends, make a front of at most `points` points. ends (m, m), ranges (m,)."""
    if np.count_nonzero(ranges) < 2:
        return []
    return (_from_simplex if method == "pascoletti-serafini" else _at_limits)(ends, ranges, points)


def _from_simplex(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Scalarised]:
    """Tasks from a lattice on the simplex between the ends, with the ranges as weights."""
    m = len(ends)
    inner = [share for share in simplex_lattice(m, divisions_below(m, points)) if share.max() < 1.0]
    # An objective with zero range has weight 0: its reference is a hard limit.
    level = np.where(ranges > 0, ends, ends.max(axis=0))
    return [Scalarised(share @ level, ranges) for share in inner]


def _at_limits(ends: np.ndarray, ranges: np.ndarray, points: int) -> list[Scalarised]:
    """Tasks for the first objective that is in conflict with another, at all combinations of evenly spread limits on the others."""
    m = len(ends)
    first, *others = np.flatnonzero(ranges > 0)
    levels = int((points - m) ** (1.0 / len(others)) + 1e-9)
    # With two objectives the loosest limit gives an end; with more, combinations with it are new points.
    shares = np.arange(1, levels + 1) / (levels + (len(others) == 1))
    tasks = []
    for combination in product(shares, repeat=len(others)):
        reference = ends.max(axis=0)
        reference[first] = 0.0
        reference[others] -= (1.0 - np.array(combination)) * ranges[others]
        tasks.append(Scalarised(reference, np.where(np.arange(m) == first, ranges, 0.0)))
    return tasks


def moved_along(F: np.ndarray, old: np.ndarray, new: np.ndarray, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """References and weights with which points F (k, m) of a front are re-solved: the points themselves or, if the ends have moved from
    `old` to `new` (m, m), the same places between these."""
    if not len(old) or len(units) == 1 or np.abs((new - old) / units).max() <= ENDS.moved:
        return F, units
    before, after = np.ptp(old, axis=0), np.ptp(new, axis=0)
    if not ((before > 0) & (after > 0)).all():
        return F, units
    return new.min(axis=0) + (F - old.min(axis=0)) * (after / before), after
