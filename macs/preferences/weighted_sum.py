"""Weighted sum of normalised objectives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from problems.checks import short_repr
from problems.compiled import Objective

from .checks import named_weights, places
from .preference import Preference, needed
from .ranges import Ranges
from .stage import Operand, Stage


@dataclass(frozen=True, repr=False)
class WeightedSum(Preference):
    """Minimises the weighted sum of objectives that are 0 at the best and 1 at the worst value of their ranges.

    It finds no point of a part of the front that bows inward.

    Degrees: 1 at the best, 0 at the worst value of the range, linear between and beyond.

    Parameters
    ----------
    weights : dict
        By name of objectives, not negative. An objective that is not named has weight 0.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import WeightedSum
    >>> wish = WeightedSum({"flight time": 1, "horizontal speed": 3})
    >>> print(wish.rank(front).order)  # best first
    [2 1 0]
    """

    weights: Mapping[str, float]

    DEGREE: ClassVar[str] = "degree (1: best, 0: worst)"

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", named_weights(self.weights))

    __repr__ = short_repr

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.weights)

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        found, spans = places(self.weights, goals), needed(ranges, self)

        def value(J: Sequence[Operand], peaks: Sequence[Operand]) -> Operand:
            normal = spans.normalised(goals, J)
            return sum(weight * normal[found[name]] for name, weight in self.weights.items())

        return (Stage("weighted sum", value),)

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        return 1.0 - np.stack(needed(ranges, self).normalised(goals, list(np.asarray(objectives, dtype=float).T)), axis=1)
