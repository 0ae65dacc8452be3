"""Goal programming: the least deviations from targets (Charnes and Cooper 1961)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from problems.checks import short_repr
from problems.compiled import Objective

from .checks import levels, named_weights
from .preference import Preference, needed
from .ranges import Ranges
from .stage import Operand, Stage
from .targets import Aim, Around, Target, aims, memberships, named_targets, sum_of_all


@dataclass(frozen=True, repr=False)
class GoalProgramming(Preference):
    """Minimises the weighted sum of deviations from targets, each in units of its objective's range.

    A deviation counts on the worse side of a target only, on both sides for `Around`. With priorities, the deviations of the first level
    are minimised first, and then those of each further level, while those before keep what they attained. Where all targets are met, the
    point with the least sum of all normalised objectives is chosen, so that it is not dominated.

    Degrees: 1 where the target is met, falling to 0 at a range's width from it.

    Parameters
    ----------
    targets : dict
        By name: a number, or `Around(value)`. An objective that is not named has no target.
    weights : dict, optional
        By name of those that have targets, not negative. One that is not named has weight 1.
    priorities : sequence, optional
        Names of those that have targets, most important first; a tuple of names is one level.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import GoalProgramming
    >>> wish = GoalProgramming({"flight time": 150.0, "horizontal speed": 0.7})
    >>> print(wish.rank(front).order)  # best first
    [1 2 0]
    """

    targets: Mapping[str, Target]
    weights: Mapping[str, float] | None = None
    priorities: Sequence[str | Sequence[str]] | None = None

    DEGREE: ClassVar[str] = "degree (1: target met)"

    def __post_init__(self) -> None:
        targets = named_targets(self.targets)
        object.__setattr__(self, "targets", targets)
        for name, target in targets.items():
            if isinstance(target, Around) and target.tolerance is not None:
                raise ValueError(f"goal programming has no tolerances: give '{name}' the target Around({target.value:g})")
        if self.weights is not None:
            weights = named_weights(self.weights)
            for name in weights:
                if name not in targets:
                    raise ValueError(f"'{name}' has a weight but no target; there are targets of {', '.join(targets)}")
            object.__setattr__(self, "weights", weights)
        if self.priorities is not None:
            given = levels(self.priorities)
            named_in = [name for level in given for name in level]
            for name in named_in:
                if name not in targets:
                    raise ValueError(f"'{name}' has a priority but no target; there are targets of {', '.join(targets)}")
            for name in targets:
                if name not in named_in:
                    raise ValueError(f"'{name}' has a target but no priority")
            object.__setattr__(self, "priorities", given)

    __repr__ = short_repr

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.targets)

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        spans = needed(ranges, self)
        found = aims(self.targets, goals, spans)
        ordered = levels(self.priorities) if self.priorities is not None else (tuple(self.targets),)
        titles = ["deviations"] if len(ordered) == 1 else [f"priority {k + 1}" for k in range(len(ordered))]
        stages = [
            self._stage(title, [(self._weight(name), found[name]) for name in level]) for title, level in zip(titles, ordered, strict=True)
        ]
        return (*stages, sum_of_all(goals, spans))

    def _weight(self, name: str) -> float:
        return 1.0 if self.weights is None else self.weights.get(name, 1.0)

    @staticmethod
    def _stage(title: str, weighted: Sequence[tuple[float, Aim]]) -> Stage:
        def value(J: Sequence[Operand], peaks: Sequence[Operand]) -> Operand:
            return sum(weight * peak for (weight, _), peak in zip(weighted, peaks, strict=True))

        def groups(J: Sequence[Operand]) -> list[list[Operand]]:
            return [[0.0, *aim.excesses(J)] for _, aim in weighted]

        return Stage(title, value, groups)

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        return memberships(aims(self.targets, goals, needed(ranges, self)), objectives, len(goals))
