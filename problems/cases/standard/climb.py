"""Minimum time to climb: a supersonic aircraft from the runway to 65,600 ft at Mach 1.

Bryson, Desai and Hoffman, "Energy-state approximation in performance optimization of supersonic aircraft", Journal of Aircraft 6(6), 1969:
airplane 2. The optimum depends on how its tables are interpolated, in the third digit: Betts 2010 has 324.975 s, PSOPT 321.1 s, YAPSS
320.46 s. Here they are as in YAPSS: cubic splines, with pairs of points close together where a table has a corner, and radial functions for
the thrust, of which the original table has a part only.
"""

from __future__ import annotations

from math import pi, radians

import casadi as ca
import numpy as np

from ...problem import Problem
from .published import optimum

AREA, GRAVITY, IMPULSE, WEIGHT = 530.0, 32.174, 1600.0, 42000.0
NEAR = 1e-5
"""Distance of two points at a corner."""
GRID = 47
"""Points of the thrust's spline in each direction: the optimum is that of the function itself to 1e-5."""
MACH = {
    "lift slope": (
        (0, 0.4, 0.8, 0.84 - NEAR, 0.84, 0.9, 1.0, 1.2, 1.4, 1.6, 1.8),
        (3.44, 3.44, 3.44, 3.44, 3.44, 3.58, 4.44, 3.44, 3.01, 2.86, 2.44),
    ),
    "drag": (
        (0, 0.4, 0.8, 0.86 - NEAR, 0.86, 0.9, 1.0, 1.2, 1.4, 1.6, 1.8),
        (0.013, 0.013, 0.013, 0.013, 0.013, 0.014, 0.031, 0.041, 0.039, 0.036, 0.035),
    ),
    "induced": (
        (0, 0.4, 0.8 - NEAR, 0.8, 0.9, 1.0, 1.0 + NEAR, 1.2 - NEAR, 1.2, 1.4, 1.6, 1.6 + NEAR, 1.8 - NEAR, 1.8),
        (0.54, 0.54, 0.54, 0.54, 0.74, 0.79, 0.79 - NEAR / 10, 0.78 + NEAR / 10, 0.78, 0.89, 0.93, 0.93, 0.93, 0.93),
    ),
}
"""Functions of the Mach number: points and values."""
ALTITUDES = 5000.0 * np.arange(19)
DENSITY = 1e-5 * np.array(
    (237.7, 204.8, 175.6, 149.6, 126.7, 106.6, 89.07, 73.82, 58.73, 46.23, 36.39, 28.65, 22.56, 17.77, 13.92, 10.91, 8.571, 6.743, 5.315)
)
SOUND = (1116.5, 1097.1, 1077.4, 1057.4, 1036.9, 1016.1, 994.8, 973.1, *[968.1] * 6, 970.9, 974.3, 977.6, 981.0, 984.3)
"""Air, in slugs/ft3 and ft/s."""
THRUST_MACH, THRUST_ALTITUDE = 0.2 * np.arange(10), 1000.0 * np.array((0, 5, 10, 15, 20, 25, 30, 40, 50, 70))
THRUST = (
    (24.2,),
    (28.0, 24.6, 21.1, 18.1, 15.2, 12.8, 10.7),
    (28.3, 25.2, 21.9, 18.7, 15.9, 13.4, 11.2, 7.3, 4.4),
    (30.8, 27.2, 23.8, 20.5, 17.3, 14.7, 12.3, 8.1, 4.9),
    (34.5, 30.3, 26.6, 23.2, 19.8, 16.8, 14.1, 9.4, 5.6, 1.1),
    (37.9, 34.3, 30.4, 26.8, 23.3, 19.8, 16.8, 11.2, 6.8, 1.4),
    (36.1, 38.0, 34.9, 31.3, 27.3, 23.6, 20.1, 13.4, 8.3, 1.7),
    (None, 36.6, 38.5, 36.1, 31.6, 28.1, 24.2, 16.2, 10.0, 2.2),
    (None, None, None, 38.7, 35.7, 32.0, 28.1, 19.3, 11.9, 2.9),
    (None, None, None, None, None, 34.6, 31.1, 21.7, 13.3, 3.1),
)
"""Thousands of pounds, for each Mach number at rising altitudes; None where the table has no entry."""


