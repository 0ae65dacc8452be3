"""One run of a solver: from a seed to a front, watched, and with what it cost."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Objective
from transcription.stopping import stopped_by

from .evaluation import Evaluator
from .front import Front
from .monitor import Monitor, Progress, Stopped

if TYPE_CHECKING:
    from .solver import Solver

IDLE_ITERATIONS = 100
"""A search that evaluated nothing in so many iterations on end has nothing left to try."""
ENDED = ("budget", "idle")
"""What ends a run that nobody stopped."""


@dataclass
class Run:
    """What to search, and how to tell of it.

    Attributes
    ----------
    solver : Solver
    evaluator : Evaluator
    goals : callable
        The objectives; asked for once something has been evaluated, since a black box tells their number only then.
    make_front : callable
        (state, stats) -> Front.
    budget : int
        Evaluations, never exceeded.
    seed : int or None
        None draws one.
    start : array (k, D) or None
        Full vectors to begin with.
    """

    solver: Solver
    evaluator: Evaluator
    goals: Callable[[], Sequence[Objective]]
    make_front: Callable[[Any, dict[str, Any]], Front]
    budget: int
    seed: int | None
    start: np.ndarray | None

    def go(self, time_limit: float | None, progress: bool, callback: Callable[[Progress], Any] | None) -> Front:
        """Search until the budget is spent, or until something stops it.

        Returns
        -------
        Front
            Its `stats["stopped"]` says what ended the run: "budget", "interrupted", "time limit", "callback" or "idle".
        """
        self.seed = secrets.randbits(63) if self.seed is None else int(self.seed)
        self._state: Any = None
        with (
            _display(progress) as display,
            Monitor(time_limit, callback, display) as monitor,
            stopped_by(lambda: self._asked_to_stop(monitor)),
        ):
            self.evaluator.before_batch = lambda: monitor.show(self._standing(monitor))
            self._state = self.solver.begin(self.evaluator, self.budget, np.random.default_rng(self.seed), self.start)
            # From here on there is something to return, so from here on a batch need not even begin. Before, it ends with what it has.
            self.evaluator.before_batch = lambda: monitor.before_batch(self._standing(monitor))
            stopped = self._advance(monitor)
            monitor.show(self._standing(monitor))
            return self.make_front(self._state, self._stats(monitor, stopped))

    def _advance(self, monitor: Monitor) -> str:
        counts, idle = self.evaluator.counts, 0
        try:
            while counts.evaluations < self.budget:
                spent = counts.evaluations
                self.solver.advance(self._state, self.evaluator, self.budget)
                monitor.after_iteration(self._standing(monitor))
                idle = idle + 1 if counts.evaluations == spent else 0
                if idle == IDLE_ITERATIONS:
                    break
            self.solver.conclude(self._state, self.evaluator)
        except Stopped as reason:
            return str(reason)
        if counts.evaluations < self.budget:
            return "idle"
        # The last batch may have been cut short.
        return monitor.reason if monitor.reason and counts.clocked else "budget"

    def _asked_to_stop(self, monitor: Monitor) -> bool:
        """Asked between long solves: also the time to show that it is still at work."""
        monitor.show(self._standing(monitor))
        return bool(monitor.reason)

    def _stats(self, monitor: Monitor, stopped: str) -> dict[str, Any]:
        counts = self.evaluator.counts
        return {
            "evaluations": counts.evaluations,
            "inner_iterations": counts.inner_iterations,
            "gradient_solves": counts.gradient_solves,
            "fallbacks": counts.fallbacks,
            "failures": dict(counts.failures),
            "wall_time": monitor.elapsed,
            "seed": self.seed,
            "tolerance": self.evaluator.tolerance,
            "stopped": stopped,
            "reproducible": stopped in ENDED and not counts.clocked,
        }

    def _standing(self, monitor: Monitor) -> Progress:
        counts = self.evaluator.counts
        archived = len(self._state.archive) if self._state is not None else 0
        best = self._state.archive.F.min(axis=0) if archived else ()
        return Progress(
            evaluations=counts.evaluations,
            budget=self.budget,
            elapsed=monitor.elapsed,
            archive=archived,
            ideal={goal.name: float(goal.sign * value) for goal, value in zip(self.goals() if archived else (), best, strict=False)},
            failures=dict(counts.failures),
            make_front=lambda: self.make_front(self._state, self._stats(monitor, "running")),
            F=self._state.archive.F if self._state is not None else np.empty((0, 0)),
            inner_iterations=counts.inner_iterations,
            gradient_solves=counts.gradient_solves,
        )


def _display(progress: bool) -> AbstractContextManager[Callable[[Progress], None] | None]:
    if not progress:
        return nullcontext()
    from .progress import Display

    return Display()
