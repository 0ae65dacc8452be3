"""Values along a phase from what a user guessed."""

from __future__ import annotations

from typing import Any

import numpy as np


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
