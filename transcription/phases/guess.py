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
    """A user's guess where it is needed.

    Parameters
    ----------
    given : float, pair of floats, or pair of arrays (times, values)
        A constant, a straight line from t0 to tf, or samples to interpolate in time, as `Phase.guess` takes them.
    t0, tf : arrays (k,)
    share : array (...)
        Where, between 0 at t0 and 1 at tf.

    Returns
    -------
    array (k, ...)
    """
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
