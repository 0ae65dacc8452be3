"""A winged shuttle: its constants, its aerodynamics, and its motion over a round Earth that does not turn.

Betts, "Practical Methods for Optimal Control and Estimation Using Nonlinear Programming", SIAM 2010, section 6.1, with figures in feet,
slugs and Btu; equations (5) and (9) of Chai et al., "Solving multiobjective constrained trajectory optimization problem by an extended
evolutionary algorithm", IEEE Transactions on Cybernetics 50(4), 2020, in which the sign of the density's exponent is a slip. All is SI with
angles in radians, but for the heating rate, the dynamic pressure and the load, which are in the units of their limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees
from typing import Any

import casadi as ca

STATES = ("altitude", "longitude", "latitude", "speed", "flight-path angle", "heading")
FOOT, SLUG, POUND = 0.3048, 14.59390294, 4.4482216152605
"""m, kg, N."""
EARTH_RADIUS = 20902900.0 * FOOT
EARTH_MU = 0.14076539e17 * FOOT**3
GRAVITIES = ("newtonian", "constant")

MASS = 6309.43 * SLUG
AREA = 2690.0 * FOOT**2
SEA_LEVEL_DENSITY = 0.002378 * SLUG / FOOT**3
SCALE_HEIGHT = 23800.0 * FOOT
LIFT = (-0.20704, 1.67556)
DRAG = (0.07854, -0.352896, 2.039962)
"""Coefficients of powers of the angle of attack in rad."""
HEATING = (1.0672181, -0.019213774, 2.1286289e-4, -1.0117249e-6)
"""Of powers of the angle of attack in degrees."""
HEATING_CONSTANT = 17700.0 * 1e-4**3.07 * (FOOT**3 / SLUG) ** 0.5 / FOOT**3.07
"""From (kg/m3)^0.5 (m/s)^3.07 to Btu/ft2/s."""


def gravity(altitude: Any, model: str) -> Any:
    """Acceleration, m/s2: by Newton's law, or the same everywhere as at sea level."""
    return EARTH_MU / (EARTH_RADIUS + altitude) ** 2 if model == "newtonian" else EARTH_MU / EARTH_RADIUS**2


def density(altitude: Any) -> Any:
    """Of the air, kg/m3."""
    return SEA_LEVEL_DENSITY * ca.exp(-altitude / SCALE_HEIGHT)


def lift_and_drag(altitude: Any, speed: Any, attack: Any) -> tuple[Any, Any]:
    """Both in N."""
    force = 0.5 * density(altitude) * speed**2 * AREA
    return force * (LIFT[0] + LIFT[1] * attack), force * (DRAG[0] + DRAG[1] * attack + DRAG[2] * attack**2)


def heating_rate(altitude: Any, speed: Any, attack: Any) -> Any:
    """At the leading edge of the wing, Btu/ft2/s."""
    polynomial = sum(c * (degrees(1.0) * attack) ** k for k, c in enumerate(HEATING))
    return HEATING_CONSTANT * ca.sqrt(density(altitude)) * speed**3.07 * polynomial


def dynamic_pressure(altitude: Any, speed: Any) -> Any:
    """In lbf/ft2."""
    return 0.5 * density(altitude) * speed**2 * FOOT**2 / POUND


def load_factor(altitude: Any, speed: Any, attack: Any, mass: float, model: str) -> Any:
    """Lift and drag together over the weight at that altitude."""
    lift, drag = lift_and_drag(altitude, speed, attack)
    return ca.sqrt(lift**2 + drag**2) / (mass * gravity(altitude, model))


def rates(state: Mapping[str, Any], attack: Any, bank: Any, mass: float = MASS, model: str = "newtonian") -> dict[str, Any]:
    """Rates of the six states by name.

    Parameters
    ----------
    state : mapping
        "altitude" m, "longitude" and "latitude" rad, "speed" m/s, "flight-path angle" above the horizon and "heading" from north over
        east, rad.
    attack, bank : expressions
        Angle of attack, and bank angle to the right, rad.
    mass : float
        kg.
    model : str
        Of `GRAVITIES`.

    Returns
    -------
    dict
        Expressions per second, in the order of the states.
    """
    altitude, latitude, speed = state["altitude"], state["latitude"], state["speed"]
    path, heading = state["flight-path angle"], state["heading"]
    lift, drag = lift_and_drag(altitude, speed, attack)
    g, radius = gravity(altitude, model), EARTH_RADIUS + altitude
    along = speed * ca.cos(path) / radius
    return {
        "altitude": speed * ca.sin(path),
        "longitude": along * ca.sin(heading) / ca.cos(latitude),
        "latitude": along * ca.cos(heading),
        "speed": -drag / mass - g * ca.sin(path),
        "flight-path angle": lift * ca.cos(bank) / (mass * speed) + along - g * ca.cos(path) / speed,
        "heading": lift * ca.sin(bank) / (mass * speed * ca.cos(path)) + along * ca.sin(heading) * ca.tan(latitude),
    }
