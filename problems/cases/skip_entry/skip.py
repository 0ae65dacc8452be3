"""A skip to 51.88 km and back: terminal mass against terminal speed.

Bae, Shin, Savvaris and Tsourdos, "Multi-objective skip trajectory optimization for hypersonic reentry vehicles", Cranfield University.
What the paper leaves open is chosen here: the specific impulse, 319 s, is such that the printed 86502 kg and 4970 m/s lie on the front (a
calibration); the constant of the heating rate is that of Betts (`reentry.statement`), which the paper's limit of 200 Btu/ft2/s goes with;
the speed, "free" in the table of bounds, is at most the initial one, as the printed 7803 m/s says; and the flight is level at its lowest
point. Thrust follows without lag.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...problem import Problem
from ..flight_figures import track
from ..reentry.statement import SHUTTLE
from ..winged import Winged
from .statement import ASCENT, DESCENT, START, TOP, Mission, plot, skip_entry

__all__ = ["plot", "problem", "reference", "track"]

reference_name = "the front that gradients found"
HEATING = 200.0
"""Btu/ft2/s: the paper's 2269.7864 kW/m2, with the thermochemical Btu."""
LOWEST, IMPULSE = 51880.0, 319.0
VEHICLE = Winged(
    radius=6371203.92,
    mu=3.9856e14,
    density=1.2256,
    scale_height=7254.24,
    area=249.91,
    lift=(-0.2070, 1.676),
    drag=(0.07854, -0.3529, 2.040),
    heating=SHUTTLE.heating,
    heating_constant=SHUTTLE.heating_constant,
)

DOWN = {
    "share": (0.0, 0.15, 0.85, 1.0),
    "altitude": (TOP, 66e3, 60e3, LOWEST),
    "speed": (START["speed"], 7700.0, 5700.0, 5280.0),
    "flight-path angle": (START["flight-path angle"], -0.005, -0.005, 0.0),
}
UP = {
    "share": (0.0, 0.25, 0.5, 1.0),
    "altitude": (LOWEST, 58e3, 67e3, TOP),
    "speed": (5280.0, 5000.0, 4880.0, 4800.0),
    "flight-path angle": (0.0, 0.075, 0.06, 0.0),
}
"""A flight to begin with, at these shares of its phases: a glide, then up without much thrust."""
DURATIONS = {DESCENT: 900.0, ASCENT: 130.0}
"""Of that flight, s."""
MESHES = {
    DESCENT: {"edges": [*np.linspace(0.0, 0.5, 7), *np.linspace(0.5, 0.85, 9)[1:], *np.linspace(0.85, 1.0, 15)[1:]], "order": 5},
    ASCENT: {"edges": [*np.linspace(0.0, 0.4, 17), *np.linspace(0.4, 1.0, 11)[1:]], "order": 5, "control_order": 1},
}
"""Shorter elements before and after the lowest point, where two limits are reached and the engine burns for a moment."""


def problem(
    *,
    impulse: float = IMPULSE,
    thrust_lag: float | None = None,
    lowest: float = LOWEST,
    fastest: float = START["speed"],
    mass: float = START["mass"],
) -> Problem:
    """The case.

    Parameters
    ----------
    impulse : float
        Specific impulse, s.
    thrust_lag : float, optional
        Gain of a first-order lag of the thrust, 1/s; None: it follows at once.
    lowest : float
        Altitude at which the descent ends, m.
    fastest : float
        Bound of the speed, m/s.
    mass : float
        At the beginning, kg.
    """
    lags = {} if thrust_lag is None else {"thrust": thrust_lag}
    problem, _ = skip_entry("skip", Mission(VEHICLE, lowest, HEATING, impulse, lags, fastest, mass))
    ascent = problem.phases[ASCENT]
    problem.maximize("terminal mass", ascent.final(ascent["mass"]), unit="kg")
    problem.maximize("terminal speed", ascent.final(ascent["speed"]), unit="m/s")
    _guess(problem, lowest, mass)
    problem.default_transcription = {
        "method": "DFET",
        "settings": {"elements": 12, "order": 5, "control_order": 2, "basis": "bernstein", "mesh": MESHES},
    }
    # A candidate is propagated only, as it takes seconds to make one feasible; the budget is that of the gradient solves that follow.
    problem.default_evaluations = 1500
    problem.default_inner, problem.default_start = "propagate", "smooth"
    return problem


def _guess(problem: Problem, lowest: float, mass: float) -> None:
    begin = 0.0
    for (name, duration), states, attack, bank in zip(DURATIONS.items(), (DOWN, UP), (0.35, 0.5), (-1.0, 0.0), strict=True):
        times = begin + duration * np.array(states["share"])
        lines = {state: (times, np.array(values)) for state, values in states.items() if state != "share"}
        lines["altitude"] = times, np.maximum(states["altitude"], lowest)
        held = {"latitude": 0.0, "heading": START["heading"], "mass": mass, "angle of attack": attack, "bank angle": bank}
        problem.phases[name].guess(tf=begin + duration, **lines, **held, thrust=0.0)
        begin += duration


def reference() -> np.ndarray:
    """The front (k, 2): terminal mass, kg, and terminal speed, m/s; by `python tests/truths/skip_entry.py skip`."""
    return np.loadtxt(Path(__file__).with_name("skip.csv"), delimiter=",", ndmin=2)
