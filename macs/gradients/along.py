"""Results of several scalarised problems along a front, each of which may help the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from transcription.nlp.scalarized import Solved
from transcription.stopping import stopping

from ..evaluation.evaluator import CONVERGED
from .multistart import LITTLE, SHORT, MultistartSolver

ROUNDS = 3
"""Largest number of times that results are sought again from a better start that another one gave."""
Task = tuple[np.ndarray, np.ndarray]
"""Reference and weights (m,); see `scalarize`."""


def along(solver: MultistartSolver, tasks: Sequence[Task]) -> list[Solved]:
    """The results of all tasks, in their order.

    A result that is better for another task than that task's own result becomes a start for it. With several starts, each task is also
    solved from the result of the next one. If the solver is to make as many starts as pay, all tasks get others in turn, as long as these
    find better results, and take no more work than the tasks themselves, or little.
    """
    before, found = solver.counts.work, [solver.solve(*task) for task in tasks]
    if (solver.starts or 1) > 1:
        for k in range(len(tasks) - 2, -1, -1):
            found[k] = solver.better([found[k], solver.from_vector(found[k + 1].z, *tasks[k])], *tasks[k])
    _from_rivals(solver, tasks, found)
    if solver.starts is None:
        limit = solver.counts.work + max(LITTLE, solver.counts.work - before)
        while _elsewhere(solver, tasks, found, limit):
            _from_rivals(solver, tasks, found)
    return found


def _from_rivals(solver: MultistartSolver, tasks: Sequence[Task], found: list[Solved]) -> None:
    """Replace results by better ones, from what was found for other tasks, as long as there are any."""
    for _ in range(ROUNDS):
        rivals = [solver.rival(solved, *task) for solved, task in zip(found, tasks, strict=True)]
        for k, rival in enumerate(rivals):
            if rival is not None:
                found[k] = solver.from_rival(rival, found[k], *tasks[k])
        if all(rival is None for rival in rivals):
            break


def _elsewhere(solver: MultistartSolver, tasks: Sequence[Task], found: list[Solved], limit: float) -> bool:
    """Solve each task from another start; returns whether that replaced a result."""
    replaced = False
    for k, task in enumerate(tasks):
        if solver.drawn_enough or solver.counts.work >= limit or stopping():
            return False
        with solver.solves.at_most(SHORT):
            other = solver.from_drawn(*task, best=found[k] if found[k].status == CONVERGED else None)
        if solver.clearly_better(other, found[k], *task):
            found[k], replaced = other, True
    return replaced
