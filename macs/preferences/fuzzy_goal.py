"""Fuzzy goal programming: the best memberships (Zimmermann 1978; Tiwari, Dharmar and Rao 1987)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from problems.checks import check_choice, positive, short_repr
from problems.compiled import Objective

from .checks import named
from .preference import Preference, needed
from .ranges import Ranges
from .stage import Operand, Stage
from .targets import Aim, Around, Target, aims, memberships, named_targets, sum_of_all, tolerance_limits


@dataclass(frozen=True, repr=False)
class FuzzyGoal(Preference):
    """Maximises the memberships of fuzzy goals: the least of them, or their sum.

    A membership is 1 where the target is met and falls linearly to 0 at the tolerance, which is a hard limit (eqs. 1-4 of Bae and others).
    The value is 1 - the least membership, or the sum of 1 - membership. Where all targets are met, the point with the least sum of all
    normalised objectives is chosen, so that it is not dominated.

    Degrees: the memberships.

    Parameters
    ----------
    targets : dict
        By name: a number, or `Around(value, tolerance)`. An objective that is not named has no goal.
    tolerances : dict, optional
        By name, in the objective's unit: how far from the target the membership is 0. Default: at the worst value of the range.
    aggregate : "min" or "sum"
        Whether the least membership is maximised (Zimmermann) or their sum (Tiwari and others).

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import FuzzyGoal
    >>> wish = FuzzyGoal({"flight time": 150.0, "horizontal speed": 0.7})
    >>> print(wish.rank(front).order)  # best first
    [1 0 2]
    """

    targets: Mapping[str, Target]
    tolerances: Mapping[str, float] | None = None
    aggregate: str = "min"

    DEGREE: ClassVar[str] = "membership"

    def __post_init__(self) -> None:
        targets = named_targets(self.targets)
        object.__setattr__(self, "targets", targets)
        check_choice("aggregate", self.aggregate, ("min", "sum"))
        if self.tolerances is None:
            return
        widths = {}
        for name, width in named(self.tolerances, "tolerances").items():
            if name not in targets:
                raise ValueError(f"'{name}' has a tolerance but no target; there are targets of {', '.join(targets)}")
            if isinstance(targets[name], Around):
                raise ValueError(f"the tolerance of '{name}' belongs into its target: Around(value, tolerance)")
            widths[name] = positive(width, f"the tolerance of '{name}'")
        object.__setattr__(self, "tolerances", widths)

    __repr__ = short_repr

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.targets)

    def _aims(self, goals: Sequence[Objective], ranges: Ranges | None) -> dict[str, Aim]:
        return aims(self.targets, goals, needed(ranges, self), self.tolerances, to_worst=True)

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        found = self._aims(goals, ranges)
        limits, limit_names = tolerance_limits(found, goals)

        def groups(J: Sequence[Operand]) -> list[list[Operand]]:
            each = [aim.excesses(J) for aim in found.values()]
            return [[0.0, *(one for excesses in each for one in excesses)]] if self.aggregate == "min" else [[0.0, *one] for one in each]

        stage = Stage(
            "largest 1 - membership" if self.aggregate == "min" else "sum of 1 - membership",
            lambda J, peaks: sum(peaks),
            groups,
            limits,
            limit_names,
        )
        return stage, sum_of_all(goals, needed(ranges, self))

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        return memberships(self._aims(goals, ranges), objectives, len(goals))
