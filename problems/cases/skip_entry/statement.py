"""What both skip entries have in common: down to a lowest altitude, and up again with thrust, within three limits.

Two phases, linked in all states. At the end of the descent the flight is level: the lowest altitude is both the end of the descent and a
bound, which implies it, and a coarse mesh would dip below without.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, pi, radians
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from ... import checks
from ...phase import Phase
from ...problem import Problem
from ..flight_figures import ColouredFlights, trajectories
from ..winged import STATES, UNITS, Winged

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
PRESSURE, LOAD = 13406.4583, 2.5
"""Limits of the dynamic pressure, Pa, and of the load, in weights."""
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
    heating: float  # Limit of the heating rate, Btu/ft2/s, as the vehicle's.
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
    phase.path("heating rate", heating, upper=mission.heating, unit="Btu/ft2/s", scale=mission.heating)
    phase.path("dynamic pressure", vehicle.dynamic_pressure(altitude, speed), upper=PRESSURE, unit="Pa", scale=PRESSURE)
    phase.path("load factor", vehicle.load_factor(altitude, speed, attack, mass), upper=LOAD, unit="g", scale=LOAD)
    return heating


def plot(flights: Sequence[Any]) -> dict[str, Figure]:
    """States, controls with their commands and what the air does over time, and the ground track; coloured by flight time."""
    phases = [list(trajectory.values()) for trajectory in trajectories(flights)]
    flown = ColouredFlights(phases, np.array([flight[-1].tf for flight in phases]), "flight time [s]")
    return {"population": flown.over_time(ALONG, SHOWN_UNITS), "ground-track": flown.on_the_map()[0]}
