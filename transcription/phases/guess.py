"""Values along a phase from what a user guessed."""

from __future__ import annotations

from typing import Any

import numpy as np

from problems.compiled import CompiledPhase


def line(start: np.ndarray, end: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Straight lines from `start` (k,) to `end` (k,) at `share` (...) of the way; shape (k, ...)."""
    shape = (-1,) + (1,) * share.ndim
    return start.reshape(shape) + (end - start).reshape(shape) * share


def along(given: Any, t0: np.ndarray, tf: np.ndarray, share: np.ndarray) -> np.ndarray:
    """A user's guess where it is needed. given (times, values), t0, tf (k,), share (...) -> (k, ...)."""
    first, second = given if np.ndim(given) else (given, given)
    if np.ndim(first):
        return np.interp(line(t0, tf, share), first, second)
    return line(np.full(len(t0), float(first)), np.full(len(t0), float(second)), share)


def state_along(phase: CompiledPhase, i: int, start: np.ndarray, t0: np.ndarray, tf: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Values (k, ...) of state i, as guessed, or on lines from `start` (k,) to the middle of its final range; `share` as in `along`."""
    state, final = phase.states[i], phase.final[i]
    if state.name in phase.guesses:
        return along(phase.guesses[state.name], t0, tf, share)
    return line(start, start if final == (state.lower, state.upper) else np.full(len(start), 0.5 * sum(final)), share)
