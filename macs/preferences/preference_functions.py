"""Preference functions of physical programming: the classes of objectives, their splines, and the means of these under a Gaussian.

Classes and splines are those of Messac (1996), eqs. (20)-(25) of Chai and others (2017); the sign of eq. (23) is mended: A_1(xi) =
-xi^4/2 + (xi - 1)^4/2 + 2 xi - 1/2, which is 0 at 0 and 1 at 1. Fuzzy functions are eqs. (34) and (35).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np

from problems.checks import number
from problems.compiled import Objective

from .ranges import limit_name
from .stage import NUMERIC, Operand, clipped, exp, greatest, least

RANGE_NAMES = ("ideal", "desirable", "tolerable", "undesirable", "highly undesirable", "unacceptable")
"""The ranges of an objective: below J_1, J_1 to J_2, ..., beyond J_5."""
BOUNDARIES = 5
"""Boundaries J_1, ..., J_5 on each side of an objective."""


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
        inside = np.interp(x, b, np.arange(1.0, BOUNDARIES + 1.0))
        ideal = exp(np.minimum(x - b[0], 0.0) / (b[1] - b[0]))
        return inside - (1.0 - ideal) + np.maximum(x - b[-1], 0.0) / (b[-1] - b[-2])


@dataclass(frozen=True, init=False, repr=False)
class ObjectiveClass:
    """A class of objectives with its boundaries, in the objective's unit."""

    boundaries: tuple[float, ...]
    NUMBER: ClassVar[int] = BOUNDARIES
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
        """The side on which the objective becomes worse; of two, that of larger values first."""
        if self.SENSE is not None:
            return (Side(1.0 if self.RISING else -1.0, self.boundaries),)
        return Side(1.0, self.boundaries[-BOUNDARIES:]), Side(-1.0, self.boundaries[BOUNDARIES - 1 :: -1])

    @classmethod
    def even(cls, first: float, last: float) -> Self:
        """Boundaries of `Smaller` or `Larger` in equal steps from J1 to J5."""
        return cls(*np.linspace(first, last, BOUNDARIES).tolist())

    def check(self, goal: Objective) -> None:
        """Raise ValueError if the problem moves this objective the other way."""
        if self.SENSE is not None and goal.sense != self.SENSE:
            raise ValueError(f"'{goal.name}' is {goal.sense}d, so that it cannot be of class {type(self).__name__}")

    def limits(self, J: Operand) -> list[Operand]:
        """Excess over J_5 on each side, in lengths from J_1 to J_5: at most 0."""
        return [side.direction / float(side.lengths.sum()) * (J - side.boundaries[-1]) for side in self.sides]

    def limit_names(self, goal: Objective) -> tuple[str, ...]:
        """What each limit says."""
        return tuple(limit_name(goal, side.direction, side.boundaries[-1]) for side in self.sides)

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

    def degree(self, J: np.ndarray) -> np.ndarray:
        """Degree of values J (n,): k at the boundary J_k, 0 in the middle of the ideal range, above 5 where unacceptable."""
        low, high = self.boundaries[4], self.boundaries[5]
        inside = 1.0 - np.minimum(np.asarray(J) - low, high - np.asarray(J)) / (0.5 * (high - low))
        return np.where(inside <= 1.0, inside, np.max([side.degree(J) for side in self.sides], axis=0))


def boundary_values(beta: float, count: int) -> np.ndarray:
    """Values z_1, ..., z_5 at the boundaries, the same for all of `count` objectives.

    z_1, which is also the first step, is 0.1. A step is beta * (max(count, 2) - 1) times the one before (Messac's rule of one versus the
    others), so that it is worse if one objective crosses a range than if all others cross the one before.
    """
    return 0.1 * np.cumsum((beta * (max(count, 2) - 1)) ** np.arange(BOUNDARIES))


def slopes(z: np.ndarray, lengths: np.ndarray, flat: bool) -> tuple[np.ndarray, bool]:
    """Slopes s_1, ..., s_5 at the boundaries, and whether each range is steeper than the slope at its begin.

    Only then there is a convex spline, and it is convex by construction. z (5,), lengths (4,).
    """
    # Messac's alpha: where a slope lies between the least and the greatest of convex splines, and the part of the first mean slope at J_1.
    alpha = 0.1
    mean = np.diff(z) / lengths
    found = [0.0 if flat else alpha * float(mean[0])]
    for steep in mean.tolist():
        before = found[-1]
        gentlest = (4.0 * steep - before) / 3.0
        steepest = 4.0 * steep - 3.0 * before
        found.append(gentlest + alpha * (steepest - gentlest))
    return np.array(found), bool(np.all(mean > found[:-1]))


