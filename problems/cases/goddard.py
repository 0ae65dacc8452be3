"""Ascent from a flat airless body: least time against greatest horizontal speed at a given height.

Ricciardi, Vasile and Maddock, "Global solution of multi-objective optimal control problems with multi agent collaborative search and
direct finite elements transcription", IEEE CEC 2016, eqs. (14)-(16). Constants, horizon and control bounds are the paper's; the bounds of
the states are those of its authors' published implementation.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import atanh, cosh, sinh

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from ..problem import Problem

GRAVITY = 1.6e-3
THRUST = 4e-3
HEIGHT = 10.0
MESH_ERROR = 1e-3
"""By how much, relatively, a flight on a coarse mesh may be shorter than any real one."""


def problem() -> Problem:
    """The case, with the paper's mesh and budget as defaults."""
    problem = Problem("goddard")
    ascent = problem.phase("ascent", t0=0.0, tf=(100.0, 250.0))
    ascent.state("x", bounds=(-1, 200), initial=0, unit="km")
    vx = ascent.state("vx", bounds=(-10, 10), initial=0, unit="km/s")
    ascent.state("y", bounds=(-1, 11), initial=0, final=HEIGHT, unit="km")
    vy = ascent.state("vy", bounds=(-10, 10), initial=0, final=0, unit="km/s")
    u = ascent.control("u", bounds=(-ca.pi / 2, ca.pi / 2), unit="rad")
    ascent.dynamics(x=vx, vx=THRUST * ca.cos(u), y=vy, vy=THRUST * ca.sin(u) - GRAVITY)
    problem.minimize("flight time", ascent.tf, unit="s")
    problem.maximize("horizontal speed", ascent.final(vx), unit="km/s")
    problem.default_transcription = "dfet:4x6"
    problem.default_evaluations = 10_000
    return problem


def shortest_time() -> float:
    """The least flight time: full thrust up, then full thrust down (bang-bang), at no horizontal speed."""
    up, down = THRUST - GRAVITY, THRUST + GRAVITY
    return float(np.sqrt(2 * HEIGHT * (1 / up + 1 / down)))


def reference(points: int = 2001, longest: float = 250.0) -> np.ndarray:
    """The true front in closed form, by the linear tangent law tan u = c0 - c1 t (Bryson and Ho, "Applied Optimal Control", 2.7).

    Parameters
    ----------
    points : int
        How many, at equal steps of the squared root of the time above the least one, which resolves the steep end.
    longest : float
        Flight time of the last one, s.

    Returns
    -------
    array (points, 2)
        Flight time and horizontal speed, as the user sees them. The first is the bang-bang limit, with no horizontal speed.
    """
    first = shortest_time()
    times = first + (longest - first) * np.linspace(0.0, 1.0, points)[1:] ** 2
    return np.array([(first, 0.0), *((tf, _speed(tf)) for tf in times)])


LAW = "linear tangent law"
"""The method of `optimal_flight`."""


def optimal_flight(flight_time: float, points: int = 201) -> dict[str, np.ndarray]:
    """The flight of greatest horizontal speed in a given time, in closed form: the linear tangent law.

    Parameters
    ----------
    flight_time : float
        At least `shortest_time()`, s; what a coarse mesh makes a little shorter counts as that.
    points : int
        At how many times, evenly.

    Returns
    -------
    dict of arrays (points,)
        "time", the states "x", "vx", "y", "vy", and the control "u".

    Raises
    ------
    ValueError
        If there is no flight as short as that.
    """
    shortest = shortest_time()
    if not flight_time >= (1.0 - MESH_ERROR) * shortest:
        raise ValueError(f"goddard: no flight takes {flight_time} s, the shortest one takes {shortest:.6f} s")
    flight_time = max(flight_time, shortest)
    t = np.linspace(0.0, flight_time, points)
    a, b = _ends(flight_time)
    p, q = np.sinh(a), np.sinh(b)
    # In terms of the tangent z, k = dt/dz: the integrals of cos u and sin u are those of 1/sqrt(1 + z^2) and z/sqrt(1 + z^2).
    k, z = flight_time / (p - q), p + (q - p) * t / flight_time
    root, first = np.sqrt(1.0 + z**2), np.cosh(a)
    return {
        "time": t,
        "x": THRUST * k**2 * (z * np.arcsinh(z) - root - z * a + first),
        "vx": THRUST * k * (a - np.arcsinh(z)),
        "y": THRUST * k**2 * ((p - z) * first - 0.5 * (p * first + a - z * root - np.arcsinh(z))) - 0.5 * GRAVITY * t**2,
        "vy": THRUST * k * (first - root) - GRAVITY * t,
        "u": np.arctan(z),
    }


def track(states: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Distance and height of a flight, of its states by name."""
    return {f"{name} [km]": states[name] for name in ("x", "y")}


def _speed(tf: float) -> float:
    """Greatest final horizontal speed in a flight of duration `tf`."""
    a, b = _ends(tf)
    return float(THRUST * tf * (a - b) / (np.sinh(a) - np.sinh(b)))


def _ends(tf: float) -> tuple[float, float]:
    """The inverse hyperbolic sines of the tangent of the thrust angle, at the beginning and at the end of a flight of duration `tf`."""
    # The tangent z = tan u runs linearly from p = sinh a to q = sinh b, so dt = tf/(p - q) dz, and sin u = z/sqrt(1 + z^2). vy(tf) = 0
    # means that the mean of sin u, (cosh a - cosh b)/(sinh a - sinh b) = tanh((a + b)/2), is g/THRUST: the sum of a and b is known, and
    # the height fixes their difference.
    total = 2.0 * atanh(GRAVITY / THRUST)

    def missing_height(difference: float) -> float:
        a, b = 0.5 * (total + difference), 0.5 * (total - difference)
        p, q = sinh(a), sinh(b)
        # The time to go is proportional to z - q; this is the integral of (z - q) z/sqrt(1 + z^2) from q to p.
        antiderivative = 0.25 * (sinh(2 * a) - sinh(2 * b)) - 0.5 * (a - b) - q * (cosh(a) - cosh(b))
        return THRUST * tf**2 * antiderivative / (p - q) ** 2 - 0.5 * GRAVITY * tf**2 - HEIGHT

    difference = brentq(missing_height, 1e-3, 200.0, xtol=1e-13, rtol=1e-14)
    return 0.5 * (total + difference), 0.5 * (total - difference)
