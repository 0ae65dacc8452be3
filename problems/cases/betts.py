"""Re-entry of a shuttle with the greatest cross-range: one objective, and an optimum that is known to six digits.

Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear Programming", SIAM 2010, section 6.1: angle of attack and bank
angle are the controls, the final time is free. The vehicle and the air are those of `reentry`.
"""

from __future__ import annotations

from math import degrees, radians

import numpy as np

from ..problem import Problem
from .reentry.nominal import ATTACK, BANK, guess
from .reentry.statement import ANGLES, END, START, declare
from .reentry.vehicle import MASS, SHUTTLE
from .winged import STATES

BOUNDS = {"angle of attack": (radians(-90.0), radians(90.0)), "bank angle": (radians(-89.0), radians(1.0))}
FINAL_GUESS = 2000.0
CROSS_RANGE, FINAL_TIME = 34.1412, 2008.59
"""Of the optimum, in degrees and seconds."""


def problem() -> Problem:
    """Whatever the heat."""
    return betts("betts")


def reference() -> np.ndarray:
    """The optimal cross-range in degrees, shape (1, 1)."""
    return np.array([[CROSS_RANGE]])


def betts(name: str, heating_rate: float | None = None) -> Problem:
    """State it, with a limit to the heating rate, Btu/ft2/s, or none."""
    problem = Problem(name)
    phase = problem.phase("entry", t0=0.0, tf=(500.0, 4000.0))
    states = declare(phase, {state: START[state] for state in STATES}, END)
    attack, bank = (phase.control(angle, bounds=BOUNDS[angle], unit="rad") for angle in ANGLES)
    phase.dynamics(**SHUTTLE.rates(states, attack, bank, MASS))
    if heating_rate is not None:
        heating = SHUTTLE.heating_rate(states["altitude"], states["speed"], attack)
        phase.path("heating rate", heating, upper=heating_rate, unit="Btu/ft2/s", scale=heating_rate)
    problem.maximize("cross-range", degrees(1.0) * phase.final(states["latitude"]), unit="deg")
    guess(phase, START, FINAL_GUESS, dict(zip(ANGLES, (ATTACK, BANK), strict=True)))
    phase.guess(tf=FINAL_GUESS)
    problem.default_transcription = "dfet:20x3"
    problem.default_evaluations = 1_000
    return problem
