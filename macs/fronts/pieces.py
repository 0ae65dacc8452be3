"""Cubic pieces through points of a curve and its slopes: where they end, and an estimate of their error.

Places s lie along the line between the ends of a front, heights h across it, both in ranges of the objectives; a front has slopes h' in
[-1, 1]. Between neighbours the curve is the cubic Hermite interpolant; its error is estimated from the quintics through the next point on
either side. Pieces end at kinks, where a constraint becomes active or valleys cross, and at gaps, where what goes on is dominated: there
both sides, extrapolated, explain the points by far better than one smooth curve does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..pareto.dominance import BETTER

Polynomial = Any  # scipy's: heights at places by a call, slopes by its `derivative`


@dataclass(frozen=True)
class FitLimits:
    """When something else explains points better than a smooth curve with their slopes."""

    better: float = 0.1  # part of the error of a smooth curve, or of a doubtful slope, that the explanation may leave
    hidden: float = 0.06  # part of the triangle of chord and tangents that estimates of errors are at least: points may miss something


FIT = FitLimits()


@dataclass(frozen=True, eq=False)
class CurvePiece:
    """A smooth piece of a curve: k nodes in the order of their places. It may be one point."""

    places: np.ndarray  # (k,)
    heights: np.ndarray  # (k,)
    slopes: np.ndarray  # (k,)
    errors: np.ndarray  # (k - 1,): estimates of the largest distance between neighbours, along the normal

    @property
    def interval(self) -> tuple[float, float]:
        """Places at which it begins and ends."""
        return float(self.places[0]), float(self.places[-1])

    def spread(self, count: int) -> np.ndarray:
        """So many places, evenly between its ends (count,)."""
        return np.linspace(self.places[0], self.places[-1], count)

    def __call__(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights and slopes at places within the piece, any shape."""
        from scipy.interpolate import CubicHermiteSpline  # slow to import

        if len(self.places) == 1:
            return np.full(np.shape(places), self.heights[0]), np.full(np.shape(places), self.slopes[0])
        cubic = CubicHermiteSpline(self.places, self.heights, self.slopes)
        return cubic(places), cubic(places, 1)

    def errors_at(self, places: np.ndarray) -> np.ndarray:
        """Estimated errors at places within the piece."""
        return np.append(self.errors, 0.0)[np.clip(np.searchsorted(self.places, places, side="right") - 1, 0, max(len(self.errors) - 1, 0))]


@dataclass(frozen=True, eq=False)
class _Run:
    """Points that may be on one smooth curve; at its sides the edges of its piece beyond, as a place, height, slope and error each."""

    s: np.ndarray
    h: np.ndarray
    d: np.ndarray
    before: tuple[float, float, float, float] | None = None
    after: tuple[float, float, float, float] | None = None
    inferred: tuple[int, ...] = ()  # sides whose slopes follow from the points beside

    def through(self, *points: int, free: Sequence[int] = ()) -> Polynomial:
        """The polynomial through points and their slopes, but for those of the points `free`."""
        from scipy.interpolate import KroghInterpolator  # slow to import

        data = [(self.s[i], value) for i in points for value in ((self.h[i],) if i in free else (self.h[i], self.d[i]))]
        return KroghInterpolator(*np.array(data).T)

    def known(self) -> _Run:
        """The same with slopes at its sides from the points beside where these contradict them: there they may be one of several."""
        d, n, inferred = self.d.copy(), len(self.s), list[int]()
        for i, step in ((0, 1), (n - 1, -1)) if n > 2 else ():
            likely, rough = (
                float(self.through(*near, free=[i]).derivative(self.s[i])) for near in ((i, i + step, i + 2 * step), (i, i + step))
            )
            if FIT.better * abs(d[i] - likely) > abs(likely - rough):
                d[i] = np.clip(likely, -1.0, 1.0)
                inferred.append(i)
        return _Run(self.s, self.h, d, self.before, self.after, tuple(inferred))

    def error(self, i: int) -> float:
        """The estimated error between points i and i + 1."""
        n, cubic = len(self.s), self.through(i, i + 1)
        rivals = [self.through(j, i, i + 1) for j in (i - 1, i + 2) if 0 <= j < n]
        # At a side, also what one without the slope there would be, which may be one of several.
        for side, *more in ((0, 1, 2), (n - 1, n - 2, n - 3)) if n > 2 else ():
            if side in (i, i + 1):
                rivals.append(self.through(side, *more[: 1 if side in self.inferred else 2], free=[side]))
                # One whose slope the points contradict may lie where the front turns to it at once.
                rivals += [self.side(more[0], more[1] - more[0])[0]] if side in self.inferred else []
        # Of two points alone: what one without either slope would be.
        rivals = rivals or [self.through(i, i + 1, free=[j]) for j in (i, i + 1)]
        return _apart(cubic, rivals, self.s[i], self.s[i + 1])

    def errors(self) -> np.ndarray:
        """The estimated errors (n - 1,) between points: at least a small part of what the slopes at both leave open."""
        tangents = 0.25 * np.diff(self.s) * np.abs(np.diff(self.d)) * _normal(0.5 * (self.d[1:] + self.d[:-1]))
        return np.maximum([self.error(i) for i in range(len(self.s) - 1)], FIT.hidden * tangents)

    def side(self, i: int, step: int) -> tuple[Polynomial, Polynomial]:
        """The polynomial through points i and up to two further ones on its side, to be extrapolated, and one of a lower degree."""
        near, third = [i, i + step], i + 2 * step
        if 0 <= third < len(self.s):
            return self.through(*near, third), self.through(*near)
        return self.through(*near), self.through(*near, free=[i + step])

    def piece(self) -> CurvePiece:
        """The piece of the curve."""
        run = self.known()
        errors = run.errors().tolist()
        nodes = [*zip(run.s, run.h, run.d, strict=True)]
        if self.before is not None and self.before[0] < self.s[0]:
            nodes, errors = [self.before[:3], *nodes], [self.before[3], *errors]
        if self.after is not None and self.after[0] > self.s[-1]:
            nodes, errors = [*nodes, self.after[:3]], [*errors, self.after[3]]
        places, heights, slopes = np.array(nodes).T
        return CurvePiece(places, heights, slopes, np.array(errors))


