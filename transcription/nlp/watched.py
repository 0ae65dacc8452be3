"""Programs for IPOPT that end at the next iteration when the work is asked to end early."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Mapping
from types import FrameType
from typing import Any

import casadi as ca
import numpy as np

from ..stopping import check_stopping, stopping

EVERY = 0.25
"""Least seconds between two questions whether to end: most solves take less, and need not ask."""


UNASKED = {"calc_lam_p": False, "no_nlp_grad": True, "inputs_check": False}
"""Sensitivities to the parameters are not used. They would take longer to derive than some solves take, and where rates are no numbers they
fail, which CasADi prints; so does its check of what goes in, for each program that has more equations than variables."""


class Watched:
    """A program for IPOPT: called as what `casadi.nlpsol` returns. Its return status is "User_Requested_Stop" where it was asked to end.

    IPOPT looks at its own limits of time between iterations, too: this ends a solve as soon as these could. A factorisation, and the search
    along one step, cannot be ended.
    """

    def __init__(self, name: str, parts: Any, options: Mapping[str, Any]) -> None:
        check_stopping()
        self._watch = _Watch()
        self._solver = ca.nlpsol(name, "ipopt", parts, {**UNASKED, **options, "iteration_callback": self._watch})

    def __call__(self, **inputs: Any) -> dict[str, Any]:
        """The answer, by the names of CasADi. Raises KeyboardInterrupt after Ctrl-C, unless that is handled otherwise."""
        watch, usual = self._watch, signal.default_int_handler
        watch.begin()
        # CasADi would swallow the exception of the usual handler.
        heard = signal.getsignal(signal.SIGINT) is usual and threading.current_thread() is threading.main_thread()
        if heard:
            signal.signal(signal.SIGINT, watch.interrupt)
        try:
            answer = self._solver(**inputs)
        finally:
            if heard:
                signal.signal(signal.SIGINT, usual)
        if watch.raised is not None:
            raise watch.raised
        return answer

    def stats(self) -> dict[str, Any]:
        """Statistics of the last solve, by the names of CasADi."""
        return self._solver.stats()


class _Watch(ca.Callback):
    """What IPOPT calls after each iteration. It takes no data (its inputs are empty) and, through buffers, no time."""

    def __init__(self) -> None:
        ca.Callback.__init__(self)
        self.begin()
        self.construct("watch", {})

    def begin(self) -> None:
        """Begin a solve."""
        self._asked, self._end = time.monotonic(), False
        self.raised: BaseException | None = None

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Handler of Ctrl-C."""
        self.raised = KeyboardInterrupt()

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> Any:
        return ca.Sparsity(0, 0)

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, inputs: Any, outputs: Any) -> int:
        """Ends the solve (1) or not (0)."""
        try:
            now = time.monotonic()
            if now - self._asked >= EVERY:
                self._asked, self._end = now, stopping()
        except BaseException as error:  # CasADi would swallow it
            self.raised = error
        np.frombuffer(outputs[0])[0] = float(self._end or self.raised is not None)
        return 0
