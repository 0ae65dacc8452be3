"""A winged vehicle in an exponential atmosphere: its aerodynamics, and its motion over a round planet, which may turn.

Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear Programming", SIAM 2010, section 6.1 (the forces); Vinh,
"Optimal Trajectories in Atmospheric Flight", Elsevier 1981, section 2.3 (the motion over a planet that turns, in its frame). All is SI with
angles in radians, but for the heating rate, whose unit is that of its constant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees
from typing import Any

import casadi as ca

STATES = ("altitude", "longitude", "latitude", "speed", "flight-path angle", "heading")
UNITS = {"altitude": "m", "speed": "m/s", "mass": "kg", "thrust": "N"}
"""The others are in rad."""
GRAVITIES = ("newtonian", "constant")
FOOT, SLUG, POUND = 0.3048, 14.59390294, 4.4482216152605
"""m, kg, N."""


@dataclass(frozen=True)
class Winged:
    """A vehicle, the air and the planet."""

    radius: float  # Of the planet, m.
    mu: float  # Its gravitational parameter, m3/s2.
    density: float  # Of the air at the surface, kg/m3.
    scale_height: float  # Height in which it falls by a factor e, m.
    area: float  # Of reference, m2.
    lift: tuple[Any, ...]  # Coefficients of powers of the angle of attack in rad, as of the drag.
    drag: tuple[Any, ...]
    heating: tuple[float, ...]  # Factors of powers of the angle of attack in degrees.
    heating_constant: float  # Heating rate over these, the root of the density in kg/m3, and the speed in m/s to the power 3.07.
    turning: float = 0.0  # Rate at which the planet turns, rad/s; 0: it does not.

    def gravity(self, altitude: Any, model: str = "newtonian") -> Any:
        """Acceleration, m/s2: by Newton's law, or the same everywhere as at sea level."""
        return self.mu / (self.radius + altitude) ** 2 if model == "newtonian" else self.mu / self.radius**2

    def air(self, altitude: Any) -> Any:
        """Density, kg/m3."""
        return self.density * ca.exp(-altitude / self.scale_height)

    def lift_and_drag(self, altitude: Any, speed: Any, attack: Any) -> tuple[Any, Any]:
        """Both in N."""
        force = self.dynamic_pressure(altitude, speed) * self.area
        return force * _polynomial(self.lift, attack), force * _polynomial(self.drag, attack)

    def dynamic_pressure(self, altitude: Any, speed: Any) -> Any:
        """In Pa."""
        return 0.5 * self.air(altitude) * speed**2

    def heating_rate(self, altitude: Any, speed: Any, attack: Any) -> Any:
        """At the leading edge of the wing, in the unit of its constant."""
        return self.heating_constant * ca.sqrt(self.air(altitude)) * speed**3.07 * _polynomial(self.heating, degrees(1.0) * attack)

    def load_factor(self, altitude: Any, speed: Any, attack: Any, mass: Any, model: str = "newtonian") -> Any:
        """Lift and drag together over the weight at that altitude."""
        lift, drag = self.lift_and_drag(altitude, speed, attack)
        return ca.sqrt(lift**2 + drag**2) / (mass * self.gravity(altitude, model))

    def rates(
        self, state: Mapping[str, Any], attack: Any, bank: Any, mass: Any, thrust: Any = 0.0, model: str = "newtonian"
    ) -> dict[str, Any]:
        """Rates of the six states by name, per second, of the motion over the ground; angles in rad, the bank to the right, mass in kg.

        The flight-path angle is above the horizon, the heading from north over east; thrust, N, is along the axis of the vehicle.
        """
        altitude, latitude, speed = state["altitude"], state["latitude"], state["speed"]
        path, heading = state["flight-path angle"], state["heading"]
        lift, drag = self.lift_and_drag(altitude, speed, attack)
        g, r = self.gravity(altitude, model), self.radius + altitude
        along = speed * ca.cos(path) / r
        upward = lift * ca.cos(bank) + thrust * ca.sin(attack)
        rates = {
            "altitude": speed * ca.sin(path),
            "longitude": along * ca.sin(heading) / ca.cos(latitude),
            "latitude": along * ca.cos(heading),
            "speed": (thrust * ca.cos(attack) - drag) / mass - g * ca.sin(path),
            "flight-path angle": upward / (mass * speed) + along - g * ca.cos(path) / speed,
            "heading": lift * ca.sin(bank) / (mass * speed * ca.cos(path)) + along * ca.sin(heading) * ca.tan(latitude),
        }
        if self.turning:
            for name, rate in self._by_turning(r, latitude, speed, path, heading).items():
                rates[name] += rate
        return rates

    def _by_turning(self, r: Any, latitude: Any, speed: Any, path: Any, heading: Any) -> dict[str, Any]:
        """What the turning planet adds to the rates of speed, flight-path angle and heading: centrifugal and Coriolis acceleration."""
        once, twice = 2.0 * self.turning, self.turning**2 * r * ca.cos(latitude)
        sideways = ca.cos(heading) * ca.sin(latitude)
        return {
            "speed": twice * (ca.sin(path) * ca.cos(latitude) - ca.cos(path) * sideways),
            "flight-path angle": once * ca.cos(latitude) * ca.sin(heading)
            + twice / speed * (ca.cos(path) * ca.cos(latitude) + ca.sin(path) * sideways),
            "heading": once * (ca.sin(latitude) - ca.tan(path) * ca.cos(heading) * ca.cos(latitude))
            + twice * ca.sin(latitude) * ca.sin(heading) / (speed * ca.cos(path)),
        }


def _polynomial(coefficients: tuple[Any, ...], x: Any) -> Any:
    """The sum of coefficients times powers of x, from the power 0."""
    return sum(c * x**k for k, c in enumerate(coefficients))