@optimum("time", 320.4588, 0.02, "YAPSS 0.2.3, example minimum_time_to_climb: 320.4588")
def climb() -> Problem:
    """The quickest climb of a supersonic aircraft, with tables.

    In feet, slugs, seconds and radians.
    """
    problem = Problem("climb")
    climb = problem.phase("climb", t0=0.0, tf=(100.0, 800.0))
    h = climb.state("altitude", bounds=(0, 69000), initial=0, final=65600, unit="ft")
    v = climb.state("speed", bounds=(1, 2000), initial=424.26, final=968.148, unit="ft/s")
    path = climb.state("path angle", bounds=(-radians(40), radians(40)), initial=0, final=0, unit="rad")
    mass = climb.state("mass", bounds=(10, 45000 / GRAVITY), initial=WEIGHT / GRAVITY, unit="slug")
    attack = climb.control("attack", bounds=(-pi / 4, pi / 4), unit="rad")
    mach = v / _spline("sound", ALTITUDES, SOUND)(h)
    slope, drag, induced = (_spline(name.replace(" ", "_"), *MACH[name])(mach) for name in MACH)
    pressure = 0.5 * _spline("density", ALTITUDES, DENSITY)(h) * v**2 * AREA
    push = _thrust()(ca.vertcat(mach, h))
    climb.dynamics(
        **{
            "altitude": v * ca.sin(path),
            "speed": (push * ca.cos(attack) - pressure * (drag + induced * slope * attack**2)) / mass - GRAVITY * ca.sin(path),
            "path angle": (push * ca.sin(attack) + pressure * slope * attack) / (mass * v) - GRAVITY * ca.cos(path) / v,
            "mass": -push / (GRAVITY * IMPULSE),
        }
    )
    problem.minimize("time", climb.tf, unit="s")
    climb.guess(altitude=(0, 65600), speed=(424.26, 968.148), **{"path angle": 0}, mass=WEIGHT / GRAVITY, attack=0, tf=300.0)
    return problem


def _thrust() -> ca.Function:
    """Thrust in pounds over Mach number and altitude: cubes of distances from the entries of the table, and a spline through a grid."""
    from scipy.interpolate import RBFInterpolator  # slow to import

    entries = [
        (mach / THRUST_MACH[-1], altitude / THRUST_ALTITUDE[-1], 1000 * value)
        for mach, row in zip(THRUST_MACH, THRUST, strict=True)
        for altitude, value in zip(THRUST_ALTITUDE, row, strict=False)
        if value is not None
    ]
    entry = np.array(entries)
    machs, altitudes = np.linspace(-0.1, 2.2, GRID), np.linspace(-10000.0, 80000.0, GRID)
    places = np.column_stack([np.tile(machs, GRID) / THRUST_MACH[-1], np.repeat(altitudes, GRID) / THRUST_ALTITUDE[-1]])
    values = RBFInterpolator(entry[:, :2], entry[:, 2], kernel="cubic")(places)
    return ca.interpolant("thrust", "bspline", [machs.tolist(), altitudes.tolist()], values.tolist())


def _spline(name: str, points: np.ndarray | tuple[float, ...], values: np.ndarray | tuple[float, ...]) -> ca.Function:
    """The cubic spline of a table, prolonged on both sides: what is tried there is nonsense, but has to be a number."""
    from scipy.interpolate import CubicSpline  # slow to import

    beyond = 0.2 * (points[-1] - points[0])
    outside = np.array([points[0] - beyond, points[-1] + beyond])
    before, after = CubicSpline(points, values)(outside)
    return ca.interpolant(name, "bspline", [[outside[0], *points, outside[1]]], [before, *values, after])
