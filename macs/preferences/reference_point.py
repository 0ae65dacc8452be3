"""Reference points: the achievement scalarising function (Wierzbicki 1980, 1982)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from problems.checks import check_interval, short_repr
from problems.compiled import Objective

from .checks import named_numbers, shown
from .preference import Preference, needed
from .ranges import Ranges
from .stage import Operand, Stage

AUGMENTATION = 1e-4


@dataclass(frozen=True, repr=False)
class ReferencePoint(Preference):
    """Minimises the largest distance from an aspiration, and a little of the sum of all: max_i a_i + augmentation * sum_i a_i.

    a_i is 0 at the aspiration and 1 at the reservation of objective i, linear between and beyond. It is negative where the objective is
    better than its aspiration, so that the point is Pareto-optimal whether or not the aspirations can be met.

    Degrees: 1 - a_i: 1 at the aspiration, 0 at the reservation, linear beyond.

    Parameters
    ----------
    aspiration : dict
        Values that are hoped for, by name. An objective that is not named has the best value of its range.
    reservation : dict, optional
        Values that are still acceptable, by name. An objective that is not named has the one that is a range's width worse than its
        aspiration.
    augmentation : float
        Above 0, the point is properly Pareto-optimal: no trade-off is beyond 1 / augmentation, in units of a_i.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import ReferencePoint
    >>> wish = ReferencePoint({"flight time": 150.0})
    >>> print(wish.rank(front).order)  # best first
    [1 2 0]
    """

    aspiration: Mapping[str, float]
    reservation: Mapping[str, float] | None = None
    augmentation: float = AUGMENTATION

    DEGREE: ClassVar[str] = "degree (1: aspiration, 0: reservation)"

    def __post_init__(self) -> None:
        object.__setattr__(self, "aspiration", named_numbers(self.aspiration, "the aspiration"))
        if self.reservation is not None:
            object.__setattr__(self, "reservation", named_numbers(self.reservation, "the reservation"))
        check_interval("augmentation", self.augmentation, "[0, 1]")

    __repr__ = short_repr

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys([*self.aspiration, *(self.reservation or {})]))

    def _lines(self, goals: Sequence[Objective], ranges: Ranges | None) -> list[tuple[float, float]]:
        """The slope of a_i and its aspiration, for each goal."""
        spans, lines = needed(ranges, self), []
        reservation = self.reservation or {}
        self.check(goals)
        for goal, span in zip(goals, spans.spans(goals).tolist(), strict=True):
            name, hoped = goal.name, self.aspiration.get(goal.name, spans.best[goal.name])
            spans.check(hoped, goal, "the aspiration")
            if name in reservation:
                spans.check(reservation[name], goal, "the reservation")
                span = goal.sign * (reservation[name] - hoped)
                if span <= 0:
                    least = f"the reservation of '{name}', {shown(reservation[name], goal)}"
                    raise ValueError(f"{least}, must be worse than its aspiration, {shown(hoped, goal)}")
            lines.append((goal.sign / span, hoped))
        return lines

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        lines = self._lines(goals, ranges)

        def distances(J: Sequence[Operand]) -> list[Operand]:
            return [slope * (value - hoped) for value, (slope, hoped) in zip(J, lines, strict=True)]

        def value(J: Sequence[Operand], peaks: Sequence[Operand]) -> Operand:
            return peaks[0] + self.augmentation * sum(distances(J))

        return (Stage("achievement", value, lambda J: [distances(J)]),)

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        slopes, hoped = np.array(self._lines(goals, ranges)).T
        return 1.0 - slopes * (np.asarray(objectives, dtype=float) - hoped)
