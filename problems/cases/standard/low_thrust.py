"""Low-thrust transfer: many turns around an oblate earth, from a low orbit to a high and inclined one, with as much mass as possible.

Betts, "Very low-thrust trajectory optimization using a direct SQP method", Journal of Computational and Applied Mathematics 120, 2000;
Betts 2010, section 6.3. Equinoctial elements, in feet and seconds; zonal harmonics of the second to the fourth degree.
"""

from __future__ import annotations

from math import pi
from typing import Any

import casadi as ca
import numpy as np

from ...problem import Problem
from .published import optimum

IMPULSE, MU, GRAVITY, THRUST, EARTH = 450.0, 1.407645794e16, 32.174, 4.446618e-3, 20925662.73
ZONAL = {2: 1082.639e-6, 3: -2.565e-6, 4: -1.608e-6}
START = {"p": 21837080.052835, "f": 0.0, "g": 0.0, "h": -0.25396764647494, "k": 0.0, "L": pi, "w": 1.0}
BOUNDS = {"p": (1e7, 6e7), "f": (-0.2, 0.2), "g": (-0.1, 1.0), "h": (-1.0, 1.0), "k": (-0.2, 0.2), "L": (pi, 20 * pi), "w": (0.01, 2.0)}
FINAL_P, FINAL_E, FINAL_I = 40007346.015232, 0.73550320568829, 0.61761258786099
"""Semi-latus rectum, eccentricity, and the tangent of half the inclination, at the end."""
GUESSED_TIME, GUESSED_FACTOR = 86810.0, -25.0


@optimum(
    "weight",
    0.2201791,
    5e-7,
    "Betts 2010, section 6.3: throttle -9.09081, 86810.0 s; on 100 elements of order 4: 0.2201791, -9.0932, 86812.3 s",
    remark="PSOPT has 0.2203380, with a direction whose squared length may be 1.001",
)
def low_thrust() -> Problem:
    """Many turns around the earth, to a high orbit.

    The guess is that of Betts and PSOPT: a flight with the thrust along the velocity.
    """
    problem = Problem("low_thrust")
    factor = problem.parameter("throttle", bounds=(-50.0, 0.0))
    transfer = problem.phase("transfer", t0=0.0, tf=(50000.0, 100000.0))
    x = [transfer.state(name, bounds=bounds, initial=START[name]) for name, bounds in BOUNDS.items()]
    u = [transfer.control(name, bounds=(-1, 1)) for name in ("radial", "tangential", "normal")]
    transfer.dynamics(**dict(zip(BOUNDS, _rates(x, u, factor), strict=True)))
    transfer.path("direction", sum(value**2 for value in u), lower=1.0, upper=1.0)
    p, f, g, h, k, _, w = x
    problem.constraint("size", transfer.final(p / FINAL_P), lower=1.0, upper=1.0)
    problem.constraint("eccentricity", transfer.final(ca.sqrt(f**2 + g**2)), lower=FINAL_E, upper=FINAL_E)
    problem.constraint("inclination", transfer.final(ca.sqrt(h**2 + k**2)), lower=FINAL_I, upper=FINAL_I)
    problem.constraint("perigee", transfer.final(f * h + g * k), lower=0.0, upper=0.0)
    problem.constraint("side", transfer.final(g * h - k * f), upper=0.0)
    problem.maximize("weight", transfer.final(w))
    problem.guess(throttle=GUESSED_FACTOR)
    times, states, controls = _flight()
    transfer.guess(tf=GUESSED_TIME)
    for name, values in zip((*BOUNDS, "radial", "tangential", "normal"), (*states, *controls), strict=True):
        transfer.guess(**{name: (times, values if name not in BOUNDS else np.clip(values, *BOUNDS[name]))})
    return problem


def _rates(x: list[Any], u: list[Any], factor: Any) -> list[Any]:
    """Rates of the elements and the weight; thrust is radial, tangential and normal."""
    p, f, g, h, k, longitude, w = x
    sin, cos = ca.sin(longitude), ca.cos(longitude)
    q, s2 = 1 + f * cos + g * sin, 1 + h**2 + k**2
    r, root = p / q, ca.sqrt(p / MU)
    # Sines of the latitude, and the northern direction in this frame: both from the inclined plane.
    height = 2 * (h * sin - k * cos) / s2
    north = (2 * (h * cos + k * sin) / s2, (1 - h**2 - k**2) / s2)
    slopes = {2: 3 * height, 3: 0.5 * (15 * height**2 - 3), 4: 0.125 * (140 * height**3 - 60 * height)}
    sizes = {2: 0.5 * (3 * height**2 - 1), 3: 0.5 * (5 * height**3 - 3 * height), 4: 0.125 * (35 * height**4 - 30 * height**2 + 3)}
    # The gravity beyond that of a sphere: -mu/r^2 cos(latitude) P' J (R/r)^j to the north, and mu/r^2 (j + 1) P J (R/r)^j outwards.
    to_north = sum(-MU / r**2 * (EARTH / r) ** j * slopes[j] * ZONAL[j] for j in ZONAL)
    outwards = sum(MU / r**2 * (j + 1) * (EARTH / r) ** j * sizes[j] * ZONAL[j] for j in ZONAL)
    force = GRAVITY * THRUST * (1 + 0.01 * factor) / w
    radial, tangential, normal = outwards + force * u[0], to_north * north[0] + force * u[1], to_north * north[1] + force * u[2]
    turn = h * sin - k * cos
    return [
        2 * p / q * root * tangential,
        root * (sin * radial + ((q + 1) * cos + f) / q * tangential - g / q * turn * normal),
        root * (-cos * radial + ((q + 1) * sin + g) / q * tangential + f / q * turn * normal),
        root * s2 * cos / (2 * q) * normal,
        root * s2 * sin / (2 * q) * normal,
        root * turn / q * normal + ca.sqrt(MU * p) * (q / p) ** 2,
        -THRUST * (1 + 0.01 * factor) / IMPULSE,
    ]


def _along(x: list[Any]) -> list[Any]:
    """The direction of the velocity: radial, tangential and normal."""
    _, f, g, _, _, longitude, _ = x
    radial, tangential = f * ca.sin(longitude) - g * ca.cos(longitude), 1 + f * ca.cos(longitude) + g * ca.sin(longitude)
    size = ca.sqrt(radial**2 + tangential**2)
    return [radial / size, tangential / size, 0 * size]


def _flight() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n,), states (7, n) and controls (3, n) of the guess."""
    from scipy.integrate import solve_ivp  # slow to import

    x = [ca.SX.sym(name) for name in BOUNDS]
    rates = ca.Function("rates", [ca.vertcat(*x)], [ca.vertcat(*_rates(x, _along(x), GUESSED_FACTOR))])
    along = ca.Function("along", [ca.vertcat(*x)], [ca.vertcat(*_along(x))])
    times = np.linspace(0.0, GUESSED_TIME, 401)
    flown = solve_ivp(
        lambda _, state: np.array(rates(state)).ravel(), (0.0, GUESSED_TIME), list(START.values()), t_eval=times, rtol=1e-8, atol=1e-10
    )
    return times, flown.y, np.array(along(flown.y))