def raised_beta(classes: Sequence[ObjectiveClass], beta: float) -> float:
    """The first of beta, 1.1 beta, 1.21 beta, ... for which the preference functions of all objectives are convex on each side."""
    while beta <= 1e12:
        z = boundary_values(beta, len(classes))
        if all(slopes(z, side.lengths, len(one.sides) > 1)[1] for one in classes for side in one.sides):
            return beta
        beta *= 1.1
    raise ValueError(f"lengths of ranges differ too much for physical programming: {', '.join(map(repr, classes))}")


@dataclass(frozen=True)
class Spline:
    """Eq. (20): from p0 with slope s0 at `begin` to p1 with slope s1 at `end`, slopes along this way."""

    begin: float
    end: float
    p0: float
    p1: float
    s0: float
    s1: float

    def __call__(self, J: Operand) -> Operand:
        # Outside of its range the formula is not used; it is cut off there, so that it remains finite.
        length = abs(self.end - self.begin)
        xi = clipped((J - self.begin) / (self.end - self.begin), -1.0, 2.0)
        up4, down4 = xi**4, (xi - 1.0) ** 4
        a0 = 0.5 * up4 - 0.5 * down4 - 2.0 * xi + 1.5
        a1 = -0.5 * up4 + 0.5 * down4 + 2.0 * xi - 0.5
        b0 = length * (0.125 * up4 - 0.375 * down4 - 0.5 * xi + 0.375)
        b1 = length * (0.375 * up4 - 0.125 * down4 - 0.5 * xi + 0.125)
        return a0 * self.p0 + a1 * self.p1 + b0 * self.s0 + b1 * self.s1


@dataclass(frozen=True)
class Line:
    """A line through a point."""

    at: float
    value: float
    slope: float

    def __call__(self, J: Operand) -> Operand:
        return self.value + self.slope * (J - self.at)


class Ideal(Line):
    """z_1 exp(slope (J - J_1) / z_1) on the ideal side of J_1."""

    @property
    def steepness(self) -> float:
        """Slope over value."""
        return abs(self.slope) / self.value

    def __call__(self, J: Operand) -> Operand:
        # With an exponent of -600 at least it stays positive in double precision.
        return self.value * exp(clipped(self.slope / self.value * (J - self.at), -600.0, 1.0))


@dataclass(frozen=True)
class Piece:
    """One formula of a preference function, which holds from `lower` to `upper`; one of them may be infinite."""

    lower: float
    upper: float
    formula: Spline | Line

    def holds(self, x: Operand) -> Operand:
        """1 where the formula holds, else 0; each value belongs to one piece."""
        return 1.0 * (x > self.lower) * (x <= self.upper)


@dataclass(frozen=True)
class PreferenceFunction:
    """The preference function of one objective: z_k at each boundary J_k, convex on each side, once continuously differentiable,
    positive."""

    of: ObjectiveClass
    z: np.ndarray  # z, beta: (5,): Values at the boundaries, and the beta of their steps
    beta: float
    pieces: tuple[Piece, ...]  # in increasing order, without gaps
    boundaries: tuple[tuple[float, float], ...]  # in increasing order of J

    def __call__(self, J: Operand) -> Operand:
        """The preference of values J, for numbers, arrays and symbols."""
        return sum(piece.holds(J) * piece.formula(J) for piece in self.pieces)


def preference_functions(classes: Sequence[ObjectiveClass], beta: float) -> list[PreferenceFunction]:
    """The preference functions of several objectives, with the smallest beta (see `raised_beta`) for which all are convex on each side."""
    found = raised_beta(classes, beta)
    z = boundary_values(found, len(classes))
    return [_function(one, z, found) for one in classes]


def _function(one: ObjectiveClass, z: np.ndarray, beta: float) -> PreferenceFunction:
    flat = len(one.sides) > 1
    pieces = [piece for side in one.sides for piece in _pieces(side, z, slopes(z, side.lengths, flat)[0], flat)]
    if flat:
        high, low = (side.boundaries[0] for side in one.sides)
        if low < high:
            pieces.append(Piece(low, high, Line(low, float(z[0]), 0.0)))
    marks = {mark: float(level) for side in one.sides for mark, level in zip(side.boundaries, z, strict=True)}
    return PreferenceFunction(one, z, beta, tuple(sorted(pieces, key=lambda piece: piece.lower)), tuple(sorted(marks.items())))


