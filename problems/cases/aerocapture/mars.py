"""Mars with an exponential atmosphere: the hyperbola of a capsule that arrives, its heating in the air, the ellipse on which it leaves.

Armellin and Lavagna, "Multidisciplinary Optimization of Aerocapture Maneuvers", Journal of Artificial Evolution and Applications 2008. The
paper prints the interface, the target orbit and the speeds. The gravitational parameter is that of Mars (Konopliv et al., "Mars high
resolution gravity fields from MRO, Mars seasonal gravity, and other dynamical parameters", Icarus 211, 2011: 4.28284e13, here to five
digits). Radius, scale height and density are not printed: they are fitted to numbers of the paper, so that agreement with its tables tests
the model, not these three values. Orbits: Battin, "An Introduction to the Mathematics and Methods of Astrodynamics", AIAA 1999, chapters 3
and 4.

Convective heating at the stagnation point, and the heat shield that a heat load asks for: eqs. (3) and (4), after Tauber and Bowles, "The
use of atmospheric braking during Mars missions", AIAA 89-1730, and Laub and Venkatapathy, "Thermal protection system technology and
facility needs for demanding future planetary missions", 2003. Two readings: eq. (3) prints 0.0091, which gives a fraction ten times
smaller than all tables: here 0.091, in per cent for J/cm2. The wall enthalpy is not printed: a constant, fitted to the heat shields of
Tables 1 and 2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, radians, sin
from typing import Any

import casadi as ca
import numpy as np

from ..winged import STATES


@dataclass(frozen=True)
class Mars:
    """The planet, its air and the two circles that count."""

    mu: float = 4.2828e13  # Gravitational parameter, m3/s2.
    # Mean radius, m. Fitted: with it an exit at 3500 m/s has the printed path angle and delta v, 1.73 deg and 52.6 m/s, and the circular
    # speed at the target is the printed 3453.7 m/s.
    radius: float = 3390.7e3
    interface: float = 100e3  # Altitude at which the air begins, m.
    target: float = 200e3  # Altitude of the circular orbit that is wanted, m.
    # Height in which the density falls by a factor e, m. Fitted to altitudes, entry angles and heat shields of Tables 1 and 2.
    scale_height: float = 8.92e3
    density: float = 3.17e-7  # Of the air at the interface, kg/m3. Fitted likewise.

    @property
    def entry_radius(self) -> float:
        """Radius at which the air begins, m."""
        return self.radius + self.interface

    @property
    def target_radius(self) -> float:
        """Radius of the circular orbit that is wanted, m."""
        return self.radius + self.target


MARS = Mars()
ARRIVAL_SPEED, EXIT_SPEED = 5000.0, 3500.0
"""Excess speed of the arrival, and speed at which the air is left in the paper's coupled optimisation, m/s."""


def entry_speed(arrival_speed: float) -> float:
    """Speed at the interface of a hyperbola with an excess speed, m/s: eq. (12)."""
    return float(np.sqrt(arrival_speed**2 + 2.0 * MARS.mu / MARS.entry_radius))


def exit_speeds() -> tuple[float, float]:
    """Least and greatest speed at the interface of an ellipse whose apoapsis is on the target orbit, m/s: vertical and level exits."""
    ratio = MARS.entry_radius / MARS.target_radius
    vertical = 2.0 * MARS.mu * (1.0 / MARS.entry_radius - 1.0 / MARS.target_radius)
    return float(np.sqrt(vertical)), float(np.sqrt(vertical / (1.0 - ratio**2)))


def exit_angle(speed: float) -> float:
    """Path angle at the interface, rad, that brings the apoapsis to the target orbit: eqs. (13)-(16).

    Raises ValueError: no angle does, for the speed is outside `exit_speeds`.
    """
    least, greatest = exit_speeds()
    if not least <= speed <= greatest:
        raise ValueError(f"an exit at {speed:g} m/s cannot reach the target orbit tangentially; {least:.1f} to {greatest:.1f} m/s can")
    above = max(speed**2 - 2.0 * MARS.mu * (1.0 / MARS.entry_radius - 1.0 / MARS.target_radius), 0.0)
    return float(np.arccos(min(MARS.target_radius * np.sqrt(above) / (speed * MARS.entry_radius), 1.0)))


def circularisation(speed: Any) -> Any:
    """Delta v, m/s, of the burn at the target orbit after an exit at a speed whose apoapsis is there: eq. (27). Numbers, arrays, CasADi."""
    energy = speed**2 - 2.0 * MARS.mu * (1.0 / MARS.entry_radius - 1.0 / MARS.target_radius)
    return (MARS.mu / MARS.target_radius) ** 0.5 - energy**0.5


