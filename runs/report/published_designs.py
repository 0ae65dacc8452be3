"""Single designs beside fronts: the point of a front that is better than a design in every objective, and by how much."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .comparison import Comparison
from .published_kinds import STATISTIC, Figures, Published, figures_of
from .tables import Column

if TYPE_CHECKING:
    from macs.fronts.points import Points
    from problems.compiled import CompiledProblem
    from problems.vector import CompiledVectorProblem

GAIN = "better by"
"""Key of the least gain of a point in all objectives."""


class Designs(Published, tag="designs"):
    """Designs with a figure for every objective; for each, of all runs, the verified point of the greatest least gain in all objectives,
    each a share of the design's figure. Where that is not positive, no point dominates the design."""

    statistics: ClassVar[bool] = True
    statistic_head: ClassVar[str] = "beside"
    further: ClassVar[Mapping[str, Column]] = {GAIN: Column(GAIN, "%", digits=3)}

    def ours(self, comparison: Comparison) -> dict[str, list[Figures]]:
        return {
            solver: [{STATISTIC: row["by"], **_nearest(row, comparison, np.vstack(found))} for row in rows]
            for solver, fronts in comparison.fronts.items()
            if sum(map(len, found := [_flyable(front) for front in fronts])) and (rows := self._rows(comparison))
        }

    def remark(self, comparison: Comparison) -> str:
        rows = self._rows(comparison)
        counts = [
            f"{solver} dominates {sum(float(str(one[GAIN])) > 0.0 for one in found)} of {len(rows)} designs"
            for solver, found in self.ours(comparison).items()
        ]
        return (
            f"{', '.join(counts) or 'no point that counts'}. Beside each design, the point that is better in all objectives by the largest "
            "share of its figures; a share that is negative: no point dominates it, and this one comes nearest."
        )

    def check_problem(self, problem: CompiledProblem | CompiledVectorProblem) -> None:
        for row in self.rows:
            missing = [goal.name for goal in problem.goals if goal.name not in row]
            if missing:
                raise ValueError(f"the design '{row['by']}' has no {', '.join(missing)}: figures of all objectives are compared")

    def _rows(self, comparison: Comparison) -> list[dict[str, Any]]:
        return [row for row in self.rows if row["problem"] == comparison.problem]

    def _check_statistic(self, given: Any) -> None:
        if given is not None:
            raise ValueError(f"{STATISTIC}: this kind of table has none")

    def _check_row(self, row: Mapping[str, Any]) -> None:
        super()._check_row(row)
        for key in figures_of(row):
            if row[key] == 0:
                raise ValueError(f"{key} must not be 0: gains are shares of it")


def _flyable(front: Points) -> np.ndarray:
    """Objectives (k, m) of the points of a front that a simulation confirms; of all, where they were not simulated."""
    return front.objectives[front.verified | ~front.was_simulated]


def _nearest(design: Mapping[str, Any], comparison: Comparison, objectives: np.ndarray) -> Figures:
    """Of points with objectives (n, m), that of the greatest least gain on a design, with the gain in %."""
    goals = comparison.known.goals
    figures = np.array([design[goal.name] for goal in goals])
    gains = (np.array([goal.sign for goal in goals]) * (figures - objectives) / np.abs(figures)).min(axis=1)
    best = int(gains.argmax())
    values = {goal.name: float(value) for goal, value in zip(goals, objectives[best], strict=True)}
    return {**values, GAIN: 100.0 * float(gains[best])}
