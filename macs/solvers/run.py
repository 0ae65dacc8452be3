"""Run of a solver from a seed to a front, with progress, interrupts, checkpoint and costs."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from transcription.stopping import Stopped, stopped_by

from ..evaluation.evaluator import Counts, Evaluator
from ..front import Front
from ..fronts.provenance import costs
from ..io.interrupts import Interrupts
from .checkpoint import Checkpoint, RunStatus
from .method import SearchMethod
from .progress import Progress, SearchDisplay
from .start import Call

IDLE_ITERATIONS = 100
"""Number of successive iterations without any evaluation after which a search ends."""
ENDED = ("budget", "idle", "settled", "done", "ceiling")
"""Values of `stats["stopped"]` for a run that ended without being stopped."""


@dataclass
class SearchRun:
    """Run of a solver from a seed to a front."""

    solver: SearchMethod
    evaluator: Evaluator
    # (state, stats) -> Front; the state is None if the search was ended before its first population was evaluated.
    make_front: Callable[[Any, dict[str, Any]], Front]
    call: Call  # without a number of evaluations, the search goes on in rounds until it is done, see `SearchMethod.searches_until_done`
    start: np.ndarray | None  # (k, D): Full vectors to begin with
    what: Mapping[str, Any]  # problem, solver and settings as data: a checkpoint belongs to these and to the fields above
    more: Mapping[str, Any] = field(default_factory=dict)  # further arguments of `solver.begin`, which follow from the problem

    def go(self) -> Front:
        """The front of the search, new or continued from its checkpoint, until the budget is spent or the search is stopped."""
        checkpoint = self.call.checkpoint
        self._checkpoint = None if checkpoint is None else Checkpoint(checkpoint, self.solver, self._belongs(), self.evaluator.sizes)
        seed = self.call.seed
        found = self._checkpoint.read(seed) if self._checkpoint else None
        status = found[1] if found else RunStatus(secrets.randbits(63) if seed is None else int(seed), Counts(), 0, 0.0)
        self._state: Any = found[0] if found else None
        self._seed, self._idle = status.seed, status.idle
        if self._state is not None:
            self.evaluator.resume(status.counts, self._state.archive.F.shape[1], status.memory)
        self._uncut = status.counts.clocked
        self._called_off = ""
        with (
            self._checkpoint or nullcontext(),
            SearchDisplay(self.call.progress) as self._display,
            Interrupts(self.call.time_limit, status.elapsed) as self._interrupts,
            stopped_by(self._asked_to_stop),
        ):
            stopped = status.stopped or self._search()
            if not status.stopped and stopped in ENDED:
                self._keep(stopped)
            self._show()
            if self._checkpoint:
                self._checkpoint.write()
            front = self.make_front(self._state, self._stats(stopped))
            # The certificates of optimality take time, too.
            front.stats["wall_time"] = self._interrupts.elapsed
            return front

    def _search(self) -> str:
        """Search to the end; returns the reason of the end."""
        if self._state is None:
            self.evaluator.before_batch = self._show
            try:
                rng = np.random.default_rng(self._seed)
                self._state = self.solver.begin(self.evaluator, self.call.evaluations, rng, self.start, **self.more)
            except Stopped as reason:  # while something was built that even the first evaluations need
                return str(reason)
            self._keep()
            self._write_in_time()
        # From here on there is a state to return, so a stop may come before any batch. The first population is not stopped by an exception.
        try:
            while True:  # once, or round by round
                self._search_round()
                # This work is not stopped by an exception: asked to end, it keeps its results so far.
                self.evaluator.before_batch = self._keep_and_write if self.call.evaluations is not None else self._keep_and_ask
                self.solver.conclude(self._state, self.evaluator)
                if self._cut_short():
                    reason_given, self._called_off = self._reason, ""  # what follows the search is not to be cut short by it
                    return reason_given
                if ended := self._ended():
                    return ended
                self._keep()
                self._call_back(self._show())
                self._write_in_time()
        except Stopped as reason:
            return str(reason)

    def _ended(self) -> str:
        """Why the run has ended, after its last round; empty if another follows."""
        if self.call.evaluations is not None and self.evaluator.counts.evaluations >= self.call.evaluations:
            return "budget"
        return self.evaluator.over or self.solver.ended(self._state) or ("idle" if self._idle >= IDLE_ITERATIONS else "")

    def _search_round(self) -> None:
        """Search up to the budget, or to the end of the current round."""
        self.evaluator.before_batch = self._show_and_check
        counts = self.evaluator.counts
        limit = self.solver.round_end(self._state) if self.call.evaluations is None else self.call.evaluations
        while counts.evaluations < limit and self._idle < IDLE_ITERATIONS and not (self.evaluator.over or self.solver.ended(self._state)):
            spent = counts.evaluations
            self.solver.advance(self._state, self.evaluator, limit)
            self._idle = self._idle + 1 if counts.evaluations == spent else 0
            self._keep()
            self._call_back(self._show())
            self._write_in_time()  # after the callback: it has seen every state that is in the file

    def _show(self) -> Progress:
        progress = self._progress()
        self._display.update(progress)
        return progress

    def _show_and_check(self) -> None:
        self._show()
        self._interrupts.check()

    def _call_back(self, progress: Progress) -> None:
        """Raise `Stopped` if the callback returns True."""
        answer = None if self.call.callback is None else self.call.callback(progress)
        if isinstance(answer, bool | np.bool_) and answer:
            raise Stopped("callback")

    def _keep(self, stopped: str = "") -> None:
        """Give the state to the checkpoint, unless the last iteration was cut short: a continued run repeats this iteration."""
        if self._cut_short():
            return
        counts = self.evaluator.counts
        self._uncut = counts.clocked
        if self._checkpoint:
            told = counts, self._idle, self._interrupts.elapsed, stopped, self.evaluator.memory
            self._checkpoint.keep(self._state, RunStatus(self._seed, *told))

    def _cut_short(self) -> bool:
        """Whether a time limit, Ctrl-C or the callback has cut work short since the state was last kept."""
        return bool(self._reason) and self.evaluator.counts.clocked > self._uncut

    @property
    def _reason(self) -> str:
        """Why the work has to end; empty as long as it may continue."""
        return self._interrupts.reason or self._called_off

    def _keep_and_write(self) -> None:
        self._keep()
        self._write_in_time()

    def _keep_and_ask(self) -> None:
        """As `_keep_and_write`, between the solves of a polish after which a search may continue: the callback may end it there, too."""
        self._keep_and_write()
        try:
            self._call_back(self._show())
        except Stopped as reason:
            self._called_off = str(reason)

    def _write_in_time(self) -> None:
        if self._checkpoint:
            self._checkpoint.write_in_time()

    def _belongs(self) -> dict[str, Any]:
        """All data that determine the run, except the seed: a checkpoint with other data is refused."""
        start = None if self.start is None else {"shape": self.start.shape, "hash": hashlib.sha256(self.start.tobytes()).hexdigest()}
        return {**self.what, "evaluations": self.call.evaluations, "tolerance": self.call.tolerance, "start": start}

    def _asked_to_stop(self) -> bool:
        """Whether the work is asked to end; also refreshes the display between long solves."""
        self._show()
        return bool(self._reason)

    def _stats(self, stopped: str) -> dict[str, Any]:
        counts, state, checkpoint = self.evaluator.counts, self._state, self._checkpoint
        return costs(
            counts,
            wall_time=self._interrupts.elapsed,
            seed=self._seed,
            tolerance=self.evaluator.tolerance,
            stopped=stopped,
            reproducible=stopped in ENDED and not counts.clocked and not (checkpoint and checkpoint.mixed),
            **({} if state is None else self.solver.extra_stats(state, self.evaluator)),
            **({"checkpoint": checkpoint.failure} if checkpoint and checkpoint.failure else {}),
        )

    def _progress(self) -> Progress:
        counts = self.evaluator.counts
        archived = len(self._state.archive) if self._state is not None else 0
        best, goals = (self._state.archive.F.min(axis=0), self.evaluator.goals) if archived else ((), ())
        return Progress(
            evaluations=counts.evaluations,
            budget=self.call.evaluations,
            elapsed=self._interrupts.elapsed,
            archive=archived,
            ideal={goal.name: float(goal.sign * value) for goal, value in zip(goals, best, strict=False)},
            failures=dict(counts.failures),
            make_front=lambda: self.make_front(self._state, self._stats("running")),
            F=self._state.archive.F if self._state is not None else np.empty((0, 0)),
            inner_iterations=counts.inner_iterations,
            gradient_solves=counts.gradient_solves,
            work=counts.work,
            charge=counts.charge,
        )
