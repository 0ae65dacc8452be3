"""Classes of objectives in physical programming (Messac 1996): what is better, and the boundaries between ranges of preference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from problems.checks import number
from problems.compiled import Objective

from ..checks import shown
from ..operands import exp
from ..stage import Operand

NAMES = ("ideal", "desirable", "tolerable", "undesirable", "highly undesirable", "unacceptable")
"""The ranges of an objective: below J_1, J_1 to J_2, ..., beyond J_5."""
COUNT = 5


@dataclass(frozen=True)
class Side:
    """One side of an objective: `direction * J` rises over the boundaries J_1, ..., J_5."""

    direction: float
    boundaries: tuple[float, ...]

    @property
    def lengths(self) -> np.ndarray:
        """Lengths (4,) of the ranges between the boundaries."""
        return np.abs(np.diff(self.boundaries))

    def degree(self, J: np.ndarray) -> np.ndarray:
        """k at J_k, linear between and beyond J_5; below J_1 exp((J - J_1) / (J_2 - J_1))."""
        x, b = self.direction * np.asarray(J, dtype=float), self.direction * np.array(self.boundaries)
        inside = np.interp(x, b, np.arange(1.0, COUNT + 1.0))
        ideal = exp(np.minimum(x - b[0], 0.0) / (b[1] - b[0]))
        return inside - (1.0 - ideal) + np.maximum(x - b[-1], 0.0) / (b[-1] - b[-2])


@dataclass(frozen=True, init=False, repr=False)
class ObjectiveClass:
    """A class of objectives with its boundaries, in the objective's unit."""

    boundaries: tuple[float, ...]
    NUMBER: ClassVar[int] = COUNT
    RISING: ClassVar[bool] = True
    SENSE: ClassVar[str | None] = None

    def __init__(self, *boundaries: Any):
        kind = type(self).__name__
        given = boundaries[0] if len(boundaries) == 1 and isinstance(boundaries[0], Sequence | np.ndarray) else boundaries
        if isinstance(given, str) or len(given) != self.NUMBER:
            raise ValueError(f"{kind} needs {self.NUMBER} boundaries, not {list(given)!r}")
        values = tuple(number(value, f"a boundary of {kind}") for value in given)
        if not np.all(np.diff(values) > 0 if self.RISING else np.diff(values) < 0):
            raise ValueError(
                f"the boundaries of {kind} must {'increase' if self.RISING else 'decrease'}: {', '.join(f'{v:g}' for v in values)}"
            )
        object.__setattr__(self, "boundaries", values)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{value:g}' for value in self.boundaries)})"

    @property
    def sides(self) -> tuple[Side, ...]:
        """The sides on which the objective becomes worse: towards larger values first."""
        raise NotImplementedError

    def check(self, goal: Objective) -> None:
        """Raise ValueError if the problem moves this objective the other way."""
        if self.SENSE is not None and goal.sense != self.SENSE:
            raise ValueError(f"'{goal.name}' is {goal.sense}d, so that it cannot be of class {type(self).__name__}")

    def limits(self, J: Operand) -> list[Operand]:
        """Excess over J_5 on each side, in lengths from J_1 to J_5: at most 0."""
        ends = [(side.direction / float(side.lengths.sum()), side.boundaries[-1]) for side in self.sides]
        return [slope * (J - last) for slope, last in ends]

    def limit_names(self, goal: Objective) -> tuple[str, ...]:
        """What each limit says."""
        words = ["at most" if side.direction > 0 else "at least" for side in self.sides]
        return tuple(f"{goal.name} {word} {shown(side.boundaries[-1], goal)}" for word, side in zip(words, self.sides, strict=True))

    def degree(self, J: np.ndarray) -> np.ndarray:
        """Degree of values J (n,): k at the boundary J_k, below 1 where ideal, above 5 where unacceptable."""
        return np.max([side.degree(J) for side in self.sides], axis=0)


class Smaller(ObjectiveClass):
    """Smaller is better (class 1S): `Smaller(J1, J2, J3, J4, J5)`, increasing.

    Up to J1 the objective is ideal, then desirable, tolerable, undesirable, highly undesirable, and beyond J5 unacceptable.

    Parameters
    ----------
    *boundaries : float
        J1 to J5, increasing.

    Examples
    --------
    >>> from macs.decisions import Smaller
    >>> Smaller(120, 140, 170, 210, 260).boundaries
    (120.0, 140.0, 170.0, 210.0, 260.0)
    """

    SENSE = "minimize"

    @classmethod
    def even(cls, first: float, last: float) -> Smaller:
        """Boundaries in equal steps from J1 to J5."""
        return cls(*np.linspace(first, last, COUNT).tolist())

    @property
    def sides(self) -> tuple[Side, ...]:
        return (Side(1.0, self.boundaries),)


class Larger(ObjectiveClass):
    """Larger is better (class 2S): `Larger(J1, J2, J3, J4, J5)`, decreasing.

    Parameters
    ----------
    *boundaries : float
        J1 to J5, decreasing.

    Examples
    --------
    >>> from macs.decisions import Larger
    >>> Larger(0.9, 0.8, 0.6, 0.4, 0.1).boundaries
    (0.9, 0.8, 0.6, 0.4, 0.1)
    """

    RISING = False
    SENSE = "maximize"

    @classmethod
    def even(cls, first: float, last: float) -> Larger:
        """Boundaries in equal steps from J1 to J5."""
        return cls(*np.linspace(first, last, COUNT).tolist())

    @property
    def sides(self) -> tuple[Side, ...]:
        return (Side(-1.0, self.boundaries),)


class Value(ObjectiveClass):
    """A value is best (class 3S): `Value(J5, J4, J3, J2, J1, J2, J3, J4, J5)`, increasing; the fifth is the ideal value J1.

    Parameters
    ----------
    *boundaries : float
        Nine, increasing.

    Examples
    --------
    >>> from macs.decisions import Value
    >>> len(Value(1, 2, 3, 4, 5, 6, 7, 8, 9).boundaries)
    9
    """

    NUMBER = 9

    @property
    def sides(self) -> tuple[Side, ...]:
        return Side(1.0, self.boundaries[4:]), Side(-1.0, self.boundaries[4::-1])

    def degree(self, J: np.ndarray) -> np.ndarray:
        """Degree of values J (n,): 1 at the ideal value, k at the boundary J_k of either side, above 5 where unacceptable."""
        return np.max([np.maximum(side.degree(J), 1.0) for side in self.sides], axis=0)


class Range(ObjectiveClass):
    """A range is best (class 4S): `Range(J5, J4, J3, J2, J1, J1, J2, J3, J4, J5)`, increasing; the range between the two J1 is ideal.

    Parameters
    ----------
    *boundaries : float
        Ten, increasing.

    Examples
    --------
    >>> from macs.decisions import Range
    >>> len(Range(1, 2, 3, 4, 5, 6, 7, 8, 9, 10).boundaries)
    10
    """

    NUMBER = 10

    @property
    def sides(self) -> tuple[Side, ...]:
        return Side(1.0, self.boundaries[5:]), Side(-1.0, self.boundaries[4::-1])

    def degree(self, J: np.ndarray) -> np.ndarray:
        """Degree of values J (n,): k at the boundary J_k, 0 in the middle of the ideal range, above 5 where unacceptable."""
        low, high = self.boundaries[4], self.boundaries[5]
        inside = 1.0 - np.minimum(np.asarray(J) - low, high - np.asarray(J)) / (0.5 * (high - low))
        return np.where(inside <= 1.0, inside, np.max([side.degree(J) for side in self.sides], axis=0))
