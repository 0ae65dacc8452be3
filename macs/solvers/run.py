"""One run of a solver: from a seed to a front, watched, and with what it cost."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from problems.compiled import Objective
from transcription.stopping import stopped_by

from ..evaluation.evaluator import Counts, Evaluator
from ..front import Front
from ..io.interrupts import Monitor, Stopped
from .checkpoint import Checkpoint, Kept
from .progress import Progress

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
    what : mapping
        What is searched and how, as data: with what is above, a checkpoint belongs to it.
    """

    solver: Solver
    evaluator: Evaluator
    goals: Callable[[], Sequence[Objective]]
    make_front: Callable[[Any, dict[str, Any]], Front]
    budget: int
    seed: int | None
    start: np.ndarray | None
    what: Mapping[str, Any]

    def go(
        self,
        time_limit: float | None,
        progress: bool,
        callback: Callable[[Progress], Any] | None,
        checkpoint: str | PathLike[str] | None = None,
    ) -> Front:
        """Search, from where a checkpoint was left if there is one, until the budget is spent, or until something stops it.

        Returns
        -------
        Front
            Its `stats["stopped"]` says what ended the run: "budget", "interrupted", "time limit", "callback" or "idle".
        """
        self._checkpoint = None if checkpoint is None else Checkpoint(checkpoint, self.solver, self._belongs())
        found = self._checkpoint.read(self.seed) if self._checkpoint else None
        kept = found[1] if found else Kept(secrets.randbits(63) if self.seed is None else int(self.seed), Counts(), 0, 0.0)
        self._state: Any = found[0] if found else None
        self.seed, self._idle = kept.seed, kept.idle
        if self._state is not None:
            self.evaluator.resume(kept.counts, self._state.archive.F.shape[1])
        self._uncut = kept.counts.clocked
        with (
            self._checkpoint or nullcontext(),
            _display(progress) as display,
            Monitor(time_limit, callback, display, kept.elapsed) as monitor,
            stopped_by(lambda: self._asked_to_stop(monitor)),
        ):
            stopped = kept.stopped or self._search(monitor)
            if not kept.stopped and stopped in ENDED:
                self._keep(monitor, stopped)
            monitor.show(self._standing(monitor))
            if self._checkpoint:
                self._checkpoint.write()
            front = self.make_front(self._state, self._stats(monitor, stopped))
            # To say how near to optimal the points are takes its time, too.
            front.stats["wall_time"] = monitor.elapsed
            return front

    def _search(self, monitor: Monitor) -> str:
        """To the end of the search; returns what ended it."""
        if self._state is None:
            self.evaluator.before_batch = lambda: monitor.show(self._standing(monitor))
            self._state = self.solver.begin(self.evaluator, self.budget, np.random.default_rng(self.seed), self.start)
            self._keep(monitor)
            self._write_in_time()
        # From here on there is something to return, so from here on a batch need not even begin. Before, it ends with what it has.
        self.evaluator.before_batch = lambda: monitor.before_batch(self._standing(monitor))
        counts = self.evaluator.counts
        try:
            # A search that evaluates nothing any more has nothing left to try.
            while counts.evaluations < self.budget and self._idle < IDLE_ITERATIONS:
                spent = counts.evaluations
                self.solver.advance(self._state, self.evaluator, self.budget)
                self._idle = self._idle + 1 if counts.evaluations == spent else 0
                self._keep(monitor)
                monitor.after_iteration(self._standing(monitor))
                self._write_in_time()  # what is in the file, the callback has been told
            # Asked to stop, this ends with what it has; so far as it got, it is kept.
            self.evaluator.before_batch = lambda: self._within_the_end(monitor)
            self.solver.conclude(self._state, self.evaluator)
        except Stopped as reason:
            return str(reason)
        if self._cut_short(monitor):
            return monitor.reason
        return "idle" if counts.evaluations < self.budget else "budget"

    def _keep(self, monitor: Monitor, stopped: str = "") -> None:
        """Tell the checkpoint how the run stands, unless something of the last iteration was cut short: that has to be done again."""
        if self._cut_short(monitor):
            return
        counts = self.evaluator.counts
        self._uncut = counts.clocked
        if self._checkpoint:
            assert self.seed is not None
            self._checkpoint.keep(self._state, Kept(self.seed, counts, self._idle, monitor.elapsed, stopped))

    def _cut_short(self, monitor: Monitor) -> bool:
        """Whether something was since the run was last kept, or would have been."""
        return bool(monitor.reason) and self.evaluator.counts.clocked > self._uncut

    def _within_the_end(self, monitor: Monitor) -> None:
        self._keep(monitor)
        self._write_in_time()

    def _write_in_time(self) -> None:
        if self._checkpoint:
            self._checkpoint.write_in_time()

    def _belongs(self) -> dict[str, Any]:
        """What a checkpoint has to be of, but for the seed."""
        start = None if self.start is None else {"shape": self.start.shape, "hash": hashlib.sha256(self.start.tobytes()).hexdigest()}
        return {**self.what, "evaluations": self.budget, "tolerance": self.evaluator.tolerance, "start": start}

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
            "reproducible": stopped in ENDED and not counts.clocked and not (self._checkpoint and self._checkpoint.mixed),
            **({} if self._state is None else self.solver.tells(self._state, self.evaluator.tolerance)),
            **({"checkpoint": self._checkpoint.failure} if self._checkpoint and self._checkpoint.failure else {}),
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
