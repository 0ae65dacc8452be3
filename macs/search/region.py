"""Region of interest: the part of a front where a preference is nearly as good as at its best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from problems.compiled import Objective

from ..preferences.preference import Preference
from ..preferences.ranges import Ranges
from ..preferences.stage import Stage

PART = 0.05
"""The value of a preference in the region of interest differs from the best value on a front by at most this part of the spread of values
there."""


@dataclass(frozen=True)
class Region:
    """Region of interest of a preference on a front: where its value is at most `PART` of the spread of its values worse than the best.

    The value is that of the first stage, see `Ranking.values`, and the spread is over the points that meet the preference's hard limits:
    those that exceed one lie outside. If all do, the value is by how much.
    """

    stage: Stage
    limited: bool  # whether a point of the front meets the hard limits
    best: float  # best, spread: The best value on the front, and how much worse the worst is
    spread: float

    @classmethod
    def of(cls, preference: Preference, goals: Sequence[Objective], objectives: np.ndarray) -> Self:
        """The region on a front with objectives (n, m), all finite, in the user's units and senses; they are normalised by their ranges."""
        stage = preference.stages(goals, Ranges.over(goals, objectives))[0]
        values = stage.numbers(objectives)
        met = np.isfinite(values)
        values = values[met] if met.any() else stage.excess(objectives)
        return cls(stage, bool(met.any()), float(values.min()), float(np.ptp(values)))

    def away(self, objectives: np.ndarray) -> np.ndarray:
        """By how much the values (n,) at objectives (n, m) are worse than the best, in units of the spread: 0 and less is as good."""
        values = self.stage.numbers(objectives) if self.limited else self.stage.excess(objectives)
        return (values - self.best) / (self.spread or 1.0)

    def contains(self, objectives: np.ndarray) -> np.ndarray:
        """Mask (n,) of the objectives (n, m) that lie in the region."""
        return self.away(objectives) <= PART
