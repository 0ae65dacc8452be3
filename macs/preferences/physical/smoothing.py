"""Fuzzy preference functions: the mean of a preference function under a truncated Gaussian (eqs. 34 and 35 of Chai and others 2017).

The quadrature is that of Gauss and Legendre on each piece of the function, so that none goes over a jump of the second derivative. Where
the function is above 1e-200, its relative error is below 1e-11, of the printed form below 1e-8: the tests compare it with adaptive
quadrature.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from ..operands import NUMERIC, clipped, exp, greatest, least
from ..stage import Operand
from .spline import Ideal, PreferenceFunction

WIDTH = 3.0
"""The Gaussian is cut off at so many spreads."""
MASS = math.sqrt(math.pi) * math.erf(WIDTH)
"""Its integral, in spreads."""
NODES = 20
"""Nodes on each panel."""
FALL = 36.0
"""Where the exponent of the weight has fallen by this, the rest is left out: 2e-16 of the greatest weight."""
DEEP, PANEL = 60.0, 12.0
"""Depth of the ideal side, in lengths by which it falls by a factor e, below which its rest is left out; depth of one panel of nodes."""


@dataclass(frozen=True)
class FuzzyFunction:
    """A preference function with fuzzy boundaries: its mean over [J - 3 spread, J + 3 spread] under a Gaussian exp(-(t / spread)^2)."""

    crisp: PreferenceFunction
    spread: float  # in the objective's unit
    # Whether the Gaussian is centred at the boundary that is nearest to J, as eq. (35) is printed, instead of J. That function jumps
    # half-way between boundaries.
    printed: bool = False

    def __call__(self, J: Operand) -> Operand:
        """The fuzzy preference of values J, for numbers, arrays and symbols."""
        # The weight is exp(-(u + shift)^2) over u = (t - J) / spread; where the shift is large, only its greatest part counts.
        shift = self._shift(J) if self.printed else 0.0
        beyond = greatest(abs(shift) - WIDTH, 0.0)
        reach = (beyond * beyond + FALL) ** 0.5
        low, high = greatest(-shift - reach, -WIDTH), least(reach - shift, WIDTH)

        def weight(u: Operand) -> Operand:
            return exp(least(beyond * beyond - (u + shift) * (u + shift), 0.0))

        total = 0.0
        for piece in self.crisp.pieces:
            begin = clipped(J + self.spread * low, piece.lower, piece.upper)
            end = clipped(J + self.spread * high, piece.lower, piece.upper)
            panels = 1
            if isinstance(piece.formula, Ideal):
                steepness = piece.formula.steepness
                depth = DEEP / steepness
                begin, end = (greatest(begin, end - depth), end) if math.isinf(piece.lower) else (begin, least(end, begin + depth))
                panels += int(min(DEEP, 2.0 * WIDTH * self.spread * steepness) / PANEL)

            def mass(place: Any, begin: Operand = begin, end: Operand = end, formula: Any = piece.formula) -> Operand:
                t = begin + (end - begin) * place
                return weight((t - J) / self.spread) * formula(t)

            total = total + (end - begin) / self.spread * _mean(mass, panels, J)
        if not self.printed:
            return total / MASS
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
    x, w = np.polynomial.legendre.leggauss(NODES)
    return ((np.arange(panels)[:, None] + 0.5 + 0.5 * x) / panels).ravel(), np.tile(0.5 * w / panels, panels)
