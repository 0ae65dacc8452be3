"""A space manoeuvre vehicle's skip over a turning planet: flight time, heat load, terminal speed and terminal mass.

Chai, Savvaris, Tsourdos and Xia, "An interactive fuzzy physical programming for solving multiobjective skip entry problem", IEEE
Transactions on Aerospace and Electronic Systems 53(5), 2017, eqs. (2)-(13) and Table I: ten states, since angle of attack, bank angle and
thrust follow their commands with a lag.

Three terms of the turning planet in eq. (2) are misprinted and are as derived here (`winged`): the rate of the speed has the sine of the
latitude in place of that of the heading, those of the flight-path angle and of the heading are over the speed (without, the former is 2
degrees a second). The sign of the exponent of the density in eq. (3) is a slip.

Beginning, end and bounds are in a reference that is not at hand; they are those of the same authors' other skip entry (`skip`), with the
speed at most the initial one. The lowest altitude is chosen as 50 km: there the limit of the dynamic pressure allows 4643 m/s, so that a
flight that saves propellant leaves the air again not much faster than the speed to which the paper aspires, 4016 m/s. Chosen as well: the
gravitational parameter, the scale height, the constant of the heating rate (Betts'; the coefficients of Table I are his, for radians), a
specific impulse of 300 s, and 0.2 1/s for the gains of all three lags.
"""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from ...problem import Problem
from ..flight_figures import track
from ..reentry.statement import SHUTTLE, guess
from ..winged import FOOT, SLUG, Winged
from .statement import ASCENT, COMMANDED, DESCENT, START, Mission, plot, skip_entry

__all__ = ["plot", "problem", "reference", "track"]

reference_name = "the front that gradients found"

HEATING = 200.0
"""Btu/ft2/s."""
LOWEST, IMPULSE, GAIN = 50e3, 300.0, 0.2
DURATIONS = {DESCENT: (20.0, 1500.0), ASCENT: (20.0, 600.0)}
"""s; chosen: room for several skips on the way down. The ends of the front that were found are well within."""
TURNING = 7.2921151e-5
TABLE = (1.067, -1.101, 0.6988, -0.1903)
"""Of Table I, for powers of the angle of attack in rad."""
VEHICLE = Winged(
    radius=6378135.0,
    mu=3.986004418e14,
    density=0.002378 * SLUG / FOOT**3,
    scale_height=7254.24,
    area=2690.0 * FOOT**2,
    lift=(-0.2070, 1.676),
    drag=(0.07854, -0.3529, 2.040),
    heating=tuple(value / degrees(1.0) ** power for power, value in enumerate(TABLE)),
    heating_constant=SHUTTLE.heating_constant,
    turning=TURNING,
)
ATTACK = """-10 -10 -10 -10 -10 -10 -10 -10 -10 -10 -10 30 30 30 30 30 30 29.6 29.1 29.4 30 30 30 -10
 -2.8 -1.3 27.8 30 29.4 28.5 28.4 28.4 28.6 28.9 29.2 29.6 29.9 30 30 30 30 30 30 29.5 28.9 28 26.8 25.7 26.3"""
BANK = """51.7 1.5 -0.7 0.4 -0.2 0.5 -0.7 2.2 -5 13.3 -29.7 -80 -80 -80 -80 -74.6 -80 -80 -80 -80 -80 -80 -80 -67.3
 63.2 -80 -80 -80 -80 -80 -80 -80 -80 -80 -80 -80 -80 -80 -80 -80 -80 -80 -76.7 -80 -80 -80 -80 -33 62"""
NOMINAL: dict[str, tuple[float, Any, Any, Any]] = {
    DESCENT: (375.5, np.radians(np.array(ATTACK.split(), float)), np.radians(np.array(BANK.split(), float)), [0.0, 0.0]),
    ASCENT: (70.0, np.radians([27, 30, 30, 30]), np.radians([0, 0]), [1e6, 1e6]),
}
"""Duration, s, and commands at equal steps of it, rad and N: down without lift, two turns to the left within all limits, and up with half
the thrust. The descent is that of a fast flight by multiple shooting, 2 % inside its limits, in tenths of a degree."""
MESHES = {
    DESCENT: {"edges": np.linspace(0.0, 1.0, 49).tolist(), "order": 3},
    ASCENT: {"edges": [*np.linspace(0.0, 0.4, 21), *np.linspace(0.4, 1.0, 7)[1:]], "order": 3},
}
"""Elements of some 9 s on the way down, twice the lag: on fewer, the angle of attack cannot be switched within seconds, and long flights
gain mass by the errors of the mesh. Shorter ones after the lowest point, where the engine burns for a moment."""


def problem(
    *,
    impulse: float = IMPULSE,
    lag_gain: float = GAIN,
    lowest: float = LOWEST,
    fastest: float = START["speed"],
    mass: float = START["mass"],
) -> Problem:
    """The case.

    Parameters
    ----------
    impulse : float
        Specific impulse, s.
    lag_gain : float
        Of the lags of angle of attack, bank angle and thrust, 1/s.
    lowest : float
        Altitude at which the descent ends, m.
    fastest : float
        Bound of the speed, m/s.
    mass : float
        At the beginning, kg.
    """
    lags = dict.fromkeys(COMMANDED, lag_gain)
    problem, heating = skip_entry("smv", Mission(VEHICLE, lowest, HEATING, impulse, lags, fastest, mass, DURATIONS))
    descent, ascent = problem.phases[DESCENT], problem.phases[ASCENT]
    problem.minimize("flight time", ascent.tf, unit="s")
    load = descent.integral(heating[DESCENT]) + ascent.integral(heating[ASCENT])
    problem.minimize("heat load", 1e-3 * load, unit="kBtu/ft2")
    problem.maximize("terminal speed", ascent.final(ascent["speed"]), unit="m/s")
    problem.maximize("terminal mass", ascent.final(ascent["mass"]), unit="kg")

    state, begin = START | COMMANDED | {"mass": mass}, 0.0
    for phase in (descent, ascent):
        duration, *laws = NOMINAL[phase.name]
        state = guess(phase, state, begin + duration, dict(zip([f"{control} command" for control in COMMANDED], laws, strict=True)), begin)
        begin += duration
        phase.guess(tf=begin)
    # A candidate is propagated only, as it takes seconds to make one feasible.
    problem.default_transcription = {
        "method": "DFET",
        "settings": {"elements": 48, "order": 3, "control_order": 1, "basis": "bernstein", "mesh": MESHES},
    }
    problem.default_evaluations = 2_000
    problem.default_inner, problem.default_start = "propagate", "smooth"
    return problem


def reference() -> np.ndarray:
    """The front (k, 4): flight time, s, heat load, kBtu/ft2, terminal speed, m/s, and terminal mass, kg; how it was found is in the file.
    `python tests/truths/skip_entry.py smv` makes one by gradients alone."""
    return np.loadtxt(Path(__file__).with_name("smv.csv"), delimiter=",", ndmin=2)
