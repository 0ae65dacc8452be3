"""The contract of a preference: what a person wants, by name of objectives, in the user's units and senses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from problems.compiled import Objective

from .ranges import Ranges
from .ranking import Ranking, ranked
from .stage import Stage


class Preference(ABC):
    """What a person wants. Its classes are frozen dataclasses; each says in its docstring what its degrees are.

    The same formulas rank points that exist (`rank`) and are minimised on the problem itself (`macs.decisions.decide`): they are applied to
    numbers and to symbols of CasADi alike.
    """

    DEGREE: ClassVar[str] = "degree of satisfaction"
    """What a degree is, for axes of figures."""
    LEVELS: ClassVar[tuple[float, ...]] = (0.0, 1.0)
    """Degrees that mean something, for axes of figures."""

    @abstractmethod
    def stages(self, goals: Sequence[Objective], ranges: Ranges | None) -> tuple[Stage, ...]:
        """The scalar functions that are minimised, one after the other: mostly one, several where the preference is lexicographic.

        Parameters
        ----------
        goals : m Objectives
            Of the problem.
        ranges : Ranges or None
            By which objectives are normalised. Physical programming needs none.

        Raises
        ------
        ValueError
            For unknown names of objectives, targets beyond the ranges, and missing ranges.
        """

    @abstractmethod
    def degrees(self, goals: Sequence[Objective], ranges: Ranges | None, objectives: np.ndarray) -> np.ndarray:
        """How well each objective is satisfied (n, m) at objectives (n, m); NaN for one that does not enter the preference.

        The objectives may be any, for example those that another preference chose.
        """

    def rank(self, front: Any, ranges: Ranges | None = None) -> Ranking:
        """The points of a front in the order of this preference. Instant: no problem is solved, so that black boxes have it, too.

        Points that are not feasible come last, and before them those that a simulation did not confirm. Points that exceed a hard limit of
        the preference have the value infinity; they are ordered by how much they exceed it. Where values are equal, the point with the
        smaller sum of normalised objectives is first.

        Parameters
        ----------
        front : Front
        ranges : Ranges, optional
            Default: those of the front. Give them if the front does not have its ends, or to compare several fronts.

        Raises
        ------
        ValueError
            For a front without a feasible point, and where `stages` raises one.
        """
        return ranked(self, front, ranges)


def needed(ranges: Ranges | None, preference: Preference) -> Ranges:
    """The ranges, which this preference needs."""
    if not isinstance(ranges, Ranges):
        raise ValueError(f"{type(preference).__name__} needs the ranges of the objectives: Ranges.of(front), not {ranges!r}")
    return ranges
