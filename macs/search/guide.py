"""Guide of a search by a preference: how densely points are wanted along the front, and in which region most of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from problems.compiled import Objective

from ..evaluation.evaluator import Evaluator
from ..pareto.dominance import CURVE, extremes, ranges
from ..pareto.spread import Guide
from ..preferences.catalogue import METHODS, to_dict
from ..preferences.preference import Preference
from ..preferences.ranges import Ranges
from ..preferences.stage import Stage

REGION_PART = 0.05
"""The value of a preference in the region of interest differs from the best value on a front by at most this part of the spread of values
there."""


@dataclass(frozen=True)
class Region:
    """Region of interest of a preference on a front: its value is worse than the best by at most `REGION_PART` of the spread.

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
        """Losses (n,) at objectives (n, m) against the best value, in units of the spread; at most 0 if as good."""
        values = self.stage.numbers(objectives) if self.limited else self.stage.excess(objectives)
        return (values - self.best) / (self.spread or 1.0)

    def contains(self, objectives: np.ndarray) -> np.ndarray:
        """Mask (n,) of the objectives (n, m) that lie in the region."""
        return self.away(objectives) <= REGION_PART


OUTSIDE_DENSITY = 0.005
"""Factor of distances far from the region of interest, relative to that inside: neighbours are farther apart by its inverse."""


@dataclass(frozen=True)
class PreferenceGuide:
    """The guide that a preference is; see `pareto.archive.Guide`.

    Points are wanted in the region of interest, see `Region`, and sparsely elsewhere. The ranges of the objectives are those of the front
    at hand; their ends, and the best point, are kept. As long as they do not contain what the preference names, such as a target, points
    are wanted evenly.
    """

    preference: Preference
    goals: tuple[Objective, ...]

    def factors(self, front: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Factors (k,) at points (k, m) on a front (n, m), both minimised; even where the preference says nothing yet."""
        try:
            region = self._region(front)
        except ValueError:  # names and senses were checked before the search: what is left are values beyond the ranges at hand
            return np.ones(len(points))
        m = front.shape[1]
        # A point covers what is around it, much of which lies outside where it is on the border. So, on a surface, points are wanted away
        # from the border by the distance of neighbours, with ten points thought of inside the region.
        border = 1.0 if m <= CURVE else 1.0 - 10.0 ** (-1.0 / (m - 1))
        beyond = np.maximum(region.away(points * self._signs) / REGION_PART - border, 0.0)
        # To 1 / e where the value is worse by a tenth of the width of the region.
        return np.maximum(np.exp(-beyond / 0.1), OUTSIDE_DENSITY)

    def anchors(self, front: np.ndarray) -> np.ndarray:
        """The row of the best value, then those of worst values of objectives, without which the ranges would be clearly less."""
        short = front.max(axis=0) - front[extremes(front)].max(axis=0)
        # The worst value of an objective stays if it is worse than at all ends of the front by a tenth of the range.
        worst = front.argmax(axis=0)[short > 0.1 * ranges(front)]
        try:
            away = self._region(front).away(front * self._signs)
        except ValueError:  # as above
            return worst
        return np.append(away.argmin(), worst)

    def objection(self, front: np.ndarray) -> str:
        """Why the preference says nothing on a front (n, m), minimised; empty if it does."""
        try:
            self._region(front)
        except ValueError as error:
            return str(error)
        return ""

    def _region(self, front: np.ndarray) -> Region:
        return Region.of(self.preference, self.goals, front * self._signs)

    @property
    def _signs(self) -> np.ndarray:
        return np.array([goal.sign for goal in self.goals])


def guide_of(preference: Preference | None, evaluator: Evaluator) -> Guide | None:
    """The guide of a search; None without a preference."""
    return None if preference is None else PreferenceGuide(preference, evaluator.goals)


def written(preference: Preference) -> Any:
    """A preference as plain data, for files; one of a user's own class as its text."""
    return to_dict(preference) if type(preference) in METHODS.values() else repr(preference)


def check_preference(preference: Preference, goals: Sequence[Objective]) -> None:
    """Raise ValueError, of one line, for a preference that is not one of these objectives: another problem's, or a wrong sense."""
    try:
        preference.check(goals)
    except ValueError as error:
        raise ValueError(f"MACS: prefer: {error}") from error
