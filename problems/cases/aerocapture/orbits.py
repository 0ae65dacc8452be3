"""The hyperbola before and the ellipse after a flight through the air, as expressions of its first and its last state.

Battin, "An Introduction to the Mathematics and Methods of Astrodynamics", AIAA 1999, chapters 3 and 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, radians, sin
from typing import Any

import casadi as ca

from ..winged import STATES
from .mars import Mars


def arrival(begins: Mapping[str, Any], declination: float, mars: Mars) -> dict[str, Any]:
    """What vanishes if the capsule comes from the right direction: components of its velocity far away across that, by name.

    The velocity far away is along e / |e|^2 + sqrt(1 - 1 / |e|^2) q, with the eccentricity vector e towards the periapsis, and q a right
    angle ahead of it.

    Parameters
    ----------
    begins : mapping
        States at the entry by the names of `winged.STATES`.
    declination : float
        Of the velocity far away, deg; it points to the longitude 0.
    mars : Mars
    """
    h, lon, lat, v, path, heading = (begins[name] for name in STATES)
    up = ca.vertcat(ca.cos(lat) * ca.cos(lon), ca.cos(lat) * ca.sin(lon), ca.sin(lat))
    east = ca.vertcat(-ca.sin(lon), ca.cos(lon), 0.0)
    north = ca.vertcat(-ca.sin(lat) * ca.cos(lon), -ca.sin(lat) * ca.sin(lon), ca.cos(lat))
    velocity = v * (ca.sin(path) * up + ca.cos(path) * (ca.sin(heading) * east + ca.cos(heading) * north))
    momentum = ca.cross((mars.radius + h) * up, velocity)
    e = ca.cross(velocity, momentum) / mars.mu - up
    size = ca.sumsqr(e)
    ahead = ca.cross(momentum, e) / ca.sqrt(ca.sumsqr(momentum) * size)
    asymptote = e / size + ca.sqrt(1.0 - 1.0 / size) * ahead
    return {
        "arrival sideways": asymptote[1],
        "arrival upward": asymptote[2] * cos(radians(declination)) - asymptote[0] * sin(radians(declination)),
    }


def apoapsis(ends: Mapping[str, Any], mars: Mars) -> Any:
    """Altitude of the apoapsis of the orbit after the exit, m: eq. (26) of Armellin and Lavagna (see `mars`)."""
    r, path = mars.radius + ends["altitude"], ends["flight-path angle"]
    return r / (2.0 - _excess(r, ends["speed"], mars)) * (1.0 + eccentricity(r, ends["speed"], path, mars)) - mars.radius


def eccentricity(r: Any, speed: Any, path: Any, mars: Mars) -> Any:
    """Of the orbit through a point at a radius, m, with a speed, m/s, and a path angle, rad."""
    return ca.sqrt((_excess(r, speed, mars) - 1.0) ** 2 * ca.cos(path) ** 2 + ca.sin(path) ** 2)


def since_arrival(r: float, speed: float, path: float, mars: Mars) -> float:
    """Angle, rad, that a hyperbola has turned about the planet since it was far away."""
    excess = _excess(r, speed, mars)
    anomaly = ca.atan2(excess * cos(path) * sin(path), excess * cos(path) ** 2 - 1.0)
    return float(ca.acos(-1.0 / eccentricity(r, speed, path, mars)) + anomaly)


def _excess(r: Any, speed: Any, mars: Mars) -> Any:
    """Squared speed over that of the circle."""
    return r * speed**2 / mars.mu
