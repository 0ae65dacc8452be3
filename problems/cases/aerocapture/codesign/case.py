"""Shape and bank profile in one search: how compact the capsule is, its heat shield, and the burn at the apoapsis.

Beyond Armellin and Lavagna (see `mars`), who choose the shape for a constant bank first and its bank profile afterwards. Parameters are the
five variables of `coupled`, within the same bounds; its limits of lift over drag and of the length hold here. Within the bounds no rear
cone is lit: its half angle is at least 30 deg, the largest angle of attack. The flight is that of `bank`.

Lift over drag is at least 0.3, of this sign alone. Its sign changes with that of the angle of attack, so that a capsule of the other sign
is the mirror image of one of these, rolled by half a turn: with banks from 0 to 180 deg all shapes are reached, slender ones at positive
and blunt ones at negative angles of attack. The limit is then a smooth one.

The greatest of length and diameter is a parameter that is not below either: as good where it is minimised, and without a kink.
"""

from __future__ import annotations

from math import radians

import numpy as np

from .... import checks
from ....problem import Problem
from ..aerodynamics import ballistic_coefficient, lift_and_drag
from ..bank import BANK_RATE, DECLINATION, STEEPEST, TRANSCRIPTION, flight, guess
from ..coupled import PACKING, SHIELD, VARIABLES
from ..designs import BOUNDS, LENGTH, LIFT_TO_DRAG, judged
from ..figures import plot, track
from ..heating import shield_fraction
from ..mars import circularisation, exit_angle, exit_speed
from ..printed import TABLE_2
from ..shape import VOLUME, sized
from .corridor import BALLISTIC, width

__all__ = ["plot", "problem", "track"]

DELTA_V, CORRIDOR = "delta v", "entry corridor"
SIZE, SIZES = "greatest dimension", (2.0, 6.0)
"""Its bounds, m: a sphere of the volume has a diameter of 2.12 m."""
LOAD = 60.0
"""Greatest heat load, kJ/cm2: that of a heat shield of 88 % of the mass."""
STATED = 2
"""Solution of Table 2 whose passage is the guess of the flight where no shape is."""


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
        Whether the width of the entry corridor, see `corridor.width`, is a fourth objective, which is maximised.
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
        problem.maximize(CORRIDOR, width(ballistic, lift / drag), unit="deg")
    design = np.array([TABLE_2[shape or STATED].design])
    design[:, -1] *= np.sign(judged(design).lift_to_drag)
    start = judged(design)
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