def pieces(s: np.ndarray, h: np.ndarray, d: np.ndarray, first: Sequence[int] = ()) -> list[CurvePiece]:
    """The pieces of the curve through points with places in ascending order, heights and slopes (n,). Before the
    points `first` there are gaps."""
    ends = [0, *sorted(set(first) - {0, len(s)}), len(s)]
    runs = [_Run(s[a:b], h[a:b], d[a:b]) for a, b in pairwise(ends)]
    return [part.piece() for run in runs for part in _split(run)]


def _split(run: _Run) -> list[_Run]:
    """The run as the smooth parts of the curve."""
    n = len(run.s)
    if n < 4:
        return [run]
    known = run.known()
    errors = [known.error(i) for i in range(n - 1)]
    breaks = [_between(run, known, i, errors[i]) for i in range(1, n - 2) if errors[i] > 10 * BETTER]
    breaks += [_at_point(run, known, i, one) for i in range(2, n - 2) if (one := max(errors[i - 1], errors[i])) > 10 * BETTER]
    left, parts = min(breaks, key=lambda one: one[0], default=(np.inf, []))
    return [part for one in parts for part in _split(one)] if left < FIT.better else [run]


def _between(run: _Run, known: _Run, i: int, smooth: float) -> tuple[float, list[_Run]]:
    """What a break between points i and i + 1 leaves of the error of a smooth curve, and the two parts."""
    nothing = np.inf, list[_Run]()
    start, end = known.s[i], known.s[i + 1]
    (left, left_rival), (right, right_rival) = known.side(i, -1), known.side(i + 1, 1)
    places = np.linspace(start, end, 257)
    # Beyond where it is horizontal or vertical in the objectives, a side is dominated: what follows there is a gap.
    a, b = _admissible(left, places), _admissible(right, places[::-1])
    lower = np.where(places <= a, left(places), left(a) + places - a)
    upper = np.where(places >= b, right(places), right(b) + b - places)
    (crossings,) = np.nonzero(np.diff(np.sign(lower - upper)) != 0)
    if len(crossings) != 1:
        return nothing
    k, apart = crossings[0], lower - upper
    place = places[k] + (places[k + 1] - places[k]) * apart[k] / (apart[k] - apart[k + 1])
    to = min(place, a), max(place, b)
    edges = []
    for one, rival, begin, until in ((left, left_rival, start, to[0]), (right, right_rival, end, to[1])):
        height, slope = one(until), one.derivative(until)
        error = _apart(one, [rival], *sorted((begin, until)))
        edges.append((float(until), float(height), float(np.clip(slope, -1.0, 1.0)), error))
    if abs(edges[0][2] - edges[1][2]) < 0.5 * abs(known.d[i + 1] - known.d[i]) + BETTER and to[0] == to[1]:  # no kink
        return nothing
    parts = [
        _Run(run.s[: i + 1], run.h[: i + 1], run.d[: i + 1], run.before, edges[0]),
        _Run(run.s[i + 1 :], run.h[i + 1 :], run.d[i + 1 :], edges[1], run.after),
    ]
    return max(edge[3] for edge in edges) / smooth, parts


def _admissible(one: Polynomial, places: np.ndarray) -> float:
    """The place up to which a side, extrapolated, is not dominated by itself."""
    left = 1.0 - np.sign(places[-1] - places[0]) * one.derivative(places)
    k = max(int(np.argmax(left <= 0.0)) if left.min() <= 0.0 else len(left) - 1, 1)
    share = np.clip(left[k - 1] / max(left[k - 1] - left[k], BETTER**2), 0.0, 1.0)
    return float(places[k - 1] + share * (places[k] - places[k - 1]))


def _at_point(run: _Run, known: _Run, i: int, smooth: float) -> tuple[float, list[_Run]]:
    """The same for a break at point i, whose slope may be one of several."""
    slopes, unsure = [], []
    for step in (-1, 1):
        near, far = i + step, i + 2 * step
        likely, rough = known.through(far, near, i, free=[i]), known.through(far, near)
        slopes.append(float(likely.derivative(known.s[i])))
        unsure.append(_apart(likely, [rough], *sorted((known.s[near], known.s[i]))))
    d, e = run.d[: i + 1].copy(), run.d[i:].copy()
    d[-1], e[0] = np.clip(slopes, -1.0, 1.0)
    return max(unsure) / smooth, [_Run(run.s[: i + 1], run.h[: i + 1], d, run.before), _Run(run.s[i:], run.h[i:], e, None, run.after)]


def _apart(one: Polynomial, others: Sequence[Polynomial], start: float, end: float) -> float:
    """The distances of a polynomial from others along its normal between two places, added up, and what solves leave."""
    places = np.linspace(start, end, 17)
    heights, normal = one(places), _normal(one.derivative(places))
    return BETTER + sum(float((normal * np.abs(heights - other(places))).max()) for other in others)


def _normal(slopes: np.ndarray) -> np.ndarray:
    """Distances along the normal, in ranges, for a height of one over a curve with these slopes."""
    return np.sqrt(2.0 / (1.0 + np.clip(slopes, -1.0, 1.0) ** 2))
