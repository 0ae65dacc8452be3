"""Preference functions of physical programming: the splines of Messac (1996), eqs. (20)-(25) of Chai and others (2017).

The sign of eq. (23) is mended: A_1(xi) = -xi^4/2 + (xi - 1)^4/2 + 2 xi - 1/2, which is 0 at 0 and 1 at 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..operands import clipped, exp
from ..stage import Operand
from .classes import COUNT, ObjectiveClass, Side

FIRST = 0.1
"""The value z_1 at the first boundary, which is also the first step."""
STEEPNESS = 0.1
"""Where a slope lies between the least and the greatest for which the spline is convex, and the part of the mean slope of the second range
that is the slope at the first boundary (Messac's alpha)."""
DEEPEST = -600.0
"""Least exponent on the ideal side: so the function stays positive in double precision."""
RAISE, MOST = 1.1, 1e12
"""Factor by which beta is raised, and the largest."""


def levels(beta: float, count: int) -> np.ndarray:
    """Values z_1, ..., z_5 at the boundaries, the same for all of `count` objectives.

    A step is beta * (max(count, 2) - 1) times the one before (Messac's rule of one versus the others), so that it is worse if one objective
    crosses a range than if all others cross the one before.
    """
    factor = beta * (max(count, 2) - 1)
    return FIRST * np.cumsum(factor ** np.arange(COUNT))


def slopes(z: np.ndarray, lengths: np.ndarray, flat: bool) -> tuple[np.ndarray, bool]:
    """Slopes s_1, ..., s_5 at the boundaries, and whether each range is steeper than the slope at its begin.

    Only then there is a convex spline, and it is convex by construction. z, lengths (5,).
    """
    mean = np.diff(z) / lengths
    found = [0.0 if flat else STEEPNESS * float(mean[0])]
    for steep in mean.tolist():
        before = found[-1]
        gentlest = (4.0 * steep - before) / 3.0
        steepest = 4.0 * steep - 3.0 * before
        found.append(gentlest + STEEPNESS * (steepest - gentlest))
    return np.array(found), bool(np.all(mean > found[:-1]))


def raised_beta(classes: Sequence[ObjectiveClass], beta: float) -> float:
    """The first of beta, 1.1 beta, 1.21 beta, ... for which the preference functions of all objectives are convex on each side."""
    while beta <= MOST:
        z = levels(beta, len(classes))
        if all(slopes(z, side.lengths, len(one.sides) > 1)[1] for one in classes for side in one.sides):
            return beta
        beta *= RAISE
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
class Ideal:
    """z_1 exp(slope (J - J_1) / z_1) on the ideal side of J_1."""

    first: float
    value: float
    slope: float

    @property
    def steepness(self) -> float:
        """Slope over value."""
        return abs(self.slope) / self.value

    def __call__(self, J: Operand) -> Operand:
        return self.value * exp(clipped(self.slope / self.value * (J - self.first), DEEPEST, 1.0))


@dataclass(frozen=True)
class Line:
    """A line through a point."""

    at: float
    value: float
    slope: float

    def __call__(self, J: Operand) -> Operand:
        return self.value + self.slope * (J - self.at)


@dataclass(frozen=True)
class Piece:
    """One formula of a preference function, which holds from `lower` to `upper`; one of them may be infinite."""

    lower: float
    upper: float
    formula: Spline | Ideal | Line

    def holds(self, x: Operand) -> Operand:
        """1 where the formula holds, else 0; each value belongs to one piece."""
        if math.isinf(self.upper):
            return 1.0 * (x > self.lower)
        return 1.0 * (x <= self.upper) if math.isinf(self.lower) else 1.0 * (x > self.lower) * (x <= self.upper)


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
    z = levels(found, len(classes))
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
    found: list[tuple[float, float, Spline | Ideal | Line]] = [
        (b[k], b[k + 1], Spline(b[k], b[k + 1], p[k], p[k + 1], steep[k], steep[k + 1])) for k in range(COUNT - 1)
    ]
    found.append((b[-1], up * math.inf, Line(b[-1], p[-1], up * steep[-1])))
    if not flat:
        found.append((-up * math.inf, b[0], Ideal(b[0], p[0], up * steep[0])))
    return [Piece(min(begin, end), max(begin, end), formula) for begin, end, formula in found]
