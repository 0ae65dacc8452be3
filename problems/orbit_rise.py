"""Low-thrust orbit rise: least time against greatest final energy.

Ricciardi, Vasile and Maddock, "Global solution of multi-objective optimal control problems with multi agent collaborative search and
direct finite elements transcription", IEEE CEC 2016, eqs. (17)-(19), after Herman and Conway, "Direct optimization using collocation based
on high-order Gauss-Lobatto quadrature rules", JGCD 19(3), 1996. Non-dimensional. The bounds of the states are those of the authors'
published implementation and belong to the problem: without them a coarse mesh has spurious optima near the origin.
"""

from __future__ import annotations

from importlib.resources import files

import casadi as ca
import numpy as np

from .problem import Problem

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

    The table beside this file also holds the initial costates, from which anyone can check each row by integrating state and costate: at
    the end the costate is the gradient of the energy.

    Returns
    -------
    array (241, 2)
        Flight time and final energy, as the user sees them.
    """
    return reference_with_costates()[:, :2]


def reference_with_costates() -> np.ndarray:
    """The rows of `reference` with the initial costates of r, vr and vt, shape (241, 5)."""
    with files("problems").joinpath("orbit_rise_front.csv").open() as file:
        return np.loadtxt(file, delimiter=",", skiprows=1)


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
    problem.verify_tolerance = 3e-2
    return problem