def _pieces(side: Side, z: np.ndarray, s: np.ndarray, flat: bool) -> list[Piece]:
    """The splines between the boundaries, the line beyond the last, and, if the function is not flat there, the ideal side."""
    b, up, p, steep = side.boundaries, side.direction, z.tolist(), s.tolist()
    found: list[tuple[float, float, Spline | Line]] = [
        (b[k], b[k + 1], Spline(b[k], b[k + 1], p[k], p[k + 1], steep[k], steep[k + 1])) for k in range(BOUNDARIES - 1)
    ]
    found.append((b[-1], up * math.inf, Line(b[-1], p[-1], up * steep[-1])))
    if not flat:
        found.append((-up * math.inf, b[0], Ideal(b[0], p[0], up * steep[0])))
    return [Piece(min(begin, end), max(begin, end), formula) for begin, end, formula in found]


CUT = 3.0
"""The Gaussian is cut off at so many spreads."""
IDEAL_DEPTH = 60.0
"""Depth of the ideal side, in lengths by which it falls by a factor e, below which its rest is left out."""


@dataclass(frozen=True)
class FuzzyFunction:
    """A preference function with fuzzy boundaries: its mean over [J - 3 spread, J + 3 spread] under a Gaussian exp(-(t / spread)^2).

    The quadrature is that of Gauss and Legendre on each piece, so that none goes over a jump of the second derivative. Where the function
    is above 1e-200, its relative error is below 1e-11, of the printed form below 1e-8: the tests compare it with adaptive quadrature.
    """

    crisp: PreferenceFunction
    spread: float  # in the objective's unit
    # Whether the Gaussian is centred at the boundary that is nearest to J, as eq. (35) is printed, instead of J. That function jumps
    # half-way between boundaries.
    printed: bool = False

    def __call__(self, J: Operand) -> Operand:
        """The fuzzy preference of values J, for numbers, arrays and symbols."""
        # The weight is exp(-(u + shift)^2) over u = (t - J) / spread; where the shift is large, only its greatest part counts.
        shift = self._shift(J) if self.printed else 0.0
        beyond = greatest(abs(shift) - CUT, 0.0)
        reach = (beyond * beyond + 36.0) ** 0.5  # beyond it the weight is below exp(-36), 2e-16, of its greatest
        low, high = greatest(-shift - reach, -CUT), least(reach - shift, CUT)

        def weight(u: Operand) -> Operand:
            return exp(least(beyond * beyond - (u + shift) * (u + shift), 0.0))

        total = 0.0
        for piece in self.crisp.pieces:
            begin = clipped(J + self.spread * low, piece.lower, piece.upper)
            end = clipped(J + self.spread * high, piece.lower, piece.upper)
            panels = 1
            if isinstance(piece.formula, Ideal):
                steepness = piece.formula.steepness
                depth = IDEAL_DEPTH / steepness
                begin, end = (greatest(begin, end - depth), end) if math.isinf(piece.lower) else (begin, least(end, begin + depth))
                panels += int(min(IDEAL_DEPTH, 2.0 * CUT * self.spread * steepness) / 12.0)  # 20 nodes on each panel of 12 lengths

            def mass(place: Any, begin: Operand = begin, end: Operand = end, formula: Any = piece.formula) -> Operand:
                t = begin + (end - begin) * place
                return weight((t - J) / self.spread) * formula(t)

            total = total + (end - begin) / self.spread * _mean(mass, panels, J)
        if not self.printed:
            return total / (math.sqrt(math.pi) * math.erf(CUT))
        return total / ((high - low) * _mean(lambda place: weight(low + (high - low) * place), 3, J))

    def _shift(self, x: Operand) -> Operand:
        """Distance of x from the nearest boundary, in spreads."""
        marks = [boundary for boundary, _ in self.crisp.boundaries]
        nearest = marks[0] + sum((high - low) * (x > 0.5 * (low + high)) for low, high in pairwise(marks))
        return (x - nearest) / self.spread


def _mean(function: Callable[[Any], Operand], panels: int, J: Operand) -> Operand:
    """The mean over [0, 1] of a function that gives an operand like J, by quadrature on equal panels; all nodes at once for numbers."""
    places, parts = _nodes(panels)
    if isinstance(J, NUMERIC):
        shape = (-1, *(1,) * np.ndim(J))
        # Summed in the same order whatever the number of values is.
        return (parts.reshape(shape) * function(places.reshape(shape))).cumsum(axis=0)[-1]
    return sum(part * function(place) for place, part in zip(places.tolist(), parts.tolist(), strict=True))


@lru_cache(maxsize=64)
def _nodes(panels: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1], in equal panels."""
    x, w = np.polynomial.legendre.leggauss(20)
    return ((np.arange(panels)[:, None] + 0.5 + 0.5 * x) / panels).ravel(), np.tile(0.5 * w / panels, panels)
