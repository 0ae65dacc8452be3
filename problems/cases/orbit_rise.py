"""Low-thrust orbit rise: least time against greatest final energy.

Ricciardi, Vasile and Maddock, "Global solution of multi-objective optimal control problems with multi agent collaborative search and
direct finite elements transcription", IEEE CEC 2016, eqs. (17)-(19), after Herman and Conway, "Direct optimization using collocation based
on high-order Gauss-Lobatto quadrature rules", JGCD 19(3), 1996. Non-dimensional. The bounds of the states are those of the authors'
published implementation and belong to the problem: without them a coarse mesh has spurious optima near the origin.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import casadi as ca
import numpy as np

from ..problem import Problem

ACCELERATION = 1e-2
START_RADIUS = 1.1


def problem() -> Problem:
    """The case with the thrust angle in [0, pi], as the authors' implementation has it."""
    return _orbit_rise("orbit_rise", (0.0, ca.pi), None)


def problem_full() -> Problem:
    """The case with the thrust angle in [-pi, pi], as the paper has it: any direction, declared periodic."""
    return _orbit_rise("orbit_rise_full", (-ca.pi, ca.pi), 2 * ca.pi)


def reference() -> np.ndarray:
    """The true front by indirect shooting on the necessary conditions, one solve for each flight time from 20 to 80 in steps of 0.25.

    The table beside this file also has the initial costates, from which each row can be checked by integrating state and costate: at
    the end the costate is the gradient of the energy.

    Returns
    -------
    array (241, 2)
        Flight time and final energy, as the user sees them.
    """
    return reference_with_costates()[:, :2]


def reference_with_costates() -> np.ndarray:
    """The rows of `reference` with the initial costates of r, vr and vt, shape (241, 5)."""
    return np.loadtxt(Path(__file__).with_name("orbit_rise_front.csv"), delimiter=",", skiprows=1)


LAW = "indirect shooting"
"""The method of `optimal_flight`."""


def optimal_flight(flight_time: float, points: int = 201) -> dict[str, np.ndarray]:
    """The flight of greatest final energy in a given time, by indirect shooting from the costates of the nearest row of the table.

    Parameters
    ----------
    flight_time : float
        From 20 to 80 TU, as in the table.
    points : int
        At how many times, evenly.

    Returns
    -------
    dict of arrays (points,)
        "time", the states "r", "vr", "theta", "vt", and the control "u".

    Raises
    ------
    ValueError
        Outside the times of the table.
    """
    from scipy.integrate import solve_ivp  # slow to import
    from scipy.optimize import root

    table = reference_with_costates()
    if not table[0, 0] <= flight_time <= table[-1, 0]:
        raise ValueError(f"orbit_rise: the flight time must be from {table[0, 0]:g} to {table[-1, 0]:g} TU, not {flight_time}")
    times = np.linspace(0.0, flight_time, points)

    def propagated(costate: np.ndarray) -> np.ndarray:
        start = np.array([START_RADIUS, 0.0, 0.0, START_RADIUS**-0.5, *costate])
        return solve_ivp(_with_costates, (0.0, flight_time), start, "DOP853", times, rtol=1e-11, atol=1e-12).y

    def missing(costate: np.ndarray) -> np.ndarray:
        r, vr, _, vt, *last = propagated(costate)[:, -1]
        return np.array(last) - [1 / r**2, vr, vt]  # at the end the costate is the gradient of the energy

    found = root(missing, [np.interp(flight_time, table[:, 0], column) for column in table[:, 2:].T], tol=1e-11)
    r, vr, theta, vt, _, toward_vr, toward_vt = propagated(found.x)
    return {"time": times, "r": r, "vr": vr, "theta": theta, "vt": vt, "u": np.arctan2(toward_vt, toward_vr)}


def track(states: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Where a flight is in the plane of its orbit, of its states by name."""
    return {"r cos theta [DU]": states["r"] * np.cos(states["theta"]), "r sin theta [DU]": states["r"] * np.sin(states["theta"])}


def derived(states: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The energy along a flight, of its states by name."""
    return {"energy [DU²/TU²]": 0.5 * (states["vr"] ** 2 + states["vt"] ** 2) - 1.0 / states["r"]}


def _with_costates(_: float, x: np.ndarray) -> list[float]:
    """Rates of r, vr, theta, vt and of the costates of r, vr, vt (that of theta is zero), with thrust along those of the velocities."""
    r, vr, _theta, vt, by_r, by_vr, by_vt = x
    thrust = ACCELERATION / np.hypot(by_vr, by_vt)
    return [
        vr,
        vt**2 / r - 1 / r**2 + thrust * by_vr,
        vt / r,
        -vt * vr / r + thrust * by_vt,
        by_vr * (vt**2 / r**2 - 2 / r**3) - by_vt * vt * vr / r**2,
        -by_r + by_vt * vt / r,
        -2 * by_vr * vt / r + by_vt * vr / r,
    ]


def _orbit_rise(name: str, angles: tuple[float, float], period: float | None) -> Problem:
    problem = Problem(name)
    rise = problem.phase("rise", t0=0.0, tf=(20.0, 80.0), time_unit="TU")
    r = rise.state("r", bounds=(0.1, 20), initial=START_RADIUS, unit="DU")
    vr = rise.state("vr", bounds=(-1, 1), initial=0, unit="DU/TU")
    rise.state("theta", bounds=(-ca.pi, 10 * ca.pi), initial=0, unit="rad")
    vt = rise.state("vt", bounds=(-1, 1), initial=START_RADIUS**-0.5, unit="DU/TU")
    u = rise.control("u", bounds=angles, unit="rad", period=period)
    rise.dynamics(
        r=vr,
        vr=vt**2 / r - 1 / r**2 + ACCELERATION * ca.cos(u),
        theta=vt / r,
        vt=-vt * vr / r + ACCELERATION * ca.sin(u),
    )
    problem.minimize("flight time", rise.tf, unit="TU")
    problem.maximize("final energy", rise.final((vr**2 + vt**2) / 2 - 1 / r), unit="DU2/TU2")
    problem.default_transcription = "dfet:30x1"
    problem.default_evaluations = 10_000
    return problem
