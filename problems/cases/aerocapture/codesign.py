"""Shape and bank profile in one search: how compact the capsule is, its heat shield, and the burn at the apoapsis.

Beyond Armellin and Lavagna (see `mars`), who choose the shape for a constant bank first and its bank profile afterwards. Parameters are the
five variables of `coupled`, within the same bounds; its limits of lift over drag and of the length hold here. Within the bounds no rear
cone is lit: its half angle is at least 30 deg, the largest angle of attack. The flight is that of `bank`.

Lift over drag is at least 0.3, of this sign alone. Its sign changes with that of the angle of attack, so that a capsule of the other sign
is the mirror image of one of these, rolled by half a turn: with banks from 0 to 180 deg all shapes are reached, slender ones at positive
and blunt ones at negative angles of attack. The limit is then a smooth one.

The greatest of length and diameter is a parameter that is not below either: as good where it is minimised, and without a kink.

The width of the entry corridor is the range of path angles at the entry from which a capsule can be captured at the orbit that is wanted.

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
from math import radians
from typing import Any

import numpy as np

from transcription.numerics.polynomials import nodes

from ... import checks
from ...problem import Problem
from ..flight_figures import track
from .bank import BANK_RATE, DECLINATION, STEEPEST, TRANSCRIPTION, flight, guess, plot
from .capsule import VOLUME, ballistic_coefficient, lift_and_drag, log, sized
from .coupled import PACKING, SHIELD, VARIABLES
from .designs import BOUNDS, LENGTH, LIFT_TO_DRAG, TABLE_2, assess
from .mars import MARS, circularisation, exit_angle, exit_speed, shield_fraction
from .passage import PASSAGE, Passage, slopes

__all__ = ["plot", "problem", "track"]

DELTA_V, CORRIDOR = "delta v", "entry corridor"
SIZE, SIZES = "greatest dimension", (2.0, 6.0)
"""Its bounds, m: a sphere of the volume has a diameter of 2.12 m."""
LOAD = 60.0
"""Greatest heat load, kJ/cm2: that of a heat shield of 88 % of the mass."""
STATED = 2
"""Solution of Table 2 whose passage is the guess of the flight where no shape is."""
BALLISTIC, RATIO = (40.0, 1200.0), (0.3, 0.9)
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


def problem(
    *,
    corridor: bool = False,
    shape: int | None = None,
    delta_v: float | None = None,
    declination: float = DECLINATION,
    bank_rate: float = BANK_RATE,
) -> Problem:
    """The case.

    Parameters
    ----------
    corridor : bool
        Whether the width of the entry corridor, see `corridor_width`, is a fourth objective, which is maximised.
    shape : int, optional
        Number of the solution of Table 2, or the mirror image of it, from which to start. Without one the flight begins with the passage of
        the second, and the shape has no guess: searches draw it from the whole range.
    delta_v : float, optional
        Largest delta v, m/s, up to that of the steepest exit, 100 m/s, which is the default: with a lower one, fronts are denser where the
        burn is small.
    declination, bank_rate : float
        As in `bank.problem`.
    """
    if shape is not None and (isinstance(shape, bool) or shape not in TABLE_2):
        raise ValueError(f"aerocapture_codesign: there is no solution {shape!r} of Table 2; there are {', '.join(map(str, TABLE_2))}")
    if not isinstance(corridor, bool):
        raise ValueError(f"aerocapture_codesign: corridor is True or False, not {corridor!r}")
    steepest = STEEPEST if delta_v is None else _steepest(delta_v)
    problem = Problem("aerocapture_codesign")
    ratios = [problem.parameter(name, bounds=bounds, unit=unit) for (name, unit), bounds in zip(VARIABLES, BOUNDS, strict=True)]
    front, rear, attack = (radians(1.0) * angle for angle in ratios[2:])
    capsule = sized(ratios[0], ratios[1], front, rear)
    lift, drag = lift_and_drag(capsule, attack)
    size = problem.parameter(SIZE, bounds=SIZES, unit="m")
    problem.constraint("diameter", size - 2.0 * capsule.base, lower=0.0, unit="m")
    problem.constraint("whole length", size - capsule.length, lower=0.0, unit="m")
    problem.constraint("lift over drag", lift / drag, lower=LIFT_TO_DRAG)
    problem.constraint("length", capsule.length, lower=LENGTH, unit="m")
    limits = {"most": LOAD, "declination": declination, "bank_rate": bank_rate, "steepest": steepest}
    ends, load = flight(problem, lift * capsule.area, drag * capsule.area, capsule.nose, **limits)
    problem.minimize(PACKING, size / VOLUME, unit="1/m2")
    problem.minimize(SHIELD, shield_fraction(1e3 * load), unit="%")
    problem.minimize(DELTA_V, circularisation(ends["speed"]), unit="m/s")
    if corridor:
        ballistic = ballistic_coefficient(capsule, drag)
        problem.constraint("ballistic coefficient", ballistic, lower=BALLISTIC[0], upper=BALLISTIC[1], unit="kg/m2")
        problem.maximize(CORRIDOR, corridor_width(ballistic, lift / drag), unit="deg")
    design = np.array([TABLE_2[shape or STATED].design])
    design[:, -1] *= np.sign(assess(design).lift_to_drag)
    start = assess(design)
    if shape is not None:
        problem.guess(**dict(zip((name for name, _ in VARIABLES), map(float, design[0]), strict=True)))
        problem.guess(**{SIZE: float(start.packing[0]) * VOLUME})
    guess(problem, start, TABLE_2[shape or STATED].nose, LOAD, declination)
    problem.default_transcription = TRANSCRIPTION
    problem.default_evaluations, problem.default_inner, problem.default_start = 1_000, "propagate", "smooth"
    return problem


def _steepest(delta_v: float) -> float:
    """The path angle at the exit, rad, after which the burn takes a delta v, m/s."""
    what = "aerocapture_codesign: delta_v"
    try:
        angle = exit_angle(exit_speed(checks.number(delta_v, "the limit")))
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from error
    if angle > STEEPEST:
        raise ValueError(f"{what}: after an exit of at most {STEEPEST:g} rad no burn takes {delta_v:g} m/s")
    return angle


def corridor_width(ballistic: Any, lift_to_drag: Any) -> Any:
    """Width of the corridor, deg: of numbers, arrays or expressions within `BALLISTIC` and `RATIO`."""
    (low, high), (least, most) = np.log(BALLISTIC), RATIO
    places = (2.0 * log(ballistic) - low - high) / (high - low), (2.0 * lift_to_drag - least - most) / (most - least)
    rows, columns = (_chebyshev(place, degree) for place, degree in zip(places, DEGREES, strict=True))
    return sum(
        row * sum(float(c) * column for c, column in zip(line, columns, strict=True)) for line, row in zip(_series(), rows, strict=True)
    )


def boundary(ballistic: np.ndarray, lift: np.ndarray, passage: Passage = PASSAGE) -> np.ndarray:
    """Path angle (n,), rad, at the entry, from which constant lift over drag that points upward (n,) leads to the target orbit.

    Raises RuntimeError: there is none within `EXIT_ANGLES` for a row.
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
    (low, high), (least, most) = np.log(BALLISTIC), RATIO
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
