"""Where along a trajectory its rates, integrands, path constraints or peaks jump because a state or control crosses something.

No derivative shows such a jump, and no simulation contradicts it: what a gradient solver takes for an optimum need not be one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from problems.compiled import CompiledPhase, remembered

from ..numerics.batched import Batched, expanded
from .limits import DENSE, Course

UNTRUSTED = "the optimum is not to be trusted"
"""Words by which a jump is known in a point's note: no finer mesh cures it."""
SMALLEST_JUMP = 1e-4
"""Part of the largest value of a rate along the trajectory up to which it does not jump: `fabs`, `fmin`, `fmax` only have kinks."""
TOUCHES = 1e-6
"""Part of its largest value along the trajectory up to which the difference of a comparison counts as 0."""
BISECTIONS = 48


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
        where = f"phase '{self.phase}' has a jump at t = {self.time:.5g} {self.time_unit}".rstrip()
        place, end = f"it {self.how} the switch of {self.expression}", ""
        if self.difference:
            place, end = (
                f"it {self.how} {self.difference} = 0, where {self.expression} switches",
                f", and {self.difference} = 0 where they meet",
            )
        return (
            f"{where}: {place}, no derivative shows that, and {UNTRUSTED}. State two linked phases, with the values of both sides "
            f"in place of {self.expression}, a path constraint that keeps each on its side{end}"
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
        self.course, self.count = course, len(phase.switching.labels)
        self.nx, self.nu = len(phase.states), len(phase.controls)
        self._states, self._sides = _functions(phase)
        values = course.values[..., : self.nx + self.nu].reshape(-1, self.nx + self.nu)
        self.values, self.times = values, course.state.times(DENSE).ravel()
        self.changing, self.sides, self.differences = self.switches(values, self.times)
        self.scales = np.maximum(np.abs(self._rows(values, self.times, self.sides)).max(axis=0), np.finfo(float).tiny)

    def switches(self, values: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers that change at switches, values of the switches, and differences, each (n, k)."""
        (found,) = self._states(values[:, : self.nx], values[:, self.nx :], times, np.tile(self.course.s, (len(times), 1)))
        changing, sides, differences = np.split(found, 3, axis=1)
        return changing, sides, differences

    def crossings(self) -> list[tuple[float, int, str]]:
        """Time and switch wherever one switches and something jumps."""
        gap, switch = np.nonzero(self.changing[1:] != self.changing[:-1])
        if not len(gap):
            return []
        left, right, each = np.zeros(len(gap)), np.ones(len(gap)), np.arange(len(gap))
        for _ in range(BISECTIONS):
            middle = 0.5 * (left + right)
            before = self.switches(*self._between(gap, middle))[0][each, switch] == self.changing[gap, switch]
            left, right = np.where(before, middle, left), np.where(before, right, middle)
        sides = [self.switches(*self._between(gap, side))[1] for side in (left, right)]
        values, times = self._between(gap, right)
        jump = self._jumps(values, times, *sides)
        return [(float(times[i]), int(switch[i]), "crosses") for i in np.flatnonzero(jump)]

    def touches(self) -> list[tuple[float, int, str]]:
        """Time and switch wherever a difference is nearly 0 without a change of its sign, and something is another on the other side."""
        size = np.abs(self.differences)
        same = self.changing[1:-1] == self.changing[:-2]
        same &= self.changing[1:-1] == self.changing[2:]
        least = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:]) & same
        least &= size[1:-1] <= 0.1 * size.max(axis=0)
        place, switch = np.nonzero(least)
        place += 1
        if not len(place):
            return []
        each, share = np.arange(len(place)), np.linspace(0.0, 1.0, 33)
        best, values, times = size[place, switch], self.values[place], self.times[place]
        for gap in (place - 1, place):
            left, right = np.zeros(len(gap)), np.ones(len(gap))
            for _ in range(3):
                theta = left[:, None] + share * (right - left)[:, None]
                at = [self._between(gap, theta[:, i]) for i in range(len(share))]
                found = np.array([np.abs(self.switches(*one)[2])[each, switch] for one in at])
                k = found.argmin(axis=0)
                better = found[k, each] < best
                values = np.where(better[:, None], np.array([one[0] for one in at])[k, each], values)
                times, best = np.where(better, np.array([one[1] for one in at])[k, each], times), np.minimum(best, found[k, each])
                left, right = theta[each, np.maximum(k - 1, 0)], theta[each, np.minimum(k + 1, len(share) - 1)]
        sides = self.switches(values, times)[1]
        other = sides.copy()
        now = sides[each, switch]
        # The other side of a comparison, 0 or 1, and of a sign, -1 or 1.
        other[each, switch] = np.where(now == 0.0, 1.0, np.where(self.sides.min(axis=0)[switch] < 0.0, -now, 0.0))
        near = best <= TOUCHES * np.maximum(size.max(axis=0)[switch], np.finfo(float).tiny)
        jump = near & self._jumps(values, times, other, sides)
        first: dict[int, float] = {}
        for i in np.flatnonzero(jump):
            first.setdefault(int(switch[i]), float(times[i]))
        return [(time, switch, "touches or slides along") for switch, time in first.items()]

    def _jumps(self, values: np.ndarray, times: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Mask (n,) where rows with two sets of switches (n, k) differ."""
        change = np.abs(self._rows(values, times, one) - self._rows(values, times, other)) / self.scales
        return np.asarray((change > SMALLEST_JUMP).any(axis=1))

    def _rows(self, values: np.ndarray, times: np.ndarray, sides: np.ndarray) -> np.ndarray:
        """All rows that may jump (n, ...), with these values of the switches (n, k)."""
        s = np.tile(self.course.s, (len(times), 1))
        return self._sides(values[:, : self.nx], values[:, self.nx :], times, s, sides)[0]

    def _between(self, gap: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States and controls (n, nx + nu), and times (n,), at shares (n,) of the way from samples `gap` (n,) to the next ones."""
        element, place = gap // len(DENSE), gap % len(DENSE)
        inside = place < len(DENSE) - 1
        after = np.minimum(place + 1, len(DENSE) - 1)
        tau = DENSE[place] + share * (DENSE[after] - DENSE[place])
        curved = self.course.at(element, tau[:, None], self.nx + self.nu)[:, 0]
        straight = self.values[gap] + share[:, None] * (self.values[gap + 1] - self.values[gap])
        times = self.times[gap] + share * (self.times[gap + 1] - self.times[gap])
        return np.where(inside[:, None], curved, straight), times


@remembered
def _functions(phase: CompiledPhase) -> tuple[Batched, Batched]:
    assert phase.switching is not None
    return Batched(expanded(phase.switching.states)), Batched(expanded(phase.switching.sides))
