"""Width of the entry corridor of `aerocapture_codesign` by passages from the entry on: the program that made the table beside the case.

    python tests/truths/corridor.py [--out FILE.csv]

For each of the ballistic coefficients and lifts over drag the shallowest and the steepest path angle at the entry are roots, of which each
trial is a flight in the simplified equations of `passage`, over time. The table that is there is of a former program, which followed
passages from the exit with steps that were a little long: it differs by 0.001 deg up to a lift over drag of 0.8, and by 0.012 deg at 0.9.
"""

import argparse
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from problems.cases.aerocapture import codesign
from problems.cases.aerocapture.codesign import BALLISTIC, RATIO

MU, RADIUS, HEIGHT, DENSITY = 4.2828e13, 3390.7e3, 8.92e3, 3.17e-7
TOP, TARGET = RADIUS + 100e3, RADIUS + 200e3
ENTRY_SPEED = np.sqrt(25e6 + 2 * MU / TOP)


def heating(rho: float, v: float, nose: float = 1.0) -> float:
    return 1.35e-8 * math.sqrt(rho / nose) * v**3.04 * (1 - 1.395e6 / (v**2 / 2))


def planar(
    entry_angle: float, ballistic: float, upward: Callable[[float], float], density: float = DENSITY, floor: float = 5e3
) -> tuple[np.ndarray | None, float]:
    """A flight with gravity and curvature of the interface, by DOP853: where the air is left, altitude above the interface, speed, path
    angle and heat load (4,), or None if it comes below a floor, m; and the least altitude, m. `upward` is the lift over drag that points
    upward over time."""

    def slope(t, y):
        h, v, g, _ = y.tolist()
        rho = density * math.exp(-h / HEIGHT)
        turn = rho * v * upward(t) / (2 * ballistic) + (v / TOP - MU / TOP**2 / v) * math.cos(g)
        return [v * math.sin(g), -rho * v**2 / (2 * ballistic) - MU / TOP**2 * math.sin(g), turn, heating(rho, v)]

    def out(t, y):
        return y[0] if t > 20.0 else -1.0

    def down(_, y):
        return y[0] + 100e3 - floor

    def level(_, y):
        return y[2]

    out.terminal = down.terminal = True
    out.direction = level.direction = 1
    begin, atol = [0.0, ENTRY_SPEED, entry_angle, 0.0], [1e-5, 1e-8, 1e-12, 1e-6]
    found = solve_ivp(slope, (0, 1e4), begin, method="DOP853", rtol=1e-11, atol=atol, events=[out, down, level])
    assert found.status == 1
    return found.y[:, -1] if len(found.t_events[0]) else None, min((y[0] for y in found.y_events[2]), default=0.0) + 100e3


def apoapsis(speed: float, path_angle: float) -> float:
    """Radius of the apoapsis, m, of the orbit after an exit; infinite on a hyperbola."""
    energy, momentum = speed**2 / 2 - MU / TOP, TOP * speed * np.cos(path_angle)
    return -MU / (2 * energy) * (1 + np.sqrt(max(1 + 2 * energy * momentum**2 / MU**2, 0.0))) if energy < 0 else np.inf


def above_target(entry_angle: float, ballistic: float, lift: float) -> float:
    """How far the apoapsis is above the target, m, with constant lift; far above if it escapes, far below if it does not leave the air."""
    end, _ = planar(entry_angle, ballistic, lambda _: lift, floor=-50e3)  # steep ones dip below the ground
    return -1e6 if end is None else min(apoapsis(end[1], end[2]) - TARGET, 1e6)


def edge(ballistic: float, lift: float) -> float:
    """Path angle at the entry, deg, from which constant lift over drag that points upward leads to the target orbit."""
    return math.degrees(brentq(above_target, math.radians(-40.0), math.radians(-4.0), args=(ballistic, lift), xtol=1e-10))


def width(ballistic: float, ratio: float) -> float:
    """Width of the corridor, deg."""
    return edge(ballistic, -ratio) - edge(ballistic, ratio)


def series(degrees: tuple[int, int]) -> np.ndarray:
    """Coefficients in Chebyshev polynomials of the logarithm of the ballistic coefficient and of lift over drag, from values at nodes."""
    (low, high), (least, most) = np.log(BALLISTIC), RATIO
    places = [np.cos(np.pi * np.arange(degree + 1) / degree) for degree in degrees]
    ballistic, ratio = np.exp(low + 0.5 * (high - low) * (1.0 + places[0])), least + 0.5 * (most - least) * (1.0 + places[1])
    values = np.array([[width(one, other) for other in ratio] for one in ballistic])
    left, right = (np.linalg.inv(np.polynomial.chebyshev.chebvander(place, degree)) for place, degree in zip(places, degrees, strict=True))
    return left @ values @ right.T


HEAD = """aerocapture_codesign: width of the entry corridor, deg, as coefficients of products of Chebyshev polynomials in the logarithm of
the ballistic coefficient (rows) and in lift over drag (columns), each over its range; made again by: python tests/truths/corridor.py"""

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make the table of the entry corridor again.")
    parser.add_argument("--out", default=Path(codesign.__file__).with_name("corridor.csv"))
    np.savetxt(parser.parse_args().out, series((5, 9)), fmt="%.17g", delimiter=",", header=HEAD)
