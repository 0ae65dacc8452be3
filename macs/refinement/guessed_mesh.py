"""How fine a mesh has to be for what a user guessed: on a coarser one the guess is lost, and with it what it says."""

from __future__ import annotations

from typing import Any

import numpy as np

from problems.compiled import CompiledProblem

COUNTS, ORDER = (8, 16, 32), 3
"""Numbers of elements that are considered, and the degree of what is described on each."""
LOST = 0.1
"""Part of its range by which a guess may be missed."""
NODES = np.cos(np.linspace(np.pi, 0.0, ORDER + 1))
"""Where, on [-1, 1], polynomials are to agree with a guess."""


def guessed_elements(problem: CompiledProblem) -> int:
    """The least number of equal elements on which cubic polynomials describe each guessed profile of a problem; the largest of `COUNTS` if
    none of these is enough, the least if no profile is guessed."""
    profiles = [profile for phase in problem.phases for profile in phase.guesses.values() if _sampled(profile)]
    return next((count for count in COUNTS if all(_missed(times, values, count) <= LOST for times, values in profiles)), COUNTS[-1])


def _sampled(guess: Any) -> bool:
    """Whether a guess is (times, values), of more than two samples."""
    return bool(np.ndim(guess)) and np.ndim(guess[0]) == 1 and len(guess[0]) > 2


def _missed(times: np.ndarray, values: np.ndarray, count: int) -> float:
    """The largest difference of piecewise cubic polynomials from samples, in ranges of these."""
    size = float(np.ptp(values))
    if size == 0.0:
        return 0.0
    places = np.linspace(times[0], times[-1], count + 1)
    middles, half = 0.5 * (places[:-1] + places[1:]), 0.5 * (places[1] - places[0])
    coefficients = np.interp(middles[:, None] + half * NODES, times, values) @ np.linalg.inv(np.vander(NODES)).T
    own = np.clip(np.searchsorted(places, times, side="right") - 1, 0, count - 1)
    powers = np.vander((np.asarray(times) - middles[own]) / half, len(NODES))
    return float(np.abs((coefficients[own] * powers).sum(axis=1) - values).max()) / size
