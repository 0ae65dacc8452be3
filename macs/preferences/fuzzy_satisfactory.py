"""Fuzzy satisfactory goal programming: memberships, with an order of priority that is relaxed (Hu and Li 2006; Bae and others)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from problems.checks import check_interval, short_repr
from problems.compiled import Objective

from .checks import levels
from .preference import Preference, needed
from .ranges import Ranges
from .stage import Operand, Stage
from .targets import Aim, Target, aims, memberships, named_targets, tolerance_limits


@dataclass(frozen=True, repr=False)
class FuzzySatisfactory(Preference):
    """Minimises the mean of 1 - membership, and by how much the memberships violate an order of priority.

    The value is sum(d_i) / m + regulating * kappa with d = 1 - membership and kappa the largest d_s - d_r of goals s of one level and r of
    the next, less important one (eqs. 7-11 of Bae and others). The order is kept where kappa <= 0. Memberships are those of `FuzzyGoal`
    with the ranges' worst values as tolerances, hard limits.

    For two goals the value is (1/2 + regulating) d_1 + (1/2 - regulating) d_2 (their eq. 53), so that from 1/m on a worse second objective
    makes it better: `satisfy` raises `regulating` below 1/m only.

    Degrees: the memberships.

    Parameters
    ----------
    targets : dict
        By name: a number, or `Around(value, tolerance)`. A goal that is named in `priorities` only has the best value of its range as its
        target.
    priorities : sequence
        Names of all goals, most important first; a tuple of names is one level. At least two levels.
    regulating : float
        Weight of kappa, at least 0.
    ordered : bool
        Whether the order is a hard limit, kappa <= 0.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import FuzzySatisfactory
    >>> wish = FuzzySatisfactory({}, priorities=["horizontal speed", "flight time"])
    >>> print(wish.rank(front).order)  # best first
    [1 2 0]
    """

    targets: Mapping[str, Target]
    priorities: Sequence[str | Sequence[str]]
    regulating: float = 0.1
    ordered: bool = False

    DEGREE: ClassVar[str] = "membership"

    def __post_init__(self) -> None:
        targets = {} if self.targets == {} else named_targets(self.targets)
        given = levels(self.priorities)
        if len(given) < 2:
            raise ValueError("priorities must have at least two levels: what is most important, and what is less")
        for name in targets:
            if all(name not in level for level in given):
                raise ValueError(f"'{name}' has a target but no priority")
        check_interval("regulating", self.regulating, "[0, inf)")
        if not isinstance(self.ordered, bool):
            raise ValueError(f"ordered must be True or False, not {self.ordered!r}")
        object.__setattr__(self, "targets", targets)
        object.__setattr__(self, "priorities", given)

    __repr__ = short_repr

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for level in levels(self.priorities) for name in level)

    def _aims(self, goals: Sequence[Objective], ranges: Ranges | None) -> dict[str, Aim]:
        spans = needed(ranges, self)
        self.check(goals)
        spans.ends(goals)
        return aims({name: self.targets.get(name, spans.best[name]) for name in self.names}, goals, spans, to_worst=True)

    def _pairs(self) -> list[tuple[str, str]]:
        """All goals s of one level and r of the next."""
        return [(s, r) for more, less in pairwise(levels(self.priorities)) for s in more for r in less]

    def _excesses_of_order(self, found: Mapping[str, Aim], J: Sequence[Operand]) -> list[Operand]:
        """d_s - d_r of all goals s of one level and r of the next."""
        return [found[s].deviation(J) - found[r].deviation(J) for s, r in self._pairs()]

    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        found = self._aims(goals, ranges)
        tolerances, limit_names = tolerance_limits(found, goals)

        def value(J: Sequence[Operand], peaks: Sequence[Operand]) -> Operand:
            return sum(peaks[1:]) / len(found) + self.regulating * peaks[0]

        def groups(J: Sequence[Operand]) -> list[list[Operand]]:
            # The largest of these is kappa. Without a kink in what rises: a solve would not end at an optimum that lies there.
            order = [part - found[r].deviation(J) for s, r in self._pairs() for part in found[s].parts(J)]
            return [order, *([0.0, *aim.excesses(J)] for aim in found.values())]

        def limits(J: Sequence[Operand]) -> list[Operand]:
            return [*tolerances(J), *(self._excesses_of_order(found, J) if self.ordered else ())]

        order = [f"{s} satisfied at least as {r}" for s, r in self._pairs()] if self.ordered else []
        return (Stage("1 - membership, order", value, groups, limits, (*limit_names, *order)),)

    def kappa(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        """By how much the memberships violate the order of priority, (n,), at objectives (n, m); not above 0 where they keep it."""
        J = list(np.asarray(objectives, dtype=float).T)
        return np.max(self._excesses_of_order(self._aims(goals, ranges), J), axis=0)

    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        return memberships(self._aims(goals, ranges), objectives, len(goals))
