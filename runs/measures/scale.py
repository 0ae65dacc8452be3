"""The normalisation of indicators in words, for the captions of tables: the ranges, the reference, and the corner of volumes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from problems.compiled import Objective

from .indicators import POINT, Points, extent, goals_of, pieces, truth


@dataclass(frozen=True)
class Scale:
    """The normalisation of a reference, in the user's units and senses."""

    ideal: tuple[float, ...]  # ideal, nadir: Best and worst value of each objective on the reference, dominated points left out
    nadir: tuple[float, ...]
    corner: tuple[float, ...]  # the reference point of the hypervolume
    goals: tuple[Objective, ...]
    what: str  # name of the reference: "the closed form", "the union of 60 runs"
    count: int  # how many points it has
    curve: bool = False  # whether the points of the reference are taken as the curve through them; see `runs.measures.indicators.gd`

    @staticmethod
    def of(reference: Points, *, goals: Sequence[Objective] | None = None, what: str = "the reference", curve: bool = True) -> Scale:
        """The normalisation by a reference that the indicators of `runs.measures.indicators` use. reference (k, m)."""
        goals = goals_of([reference]) or goals
        R = truth(reference, goals)
        goals = goals or [Objective(f"objective {i + 1}") for i in range(R.shape[1])]
        sign = np.array([goal.sign for goal in goals])
        ideal, unit = extent(R)

        def shown(values: np.ndarray) -> tuple[float, ...]:
            return tuple((sign * values + 0.0).tolist())

        return Scale(
            ideal=shown(ideal),
            nadir=shown(R.max(axis=0)),
            corner=shown(ideal + POINT * unit),
            goals=tuple(goals),
            what=what,
            count=len(R),
            curve=curve and bool(pieces(R)),
        )

    def describe(self) -> str:
        """Two sentences for a caption."""
        how = ", the curve through them" if self.curve else ""
        points = f"{self.what} ({self.count} point{'' if self.count == 1 else 's'}{how})"
        ends = f"0 at the ideal ({self._all(self.ideal)}) and 1 at the nadir ({self._all(self.nadir)})"
        volume = f"Hypervolume up to {POINT:g} in each objective ({self._all(self.corner)})."
        return f"Objectives normalised to {ends} of {points}. {volume}"

    def _all(self, values: tuple[float, ...]) -> str:
        return ", ".join(f"{goal.name} {value:.6g} {goal.unit}".rstrip() for goal, value in zip(self.goals, values, strict=True))
