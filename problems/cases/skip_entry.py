"""Skip entries: a winged vehicle with an engine dips into the air down to a lowest altitude, and leaves it again with thrust.

Two phases, linked in all states, within three limits. At the end of the descent the flight is level: the lowest altitude is both the end of
the descent and a bound, which implies it, and a coarse mesh would dip below without.

`skip`: Bae, Shin, Savvaris and Tsourdos, "Multi-objective skip trajectory optimization for hypersonic reentry vehicles", Cranfield
University. What the paper leaves open is chosen here: the specific impulse, 319 s, is such that the printed 86502 kg and 4970 m/s lie on
the front (a calibration); the constant of the heating rate is that of Betts (`reentry`), which the paper's limit of 200 Btu/ft2/s goes
with; the speed, "free" in the table of bounds, is at most the initial one, as the printed 7803 m/s says; and the flight is level at its
lowest point. Thrust follows without lag.

`smv`: Chai, Savvaris, Tsourdos and Xia, "An interactive fuzzy physical programming for solving multiobjective skip entry problem", IEEE
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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import degrees, inf, pi, radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from .. import checks
from ..phase import Phase
from ..problem import Problem
from .flight_figures import pictures, trajectories
from .reentry import SHUTTLE, guess
from .winged import FOOT, SLUG, STATES, UNITS, Winged

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot", "reference_name", "skip", "smv"]

reference_name = "the front that gradients found"
DESCENT, ASCENT = "descent", "ascent"
TOP = 79248.0
"""Altitude at which the flight begins and ends, m."""
START = {
    "altitude": TOP,
    "longitude": 0.0,
    "latitude": 0.0,
    "speed": 7802.88,
    "flight-path angle": radians(-1.0),
    "heading": radians(90.0),
    "mass": 90719.0,
}
COMMANDED = {"angle of attack": radians(17.42), "bank angle": radians(-75.0), "thrust": 0.0}
"""The controls at the beginning, which counts only where they lag behind their commands."""
BOUNDS = {
    "longitude": (-pi, pi),
    "latitude": (-radians(89.0), radians(89.0)),
    "flight-path angle": (-radians(80.0), radians(80.0)),
    "heading": (-pi, pi),
    "mass": (3177.0, START["mass"]),
    "angle of attack": (radians(-10.0), radians(30.0)),
    "bank angle": (radians(-80.0), radians(80.0)),
    "thrust": (0.0, 2e6),
}
SLOWEST = 1.0
"""m/s."""
HEATING, PRESSURE, LOAD = 200.0, 13406.4583, 2.5
"""Limits of the heating rate, Btu/ft2/s (of `skip` the paper's 2269.7864 kW/m2, with the thermochemical Btu), of the dynamic pressure, Pa,
and of the load, in weights."""
DURATIONS = {DESCENT: (20.0, 3000.0), ASCENT: (20.0, 1500.0)}
"""Usual bounds, s; no flight of interest takes so little or so much."""
ALONG = (*STATES, "mass", *COMMANDED)
SHOWN_UNITS = {
    "altitude": ("km", 1e-3),
    "speed": ("km/s", 1e-3),
    "mass": ("t", 1e-3),
    "thrust": ("MN", 1e-6),
    "heating rate": ("Btu/ft2/s", 1.0),
    "dynamic pressure": ("kPa", 1e-3),
    "load factor": ("g", 1.0),
}


@dataclass(frozen=True)
class Mission:
    """Data of a skip entry."""

    vehicle: Winged
    lowest: float  # Altitude at which the descent ends, m.
    impulse: float  # Specific impulse, s; the flow of propellant is that of the local gravity, as both papers have it.
    lags: Mapping[str, float]  # Controls that follow their commands with a lag: gain, 1/s.
    fastest: float = START["speed"]  # Bound of the speed, m/s.
    mass: float = START["mass"]  # At the beginning, kg.
    durations: Mapping[str, tuple[float, float]] = field(default_factory=lambda: DURATIONS)  # Bounds of the duration of each phase, s.


def skip_entry(name: str, mission: Mission) -> tuple[Problem, dict[str, ca.MX]]:
    """State the flight, the phases "descent" and "ascent", without objectives; it, and the heating rate by phase.

    Raises ValueError for data that make no sense, by their names.
    """
    given = {"impulse": mission.impulse, "mass": mission.mass, "fastest": mission.fastest}
    given |= {f"the lag of the {control}": gain for control, gain in mission.lags.items()}
    for word, value in given.items():
        checks.positive(value, f"{name}: {word}")
    checks.within((mission.lowest, mission.lowest), (0.0, TOP), f"{name}: the lowest altitude")
    checks.within((START["speed"], START["speed"]), (SLOWEST, mission.fastest), f"{name}: the initial speed")
    checks.within((mission.mass, mission.mass), (BOUNDS["mass"][0], inf), f"{name}: mass")
    problem = Problem(name)
    first, second = (mission.durations[name] for name in (DESCENT, ASCENT))
    down = problem.phase(DESCENT, t0=0.0, tf=first)
    up = problem.phase(ASCENT, t0=first, tf=(first[0], first[1] + second[1]), duration=second)
    heating = {}
    for phase, ends in ((down, {"altitude": mission.lowest, "flight-path angle": 0.0}), (up, {"altitude": TOP})):
        begins = (START | {"mass": mission.mass} | COMMANDED) if phase is down else {}
        heating[phase.name] = _fly(phase, mission, begins, ends)
    problem.link(down, up)
    return problem, heating


def _fly(phase: Phase, mission: Mission, begins: Mapping[str, float], ends: Mapping[str, float]) -> ca.MX:
    """Declare one phase, with its dynamics and limits; returns its heating rate."""
    bounds = BOUNDS | {
        "altitude": (mission.lowest, TOP),
        "speed": (SLOWEST, mission.fastest),
        "mass": (BOUNDS["mass"][0], mission.mass),
    }
    states = {
        name: phase.state(name, bounds=bounds[name], initial=begins.get(name), final=ends.get(name), unit=UNITS.get(name, "rad"))
        for name in (*START, *mission.lags)
    }
    controls = {
        name: phase.control(name, bounds=BOUNDS[name], unit=UNITS.get(name, "rad")) for name in COMMANDED if name not in mission.lags
    }
    commands = {name: phase.control(f"{name} command", bounds=BOUNDS[name], unit=UNITS.get(name, "rad")) for name in mission.lags}
    attack, bank, thrust = ((states | controls)[name] for name in COMMANDED)
    vehicle, altitude, speed, mass = mission.vehicle, states["altitude"], states["speed"], states["mass"]
    rates = vehicle.rates(states, attack, bank, mass, thrust)
    rates["mass"] = -thrust / (mission.impulse * vehicle.gravity(altitude))
    rates |= {name: gain * (commands[name] - states[name]) for name, gain in mission.lags.items()}
    phase.dynamics(**rates)
    heating = vehicle.heating_rate(altitude, speed, attack)
    phase.path("heating rate", heating, upper=HEATING, unit="Btu/ft2/s", scale=HEATING)
    phase.path("dynamic pressure", vehicle.dynamic_pressure(altitude, speed), upper=PRESSURE, unit="Pa", scale=PRESSURE)
    phase.path("load factor", vehicle.load_factor(altitude, speed, attack, mass), upper=LOAD, unit="g", scale=LOAD)
    return heating


def plot(flights: Sequence[Any]) -> dict[str, Figure]:
    """States, controls with their commands and what the air does over time, and the ground track; coloured by flight time."""
    phases = [list(trajectory.values()) for trajectory in trajectories(flights)]
    return pictures(phases, np.array([flight[-1].tf for flight in phases]), "flight time [s]", ALONG, SHOWN_UNITS)


SKIP_VEHICLE = Winged(
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
LOWEST = 51880.0
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
GUESSED = {DESCENT: 900.0, ASCENT: 130.0}
"""Of that flight, s."""
SKIP_MESHES = {
    DESCENT: {"edges": [*np.linspace(0.0, 0.5, 7), *np.linspace(0.5, 0.85, 9)[1:], *np.linspace(0.85, 1.0, 15)[1:]], "order": 5},
    ASCENT: {"edges": [*np.linspace(0.0, 0.4, 17), *np.linspace(0.4, 1.0, 11)[1:]], "order": 5, "control_order": 1},
}
"""Shorter elements before and after the lowest point, where two limits are reached and the engine burns for a moment."""


def skip(
    *,
    impulse: float = 319.0,
    thrust_lag: float | None = None,
    lowest: float = LOWEST,
    fastest: float = START["speed"],
    mass: float = START["mass"],
) -> Problem:
    """Terminal mass against terminal speed.

    Parameters
    ----------
    impulse, lowest, fastest, mass : float
        See `Mission`.
    thrust_lag : float, optional
        Gain of a first-order lag of the thrust, 1/s; None: it follows at once.
    """
    lags = {} if thrust_lag is None else {"thrust": thrust_lag}
    problem, _ = skip_entry("skip", Mission(SKIP_VEHICLE, lowest, impulse, lags, fastest, mass))
    ascent = problem.phases[ASCENT]
    problem.maximize("terminal mass", ascent.final(ascent["mass"]), unit="kg")
    problem.maximize("terminal speed", ascent.final(ascent["speed"]), unit="m/s")
    begin = 0.0
    for (name, duration), states, attack, bank in zip(GUESSED.items(), (DOWN, UP), (0.35, 0.5), (-1.0, 0.0), strict=True):
        times = begin + duration * np.array(states["share"])
        lines = {state: (times, np.array(values)) for state, values in states.items() if state != "share"}
        lines["altitude"] = times, np.maximum(states["altitude"], lowest)
        held = {"latitude": 0.0, "heading": START["heading"], "mass": mass, "angle of attack": attack, "bank angle": bank}
        problem.phases[name].guess(tf=begin + duration, **lines, **held, thrust=0.0)
        begin += duration
    return _with_defaults(problem, 1_500, {"elements": 12, "order": 5, "control_order": 2, "basis": "bernstein", "mesh": SKIP_MESHES})


SMV_DURATIONS = {DESCENT: (20.0, 1500.0), ASCENT: (20.0, 600.0)}
"""s; chosen: room for several skips on the way down. The ends of the front that were found are well within."""
SMV_VEHICLE = Winged(
    radius=6378135.0,
    mu=3.986004418e14,
    density=0.002378 * SLUG / FOOT**3,
    scale_height=7254.24,
    area=2690.0 * FOOT**2,
    lift=(-0.2070, 1.676),
    drag=(0.07854, -0.3529, 2.040),
    # Table I is for powers of the angle of attack in rad.
    heating=tuple(value / degrees(1.0) ** power for power, value in enumerate((1.067, -1.101, 0.6988, -0.1903))),
    heating_constant=SHUTTLE.heating_constant,
    turning=7.2921151e-5,
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
SMV_MESHES = {
    DESCENT: {"edges": np.linspace(0.0, 1.0, 49).tolist(), "order": 3},
    ASCENT: {"edges": [*np.linspace(0.0, 0.4, 21), *np.linspace(0.4, 1.0, 7)[1:]], "order": 3},
}
"""Elements of some 9 s on the way down, twice the lag: on fewer, the angle of attack cannot be switched within seconds, and long flights
gain mass by the errors of the mesh. Shorter ones after the lowest point, where the engine burns for a moment."""


def smv(
    *,
    impulse: float = 300.0,
    lag_gain: float = 0.2,
    lowest: float = 50e3,
    fastest: float = START["speed"],
    mass: float = START["mass"],
) -> Problem:
    """Flight time, heat load, terminal speed and terminal mass over a turning planet.

    Parameters
    ----------
    impulse, lowest, fastest, mass : float
        See `Mission`.
    lag_gain : float
        Of the lags of angle of attack, bank angle and thrust, 1/s.
    """
    mission = Mission(SMV_VEHICLE, lowest, impulse, dict.fromkeys(COMMANDED, lag_gain), fastest, mass, SMV_DURATIONS)
    problem, heating = skip_entry("smv", mission)
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
    return _with_defaults(problem, 2_000, {"elements": 48, "order": 3, "control_order": 1, "basis": "bernstein", "mesh": SMV_MESHES})


def _with_defaults(problem: Problem, evaluations: int, mesh: Mapping[str, Any]) -> Problem:
    # A candidate is propagated only, as it takes seconds to make one feasible; the budget is that of the gradient solves that follow.
    problem.default_transcription, problem.default_evaluations = {"method": "DFET", "settings": mesh}, evaluations
    problem.default_inner, problem.default_start = "propagate", "smooth"
    return problem


def front(case: str) -> np.ndarray:
    """The front of a case (k, m), as the user sees its objectives. How it was found is in the file; `python tests/truths/skip_entry.py`
    makes one by gradients alone."""
    return np.loadtxt(Path(__file__).with_name(f"{case}.csv"), delimiter=",", ndmin=2)


skip_reference, smv_reference = partial(front, "skip"), partial(front, "smv")
