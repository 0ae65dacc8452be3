"""Where along a trajectory its rates, integrands, path constraints or peaks jump because a state or control crosses something."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from problems.compiled import CompiledPhase, remembered

from ..numerics.batched import Batched, expanded
from .limits import DENSE, NEGLIGIBLE_EXCESS, Course
from .trajectory import moment

UNTRUSTED = "the optimum is not to be trusted"
"""Words by which a jump is known in a point's note: no finer mesh cures it."""
SMALLEST_JUMP = 1e-4
"""Part of the largest value of a rate along the trajectory up to which it does not jump: `fabs`, `fmin`, `fmax` only have kinks."""


@dataclass(frozen=True)
class Jump:
    """A place where something jumps."""

    phase: str
    time: float
    time_unit: str
    expression: str  # expression, difference: What switches there, in the user's names, and what is 0 there (empty for a rounding)
    difference: str
    how: str  # "crosses", or "touches or slides along" where the difference is 0 without a change of sign

    def __str__(self) -> str:
        zero, junction = f"{self.difference} = 0, where {self.expression} switches", f", and {self.difference} = 0 where they meet"
        place = zero if self.difference else f"the switch of {self.expression}"
        when = f"phase '{self.phase}' has a jump at {moment(f'{self.time:.5g}', self.time_unit)}"
        return (
            f"{when}: it {self.how} {place}, no derivative shows that, and {UNTRUSTED}. State two linked phases, with the values of "
            f"both sides in place of {self.expression}, a path constraint that keeps each on its side"
            f"{junction if self.difference else ''}: phase.split does that for a comparison"
        )


def jumps(phase: CompiledPhase, course: Course) -> list[Jump]:
    """All jumps along one phase, in time."""
    switching = phase.switching
    if switching is None or not np.isfinite(course.values).all():
        return []
    line = _Line(phase, course)
    found = sorted(line.crossings() + line.touches())
    return [Jump(phase.name, time, phase.time_unit, switching.labels[i], switching.differences[i], how) for time, i, how in found]


class _Line:
    """The n samples of a phase one after the other, and what is between them: at an end of two elements only controls change."""

    def __init__(self, phase: CompiledPhase, course: Course) -> None:
        assert phase.switching is not None
        self.course, self.nx, self.both = course, len(phase.states), len(phase.states) + len(phase.controls)
        self._states, self._sides = _functions(phase)
        self.values, self.times = course.values[..., : self.both].reshape(-1, self.both), course.state.times(DENSE).ravel()
        self.sides, self.differences = self._switches(self.values, self.times)
        self.scales = np.maximum(np.abs(self._rows(self.values, self.times, self.sides)).max(axis=0), np.finfo(float).tiny)

    def crossings(self) -> list[tuple[float, int, str]]:
        """Time and switch wherever one switches and something jumps."""
        gap, switch = np.nonzero(self.sides[1:] != self.sides[:-1])
        if not len(gap):
            return []
        left, right, each = gap.astype(float), gap + 1.0, np.arange(len(gap))
        for _ in range(60):
            middle = 0.5 * (left + right)
            same = self._switches(*self._at(gap, middle))[0][each, switch] == self.sides[gap, switch]
            left, right = np.where(same, middle, left), np.where(same, right, middle)
        before, after = (self._switches(*self._at(gap, place))[0] for place in (left, right))
        return self._jumping(self._at(gap, right), before, after, switch, "crosses")

    def touches(self) -> list[tuple[float, int, str]]:
        """Time and switch where a difference is first 0 at a sample without a change of its sign, and something is another on the other
        side."""
        near, inside = np.abs(self.differences) <= NEGLIGIBLE_EXCESS * np.abs(self.differences).max(axis=0), self.sides[1:-1]
        place, switch = np.nonzero(near[1:-1] & (inside == self.sides[:-2]) & (inside == self.sides[2:]))
        switch, first = np.unique(switch, return_index=True)
        place = place[first] + 1
        sides = self.sides[place]
        far, each = sides.copy(), np.arange(len(place))
        far[each, switch] = np.where(sides[each, switch] == 1.0, 0.0, 1.0)  # the other side of a comparison; of a sign, another one
        return self._jumping((self.values[place], self.times[place]), sides, far, switch, "touches or slides along") if len(place) else []

    def _jumping(
        self, at: tuple[np.ndarray, np.ndarray], one: np.ndarray, other: np.ndarray, switch: np.ndarray, how: str
    ) -> list[tuple[float, int, str]]:
        """Times and switches (n,) of those places where something jumps between two sets of values of the switches (n, k)."""
        change = np.abs(self._rows(*at, one) - self._rows(*at, other)) / self.scales
        return [(float(at[1][i]), int(switch[i]), how) for i in np.flatnonzero((change > SMALLEST_JUMP).any(axis=1))]

    def _switches(self, values: np.ndarray, times: np.ndarray) -> list[np.ndarray]:
        """Values of the switches, and their differences, both (n, k)."""
        s = np.tile(self.course.s, (len(times), 1))
        return np.split(self._states(values[:, : self.nx], values[:, self.nx :], times, s)[0], 2, axis=1)

    def _rows(self, values: np.ndarray, times: np.ndarray, sides: np.ndarray) -> np.ndarray:
        """All rows that may jump (n, ...), with these values of the switches (n, k)."""
        s = np.tile(self.course.s, (len(times), 1))
        return self._sides(values[:, : self.nx], values[:, self.nx :], times, s, sides)[0]

    def _at(self, gap: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States and controls (n, nx + nu), and times (n,), at places (n,) between samples `gap` (n,), of which these are numbers, and the
        next ones."""
        element, place, share = gap // len(DENSE), gap % len(DENSE), places - gap
        after = np.minimum(place + 1, len(DENSE) - 1)
        curved = self.course.at(element, (DENSE[place] + share * (DENSE[after] - DENSE[place]))[:, None], self.both)[:, 0]
        straight = self.values[gap] + share[:, None] * (self.values[gap + 1] - self.values[gap])
        times = self.times[gap] + share * (self.times[gap + 1] - self.times[gap])
        return np.where((after > place)[:, None], curved, straight), times


@remembered
def _functions(phase: CompiledPhase) -> tuple[Batched, Batched]:
    assert phase.switching is not None
    return Batched(expanded(phase.switching.states)), Batched(expanded(phase.switching.sides))