def exit_speed(delta_v: float) -> float:
    """Speed at the interface, m/s, after which the burn at the target orbit takes a delta v, m/s: `circularisation` solved for it.

    Raises ValueError: no exit to the target orbit has this delta v.
    """
    vertical, level = exit_speeds()
    least, most = float(circularisation(level)), float(np.sqrt(MARS.mu / MARS.target_radius))
    if not least <= delta_v <= most:
        raise ValueError(f"no exit to the target orbit has a delta v of {delta_v:g} m/s; {least:.1f} to {most:.1f} m/s are possible")
    return float(np.hypot(most - delta_v, vertical))


def arrival(begins: Mapping[str, Any], declination: float) -> dict[str, Any]:
    """What vanishes if the capsule comes from the right direction: components of its velocity far away across that, by name.

    The velocity far away is along e / |e|^2 + sqrt(1 - 1 / |e|^2) q, with the eccentricity vector e towards the periapsis, and q a right
    angle ahead of it.
    """
    h, lon, lat, v, path, heading = (begins[name] for name in STATES)
    up = ca.vertcat(ca.cos(lat) * ca.cos(lon), ca.cos(lat) * ca.sin(lon), ca.sin(lat))
    east = ca.vertcat(-ca.sin(lon), ca.cos(lon), 0.0)
    north = ca.vertcat(-ca.sin(lat) * ca.cos(lon), -ca.sin(lat) * ca.sin(lon), ca.cos(lat))
    velocity = v * (ca.sin(path) * up + ca.cos(path) * (ca.sin(heading) * east + ca.cos(heading) * north))
    momentum = ca.cross((MARS.radius + h) * up, velocity)
    e = ca.cross(velocity, momentum) / MARS.mu - up
    size = ca.sumsqr(e)
    ahead = ca.cross(momentum, e) / ca.sqrt(ca.sumsqr(momentum) * size)
    asymptote = e / size + ca.sqrt(1.0 - 1.0 / size) * ahead
    return {
        "arrival sideways": asymptote[1],
        "arrival upward": asymptote[2] * cos(radians(declination)) - asymptote[0] * sin(radians(declination)),
    }


def apoapsis(ends: Mapping[str, Any]) -> Any:
    """Altitude of the apoapsis of the orbit after the exit, m: eq. (26) of Armellin and Lavagna (see `mars`)."""
    r, path = MARS.radius + ends["altitude"], ends["flight-path angle"]
    return r / (2.0 - _excess(r, ends["speed"])) * (1.0 + eccentricity(r, ends["speed"], path)) - MARS.radius


def eccentricity(r: Any, speed: Any, path: Any) -> Any:
    """Of the orbit through a point at a radius, m, with a speed, m/s, and a path angle, rad."""
    return ca.sqrt((_excess(r, speed) - 1.0) ** 2 * ca.cos(path) ** 2 + ca.sin(path) ** 2)


def since_arrival(r: float, speed: float, path: float) -> float:
    """Angle, rad, that a hyperbola has turned about the planet since it was far away."""
    excess = _excess(r, speed)
    anomaly = ca.atan2(excess * cos(path) * sin(path), excess * cos(path) ** 2 - 1.0)
    return float(ca.acos(-1.0 / eccentricity(r, speed, path)) + anomaly)


def _excess(r: Any, speed: Any) -> Any:
    """Squared speed over that of the circle."""
    return r * speed**2 / MARS.mu


CONSTANT = 1.35e-8
"""Of the heating rate in W/cm2, for SI units."""
SPEED_POWER = 3.04
WALL_ENTHALPY = 1.395e6
"""J/kg; fitted."""
SHIELD, SHIELD_POWER = 0.091, 0.51575
"""Per cent of the mass for a heat load in J/cm2, and its power."""


def heating_rate(density: Any, speed: Any, nose: Any = 1.0, wall_enthalpy: float = WALL_ENTHALPY) -> Any:
    """Convective heating rate at the stagnation point, W/cm2: eq. (4), with the total enthalpy v^2/2; all in SI.

    A nose radius of 1 m gives the rate times the root of the nose radius, which no longer depends on the nose.
    """
    return CONSTANT * (density / nose) ** 0.5 * speed**SPEED_POWER * (1.0 - 2.0 * wall_enthalpy / speed**2)


def shield_fraction(load: Any) -> Any:
    """Mass of the heat shield in per cent of the capsule's, for a heat load in J/cm2: eq. (3) with 0.091."""
    return SHIELD * load**SHIELD_POWER


def allowed_load(fraction: Any) -> Any:
    """Heat load in J/cm2 that a heat shield of so many per cent of the capsule's mass bears: eq. (3) solved for it."""
    return (fraction / SHIELD) ** (1.0 / SHIELD_POWER)
