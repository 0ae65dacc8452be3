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
end lower, whatever the bank. The shallowest is the same with all the lift downward: shallower ones end higher. Both are passages in the
equations of `passage` with a given lift; the ballistic coefficient and lift over drag decide them alone. The width is a polynomial of the
logarithm of the former and of the latter, so that it can be an objective. Passages agree with it to 0.002 deg, and to 0.012 deg near a lift
over drag of 0.9.
"""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from ... import checks
from ...problem import Problem
from .bank import BANK_RATE, DECLINATION, STEEPEST, TRANSCRIPTION, flight, guess, plot
from .capsule import VOLUME, ballistic_coefficient, lift_and_drag, log, sized
from .coupled import PACKING, SHIELD, VARIABLES
from .designs import BOUNDS, LENGTH, LIFT_TO_DRAG, TABLE_2, assess
from .mars import circularisation, exit_angle, exit_speed, shield_fraction

__all__ = ["plot", "problem"]

DELTA_V, CORRIDOR = "delta v", "entry corridor"
SIZE, SIZES = "greatest dimension", (2.0, 6.0)
"""Its bounds, m: a sphere of the volume has a diameter of 2.12 m."""
LOAD = 60.0
"""Greatest heat load, kJ/cm2: that of a heat shield of 88 % of the mass."""
STATED = 2
"""Solution of Table 2 whose passage is the guess of the flight where no shape is."""
BALLISTIC, RATIO = (40.0, 1200.0), (0.3, 0.9)
"""Ranges of the polynomial, kg/m2 and 1: those of all capsules of `designs.BOUNDS` that have at least the lift."""


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
    series = np.loadtxt(Path(__file__).with_name("corridor.csv"), delimiter=",")
    rows, columns = (_chebyshev(place, count) for place, count in zip(places, series.shape, strict=True))
    return sum(
        row * sum(float(c) * column for c, column in zip(line, columns, strict=True)) for line, row in zip(series, rows, strict=True)
    )


def _chebyshev(x: Any, count: int) -> list[Any]:
    """The first Chebyshev polynomials."""
    found = [1.0 + 0.0 * x, x]
    for _ in range(count - 2):
        found.append(2.0 * x * found[-1] - found[-2])
    return found
