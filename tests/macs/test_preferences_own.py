"""A preference that a user writes: what it does not say has a meaning, too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from choices import cart

from macs.decisions import Preference, Stage
from problems.compiled import Objective


@dataclass(frozen=True)
class Quick(Preference):
    """The least effort within a time, which is a limit without a name."""

    time: float

    @property
    def names(self) -> tuple[str, ...]:
        return "time", "effort"

    def stages(self, goals: Sequence[Objective], ranges: object) -> tuple[Stage, ...]:
        return (Stage("effort", lambda J, peaks: J[1], limits=lambda J: [J[0] - self.time]),)

    def degrees(self, goals: Sequence[Objective], ranges: object, objectives: np.ndarray) -> np.ndarray:
        return np.full(objectives.shape, np.nan)


def test_the_best_is_the_least_effort_within_the_time() -> None:
    """The efforts of times from 1.2 to 4 are 12 / T^3."""
    ranking = Quick(2.6).rank(cart(3))
    assert ranking.best.objectives["time"] == pytest.approx(2.6) and ranking.message == ""
    assert ranking.values[ranking.order].tolist() == pytest.approx([12 / 2.6**3, 12 / 1.2**3, np.inf])


def test_limits_without_names_are_told_by_their_numbers_where_no_point_meets_them() -> None:
    ranking = Quick(1.0).rank(cart(3))
    assert ranking.message == "No point meets all hard limits; none has limit 1 of effort."
    assert ranking.best.objectives["time"] == pytest.approx(1.2)
