"""Width of the entry corridor: the range of path angles at the entry from which a capsule can be captured at the orbit that is wanted.

The steepest is that from which the passage with all the lift upward ends on an ellipse whose apoapsis is on the target orbit: steeper ones
end lower, whatever the bank. The shallowest is the same with all the lift downward: shallower ones end higher. Speed and path angle at the
exit are free but for the apoapsis. Both are passages of `passage` with a given lift; its ballistic coefficient and lift over drag decide
them alone. As there, the path is followed from the exit, where it is known but for the path angle: what is at the entry is then smooth in
that angle, without the cliffs between crash and escape that are met from the entry on.

The width is a polynomial of the logarithm of the ballistic coefficient and of lift over drag, so that it can be an objective; it agrees
with passages followed from the entry to 0.002 deg: `tests/problems/aerocapture/test_codesign.py`.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from transcription.numerics.polynomials import nodes

from ..elementary import log
from ..mars import MARS
from ..passage import PASSAGE, Passage, slopes

BALLISTIC, LIFT_TO_DRAG = (40.0, 1200.0), (0.3, 0.9)
"""Ranges of the polynomial, kg/m2 and 1: those of all capsules of `designs.BOUNDS` that have at least the lift."""
DEGREES = 5, 9
"""Of the polynomial in either."""
STEP = 0.12
"""Of the arc."""
EXIT_ANGLES = 1e-3, 0.9
"""Bracket of the path angle at the exit, rad."""
SEARCH, TOLERANCE = 60, 1e-8
"""Most steps of the search in that bracket, and the x at the entry, twice the logarithm of a ratio of speeds, at which it ends."""
ROUNDING = 1e-15
"""Width of the bracket, as a share, at which it ends, too: heavy capsules that fly far with much lift downward amplify rounding."""


def width(ballistic: Any, lift_to_drag: Any) -> Any:
    """Width of the corridor, deg: of numbers, arrays or expressions within `BALLISTIC` and `LIFT_TO_DRAG`."""
    (low, high), (least, most) = np.log(BALLISTIC), LIFT_TO_DRAG
    places = (2.0 * log(ballistic) - low - high) / (high - low), (2.0 * lift_to_drag - least - most) / (most - least)
    rows, columns = (_chebyshev(place, degree) for place, degree in zip(places, DEGREES, strict=True))
    return sum(
        row * sum(float(c) * column for c, column in zip(line, columns, strict=True)) for line, row in zip(_series(), rows, strict=True)
    )


def boundary(ballistic: np.ndarray, lift: np.ndarray, passage: Passage = PASSAGE) -> np.ndarray:
    """Path angle (n,), rad, at the entry, from which constant lift over drag that points upward (n,) leads to the target orbit.

    Raises
    ------
    RuntimeError
        There is none within `EXIT_ANGLES` for a row.
    """
    ballistic, lift = np.broadcast_arrays(np.asarray(ballistic, float), np.asarray(lift, float))
    low, high = (np.full(lift.shape, angle) for angle in EXIT_ANGLES)
    below, above = (_entry(angle, ballistic, lift, passage)[0] for angle in (low, high))
    if (below * above >= 0.0).any():
        row = int(np.flatnonzero(below * above >= 0.0)[0])
        raise RuntimeError(f"no corridor boundary for {ballistic[row]:g} kg/m2 and a lift over drag of {lift[row]:g}")
    found, active = np.full(lift.shape, np.nan), np.arange(len(lift))
    # The Illinois variant of false position, every third time bisection: with the lift downward there is a bend next to the root.
    for i in range(SEARCH):
        middle = 0.5 * (low + high) if i % 3 == 2 else (low * above - high * below) / (above - below)
        value, found[active] = _entry(middle, ballistic[active], lift[active], passage)
        same = np.sign(value) == np.sign(above)
        below, above = np.where(same, 0.5 * below, above), value
        low, high = np.where(same, low, high), middle
        left = (np.abs(value) >= TOLERANCE) & (np.abs(high - low) >= ROUNDING * high)
        active, low, high, below, above = active[left], low[left], high[left], below[left], above[left]
        if not len(active):
            return found
    raise RuntimeError(f"no corridor boundary found in {SEARCH} steps")


def _entry(exit_angle: np.ndarray, ballistic: np.ndarray, lift: np.ndarray, passage: Passage) -> tuple[np.ndarray, np.ndarray]:
    """x, which vanishes for the entry speed, and path angle at the entry, for path angles at the exit."""
    ratio = MARS.entry_radius / MARS.target_radius
    squared = 2.0 * MARS.mu * (1.0 / MARS.entry_radius - 1.0 / MARS.target_radius) / (1.0 - (ratio * np.cos(exit_angle)) ** 2)
    Y = np.stack([np.zeros_like(exit_angle), np.log(passage.entry_speed**2 / squared), exit_angle], axis=-1)
    eps, end = passage.drag(ballistic), np.full((len(ballistic), 2), np.nan)
    active = np.arange(len(Y))

    def rate(y: np.ndarray) -> np.ndarray:
        return slopes(y, lift[active], eps[active], passage)

    while len(active):
        y = Y[active]
        moved = _step(y, STEP, rate)
        out = moved[:, 0] < 0.0
        if out.any():
            # The last step is one of z, to the interface.
            at, active = active, active[out]

            def by_height(y: np.ndarray) -> np.ndarray:
                slope = rate(y)
                return slope / slope[:, :1]

            end[active] = _step(y[out], -y[out, :1], by_height)[:, 1:]
            active = at
        # Far beyond the entry speed: no entry, but the sign is known.
        fast = moved[:, 1] < -1.0
        end[active[fast]] = -1.0
        Y[active] = moved
        active = active[~(out | fast)]
    return end[:, 0], end[:, 1]


def _step(y: np.ndarray, size: Any, rate: Any) -> np.ndarray:
    """One step of the classical Runge-Kutta method."""
    first = rate(y)
    second = rate(y + 0.5 * size * first)
    third = rate(y + 0.5 * size * second)
    return y + size / 6.0 * (first + 2.0 * second + 2.0 * third + rate(y + size * third))


@cache
def _series() -> np.ndarray:
    """Coefficients of the width in Chebyshev polynomials, from its values at Chebyshev nodes."""
    places = [nodes("chebyshev", degree) for degree in DEGREES]
    (low, high), (least, most) = np.log(BALLISTIC), LIFT_TO_DRAG
    ballistic = np.exp(low + 0.5 * (high - low) * (1.0 + places[0]))
    ratio = least + 0.5 * (most - least) * (1.0 + places[1])
    first, second = (grid.ravel() for grid in np.meshgrid(ballistic, ratio, indexing="ij"))
    angles = np.degrees(boundary(np.concatenate([first, first]), np.concatenate([-second, second])))
    values = (angles[: len(first)] - angles[len(first) :]).reshape(len(ballistic), len(ratio))
    left, right = (np.linalg.inv(np.polynomial.chebyshev.chebvander(place, degree)) for place, degree in zip(places, DEGREES, strict=True))
    return np.asarray(left @ values @ right.T)


def _chebyshev(x: Any, degree: int) -> list[Any]:
    """Chebyshev polynomials up to a degree."""
    found = [1.0 + 0.0 * x, x]
    for _ in range(degree - 1):
        found.append(2.0 * x * found[-1] - found[-2])
    return found
