"""Starts of gradient solves: from everywhere in the box and near the best that is known, until new ones stop paying.

A solve ends in the valley in which it begins. Trajectories of most controls drawn at random are much alike, so that starts are of several
kinds; near the best that is known other valleys are often better ones. That is monotonic basin hopping: Leary, "Global optimization on
funneling landscapes", J. Global Optimization 18, 2000; for trajectories Englander and Conway, "Automated solution of the low-thrust
interplanetary trajectory problem", J. Guidance 40(1), 2017. When to end: after k solves that found w different
optima, the probability that the next one finds another is w (w + 1) / (k (k - 1)), if before the first all numbers of optima, and all sizes
of their valleys, were alike: Boender and Rinnooy Kan, "Bayesian stopping rules for multistart global optimization methods", Mathematical
Programming 37, 1987.
"""

from __future__ import annotations

import numpy as np

from transcription.base import NLP
from transcription.smooth import Smooth

ALMOST_CONSTANT, SLOW = Smooth(spread=1.0, length=3.0), Smooth(spread=1.0, length=0.3)
KINDS: tuple[tuple[Smooth | None, bool], ...] = (
    (ALMOST_CONSTANT, True),
    (SLOW, True),
    (None, True),
    (ALMOST_CONSTANT, True),
    (SLOW, True),
    (Smooth(spread=0.3), False),
)
"""How controls are drawn, and whether states are propagated from them: far from the middle of their bounds and mostly on them, since
trajectories of others are much alike; None evenly, each value by itself; and smooth about the middle with the states of the guess, from
which a solve also finds what nothing that is propagated comes near to."""
SPREADS, LENGTHS, WINDOWS = (0.02, 1.0), (0.05, 2.0), (0.05, 1.0)
"""Least and largest spread, in spans of the bounds, and length, of deviations from the best that is known, see `Smooth`; and of the part of
a phase in which controls deviate: what else there is to a good solution stays as it is."""
HOPELESS = 100.0
"""If propagated states violate bounds or constraints by more scales than this, the states of the guess are the better start."""

FIRST, EACH = 3, 2
"""Starts from everywhere before only each second one is: the others are near the best that is known."""
UNSEEN = 0.005
"""Probability that another start would find another optimum below which there are enough."""
FEWEST, MANY, LAST, MOST = 8, 60, 2, 200
"""Solves after which none has converged that are enough; where optima are many: solves that are enough, if there are also this many times
as many as it took to find the best; and the most."""
SAME, ROUNDING = 1e-3, 1e-5
"""Differences that are none: as a part of those between all optima, and of their size."""


class Starts:
    """Starts of gradient solves of one NLP, later every second near the best vector that is known."""

    def __init__(self, nlp: NLP, rng: np.random.Generator, drawn: int = 0) -> None:
        self._nlp, self._rng, self.drawn = nlp, rng, drawn

    def draw(self, best: np.ndarray | None = None) -> np.ndarray:
        """The next start, a full vector; `best` (n,) is the best that is known. Returns (1 or 2, n)."""
        nlp, rng = self._nlp, self._rng
        drawn, self.drawn = self.drawn, self.drawn + 1
        near = drawn >= FIRST and (drawn - FIRST) % EACH
        lower, span = nlp.lower[nlp.free], nlp.span[nlp.free]
        candidates = (lower + rng.random(len(lower)) * span)[None]
        if near and best is not None:
            return self._propagated(self._moved(best, candidates))[:1]
        shape, propagate = KINDS[(drawn if drawn < FIRST else FIRST + (drawn - FIRST) // EACH) % len(KINDS)]
        guessed = nlp.first_guess(candidates if shape is None else shape.shaped(nlp, candidates))[0]
        return self._propagated(guessed) if propagate else guessed[None]

    def _moved(self, best: np.ndarray, candidates: np.ndarray) -> np.ndarray:
        """The vector (n,) with a random deviation of its free variables, of controls in a part of each phase."""
        nlp = self._nlp
        spread, length, width = (float(np.exp(self._rng.uniform(*np.log(limits)))) for limits in (SPREADS, LENGTHS, WINDOWS))
        middle, about = self._rng.random(), best[nlp.free]
        deviation = Smooth(spread, length).shaped(nlp, candidates, about)[0] - about
        for profile in nlp.profiles:
            deviation[profile.columns] *= np.exp(-(((profile.places - middle) / width) ** 2))
        moved = best.copy()
        moved[nlp.free] += deviation
        return moved

    def _propagated(self, z: np.ndarray) -> np.ndarray:
        """The vector with propagated states, unless these are absurd, and as it is."""
        states = self._nlp.propagate(z[None])
        usable = np.isfinite(states).all() and self._nlp.evaluate(states)[1][0] <= HOPELESS
        return np.vstack([states, z]) if usable else z[None]


class Census:
    """What solves of one problem from different starts have found: how many optima, and how often the best."""

    def __init__(self, unseen: float = UNSEEN) -> None:
        self._losses: list[float] = []
        self.starts = 0
        self._last, self._unseen = 0, unseen

    def add(self, loss: float | None) -> bool:
        """Count a solve that ended at an optimum with this loss, less is better, or at none; returns whether it is the best so far."""
        self.starts += 1
        if loss is None:
            return False
        better = not self._losses or loss < min(self._losses) - ROUNDING * abs(loss)
        self._losses.append(loss)
        self._last = self.starts if better else self._last
        return better

    @property
    def converged(self) -> int:
        """Solves that ended at an optimum."""
        return len(self._losses)

    def optima(self, same: float | None = None) -> int:
        """Optima that differ by more than `same`; by default, by more than a small part of the differences between all."""
        apart = np.diff(np.sort(self._losses)) > (self._same if same is None else same)
        return int(np.count_nonzero(apart)) + bool(self._losses)

    def times(self, loss: float | None = None, same: float | None = None) -> int:
        """How often an optimum with this loss was found, by default the best."""
        if not self._losses:
            return 0
        differences = np.abs(np.array(self._losses) - (min(self._losses) if loss is None else loss))
        return int(np.count_nonzero(differences <= (self._same if same is None else same)))

    @property
    def enough(self) -> bool:
        """Whether more starts are not expected to find anything else, or have found nothing better for long."""
        found, optima = self.converged, self.optima()
        if not found:
            return self.starts >= FEWEST
        unseen = self._unseen if optima == 1 else UNSEEN
        if found > optima and optima * (optima + 1) <= unseen * found * (found - 1):
            return True
        return self.starts >= min(max(MANY, LAST * self._last), MOST)

    @property
    def _same(self) -> float:
        losses = np.array(self._losses)
        return max(SAME * float(np.ptp(losses)), ROUNDING * float(np.abs(losses).max())) if len(losses) else 0.0
