"""Which inner solver the next proposals go to: that which has brought most for its work, and to the others a stated little.

What a way of making candidates feasible is worth differs from problem to problem, and during a search: where the ends of trajectories are
free, propagation finds a front in no time; where they are fixed, nothing that is only propagated is feasible. Gradient solves compete, too.
Where these bring most, proposals are only propagated: they are what the solves begin from. Work is counted, not timed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..evaluation.evaluator import Evaluation, Evaluator
from ..pareto.directions import tchebycheff
from .state import SearchState

FORGET = 0.1
"""Part of what was brought, and of the work for it, that is forgotten with each batch."""
CHEAP = 0.1
"""Least share of all evaluations of a way that takes less work than that which most proposals go to."""
DEAR, LEAST = 0.15, 0.03
"""Share of all work, with the gradient solves to come, of the ways that take more; least share of each."""
MAKING = 300
"""Iterations of IPOPT that take about as long as to build the functions of a way: it is first tried when its share is worth as much."""
BROUGHT, FOR, WORK, EVALUATIONS, FEASIBLE = range(5)
"""Columns of the effort of each way, the last of which are the gradient solves: what it brought, for which work, older ones count less;
all work; all evaluations, or solves; those of the evaluations that were feasible."""


def no_effort(ways: int, gradients: int) -> np.ndarray:
    """Initial effort (ways + 1, 5). Gradient solves, one of which takes the work `gradients` or so, are believed to bring a whole front
    each, until they were tried. Without gradients there is nothing to choose: what is only propagated is never made feasible."""
    effort = np.zeros((ways + 1, 5))
    effort[ways, [BROUGHT, FOR]] = 1.0, gradients
    return effort


def ways_of(effort: np.ndarray, count: int, every: int | None, making: float = 0.0) -> np.ndarray:
    """The way (count,) that each of the next proposals goes to: that which brings most for its work, or the first where gradient solves
    do, one of which is made for `every` evaluations in the end; or ways that have not had their shares."""
    ways, rate = effort[:-1], effort[:, BROUGHT] / np.maximum(effort[:, FOR], 1.0)
    main = int(np.argmax(rate)) % len(ways)
    evaluations = ways[:, EVALUATIONS].sum()
    for way in range(main):
        if ways[way, EVALUATIONS] <= CHEAP * evaluations:
            return np.full(count, way)
    solving, solves = effort[-1, [WORK, EVALUATIONS]]
    ahead = 0.0 if every is None else max(0.0, evaluations / every - solves) * (solving / solves if solves else effort[-1, FOR])
    chosen, free = np.full(count, main), count
    dear = np.arange(main + 1, len(ways))
    shares = np.full(len(dear), LEAST)
    if len(dear):
        shares[np.argmax(rate[dear])] = DEAR - LEAST * (len(dear) - 1)
    for way, share in zip(dear.tolist(), shares.tolist(), strict=True):
        left = share * (effort[:, WORK].sum() + ahead) - ways[way, WORK]
        each = ways[way, WORK] / max(ways[way, EVALUATIONS], 1.0)
        some = min(free, max(int(left / each), 0) if each else int(left >= making))
        chosen[free - some : free] = way
        free -= some
    return chosen


def credited(effort: np.ndarray, way: int, brought: float, work: int, count: int, feasible: int = 0) -> np.ndarray:
    """The effort after `count` evaluations, or solves, by one way. What gradient solves brought is not forgotten: when proposals improve a
    front by little any more, it is still to be polished by these."""
    effort = effort.copy()
    effort[:-1, [BROUGHT, FOR]] *= 1.0 - FORGET
    effort[way] += brought, work, work, count, feasible
    return effort


class Gains:
    """What points bring to a front: by how much they improve the best values of its directions, on average, each of which counts one from
    the ideal point to the nadir. As long as there is no front, none counts."""

    def __init__(self, state: SearchState, tolerance: float) -> None:
        self._directions, self._tolerance = state.directions, tolerance
        self._ideal, self._nadir = state.ideal, state.nadir
        self._front = state.archive.F
        self._best: np.ndarray | None = None  # the best values are found when they are needed

    def of(self, found: Evaluation) -> float:
        """What these points bring, which then count as known."""
        F = found.F[found.violation <= self._tolerance]
        if not len(self._front) or not len(F):
            return 0.0
        if self._best is None:
            self._best = self._values(self._front)
        values = np.minimum(self._values(F), self._best)
        brought = float(np.mean(np.minimum(self._best - values, 1.0)))
        self._best = values
        return brought

    def _values(self, F: np.ndarray) -> np.ndarray:
        return tchebycheff(F[:, None], self._directions, self._ideal, self._nadir).min(axis=0)


def evaluated(state: SearchState, evaluator: Evaluator, Z: np.ndarray, gains: Gains, every: int | None) -> Evaluation:
    """The evaluation of full vectors (k, D), each by the way that is worth most now; the state's effort knows what that brought. As long as
    nothing is feasible, and without gradients, all are projected."""
    if len(state.effort) == 1 or not len(state.archive):
        return evaluator.evaluate(Z)
    chosen, parts = ways_of(state.effort, len(Z), every, MAKING * Z.shape[1]), []
    for way in np.unique(chosen).tolist():
        before = evaluator.counts.work
        parts.append(evaluator.evaluate(Z[chosen == way], way))
        done = evaluator.counts.work - before
        feasible = int(np.count_nonzero(parts[-1].violation <= evaluator.tolerance))
        state.effort = credited(state.effort, way, gains.of(parts[-1]), done, len(parts[-1].F), feasible)
    order = np.argsort(np.argsort(chosen, kind="stable"), kind="stable")
    whole = parts[0]
    for part in parts[1:]:
        whole = whole.joined(part)
    return whole if len(parts) == 1 else whole.take(order)


def spent(effort: np.ndarray, ways: Sequence[str]) -> dict[str, dict[str, int]]:
    """Evaluations, those of them that were feasible, and work, by the name of their way; the first population is not among them."""
    columns = {"evaluations": EVALUATIONS, "feasible": FEASIBLE, "work": WORK}
    return {name: {what: int(row[k]) for what, k in columns.items()} for name, row in zip(ways, effort, strict=False)}
