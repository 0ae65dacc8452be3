"""Programs for IPOPT that end at the next iteration when the work is asked to end early."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from ..stopping import check_stopping, stopping

EVERY = 0.25
"""Least seconds between two questions whether to end: most solves take less, and need not ask."""


class Watched:
    """A program for IPOPT: called as what `casadi.nlpsol` returns. Its return status is "User_Requested_Stop" where it was asked to end.

    IPOPT looks at its own limits of time between iterations, too: this ends a solve as soon as these could. A factorisation, and the search
    along one step, cannot be ended.

    Parameters
    ----------
    name, parts, options
        Arguments of `casadi.nlpsol`.

    Raises
    ------
    Stopped
        If the work was asked to end before the program was built.
    """

    def __init__(self, name: str, parts: Any, options: Mapping[str, Any]) -> None:
        check_stopping()
        self._watch = _Watch()
        self._solver = ca.nlpsol(name, "ipopt", parts, {**options, "iteration_callback": self._watch})

    def __call__(self, **inputs: Any) -> dict[str, Any]:
        """The answer, by the names of CasADi."""
        self._watch.begin()
        answer = self._solver(**inputs)
        if self._watch.raised is not None:
            raise self._watch.raised
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
        self._asked = time.monotonic()
        self.raised: BaseException | None = None

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
        end = False
        try:
            now = time.monotonic()
            if now - self._asked >= EVERY:
                self._asked, end = now, stopping()
        except BaseException as error:  # Ctrl-C; CasADi would swallow it
            self.raised, end = error, True
        np.frombuffer(outputs[0])[0] = float(end)
        return 0
