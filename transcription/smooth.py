"""First candidates with smooth controls: random profiles about what the user guessed.

Where a control has many nodes, values drawn one by one are noise that averages to the middle of its bounds: the trajectories of all
candidates are much alike, and none is useful. A guessed profile and smooth deviations from it give a search something to choose from.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from problems.checks import check_positive, short_repr
from problems.problem import Problem

from .base import NLP, Transcription


@dataclass(frozen=True)
class Smooth:
    """Candidates drawn about the problem's guess (`phase.guess(...)`, `problem.guess(...)`), their controls as smooth profiles.

    It is what `solve(start="smooth")` of every solver begins with, as many as it needs, from the run's own generator. `draw` gives an array
    of them, to inspect or to give as `start`.

    A control is its guess, or where there is none the middle of its bounds, plus a random function of time: values of unit variance, whose
    correlation decreases with the time between them, d, in units of the phase's length, as exp(-d^2 / (2 length^2)), times `spread`, times
    the span of its bounds. Other variables with a guess vary independently about it, evenly, as much. Those without are drawn evenly from
    their bounds. What leaves its bounds is put back: periodic variables come in at the other end.

    Parameters
    ----------
    spread : float, default 0.2
        Standard deviation, in spans of the bounds, in (0, 1].
    length : float, default 0.2
        Over which time values are alike, as a fraction of the phase, in (0, 10]. With less than there is between two nodes, these are
        independent.
    guess : bool, default True
        Whether a search also begins with the guess itself, as the first candidate.

    Raises
    ------
    ValueError
        Where a setting is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> from problems import load
    >>> from transcription import SingleShooting, Smooth
    >>> Smooth(spread=0.1).draw(load("goddard"), SingleShooting(40), 3, np.random.default_rng(1)).shape[0]
    3
    """

    spread: float = 0.2
    length: float = 0.2
    guess: bool = True

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name, value, most in (("spread", self.spread, 1), ("length", self.length, 10)):
            check_positive(f"Smooth: {name}", value)
            if value > most:
                raise ValueError(f"Smooth: {name} must be in (0, {most}], not {value!r}")
        if not isinstance(self.guess, bool):
            raise ValueError(f"Smooth: guess must be True or False, not {self.guess!r}")

    def draw(self, problem: Problem, transcription: Transcription, count: int, rng: np.random.Generator) -> np.ndarray:
        """`count` candidates (count, d), values of the free variables: an array that `start=` takes."""
        nlp = transcription.transcribe(problem)
        lower, span = nlp.lower[nlp.free], nlp.span[nlp.free]
        return self.shaped(nlp, lower + span * rng.random((count, len(nlp.free))))

    def shaped(self, nlp: NLP, candidates: np.ndarray, about: np.ndarray | None = None) -> np.ndarray:
        """Smooth candidates (k, d) from ones drawn evenly from the bounds; `about` (d,) stands in for the guess."""
        lower, upper, span = nlp.lower[nlp.free], nlp.upper[nlp.free], nlp.span[nlp.free]
        guess = nlp.guess if about is None else about
        noise = np.sqrt(12.0) * ((candidates - lower) / span - 0.5)
        X = np.where(np.isfinite(guess), guess + self.spread * span * noise, candidates)
        for profile in nlp.profiles:
            columns = profile.columns
            middle = np.where(np.isfinite(guess[columns]), guess[columns], 0.5 * (lower + upper)[columns])
            X[:, columns] = middle + self.spread * span[columns] * smoothed(noise[:, columns], profile.places, self.length)
        wrapped = lower + np.mod(X - lower, span)
        return np.where(nlp.period[nlp.free] > 0.0, wrapped, np.clip(X, lower, upper))


def smoothed(noise: np.ndarray, places: np.ndarray, length: float) -> np.ndarray:
    """Smooth values (c, k) of unit variance at `places` (k,), from independent ones (c, k).

    At many places they are interpolated between 50 a length, exactly to 1e-7: the matrix would grow with the square of their number.
    """
    count = ceil(50 / length)
    if len(places) <= max(1000, count):
        return noise @ smoothing(places, length).T
    from scipy.interpolate import CubicSpline  # slow to import

    grid = np.linspace(0.0, 1.0, count + 1)
    spline: np.ndarray = CubicSpline(grid, noise @ smoothing(places, length, grid).T, axis=1)(places)
    return spline


def smoothing(places: np.ndarray, length: float, at: np.ndarray | None = None) -> np.ndarray:
    """A matrix (a, k) that makes smooth values of unit variance `at` (a,) of independent ones at `places` (k,)."""
    weights = np.exp(-((((places if at is None else at)[:, None] - places) / length) ** 2))
    return weights / np.linalg.norm(weights, axis=1, keepdims=True)
