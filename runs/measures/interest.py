"""How well a front covers the region of interest of a preference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import moocore
import numpy as np

from macs.preferences import Preference
from macs.search.guide import Region
from problems.compiled import Objective

from .indicators import Points, extent, minimised, truth


@dataclass(frozen=True, eq=False)
class Interest:
    """Region of interest on a dense front, by which other fronts are measured."""

    region: Region  # by the values of the preference on the dense front, which is normalised by its own ranges
    goals: tuple[Objective, ...]
    points: np.ndarray  # (k, m): Those of the dense front in the region, minimised
    part: float  # which part they are of the dense front's points

    @classmethod
    def of(cls, preference: Preference, goals: Sequence[Objective], dense: Points) -> Self:
        """The region on a dense front: a Front, or an array (n, m) in the user's units and senses."""
        R = truth(dense, goals)
        signs = np.array([goal.sign for goal in goals])
        region = Region.of(preference, goals, R * signs)
        inside = region.contains(R * signs)
        ideal, unit = extent(R[inside])
        if not _volume((R[inside] - ideal) / unit) > 0.0:
            raise ValueError(f"the region of interest has only {inside.sum()} points of the dense front: it has to be denser there")
        return cls(region, tuple(goals), R[inside], float(inside.mean()))

    def missing(self, front: Points) -> float:
        """The part of the region's hypervolume that a front does not dominate: 0 all of it is, 1 none.

        The hypervolume is that which the region's points dominate, up to their nadir, in units of their ranges.
        """
        ideal, unit = extent(self.points)
        region = (self.points - ideal) / unit
        F = np.maximum((minimised(front, self.goals) - ideal) / unit, 0.0)
        covered = _volume(F)
        return (_volume(np.vstack([region, F])) - covered) / _volume(region)

    def inside(self, front: Points) -> int:
        """Number of a front's points whose value is as good as that of points in the region."""
        return int(self.region.contains(self._objectives(front)).sum())

    def worse(self, front: Points) -> float:
        """By how much the best value of a front is worse than that of the dense front, in units of the spread of its values; infinite for
        an empty front."""
        return float(self.region.away(self._objectives(front)).min(initial=np.inf))

    def _objectives(self, front: Points) -> np.ndarray:
        return minimised(front, self.goals) * [goal.sign for goal in self.goals]


def _volume(F: np.ndarray) -> float:
    """Volume that points (n, m) dominate up to 1 in each objective."""
    return float(moocore.hypervolume(np.ascontiguousarray(F), ref=np.ones(F.shape[1]))) if len(F) else 0.0
