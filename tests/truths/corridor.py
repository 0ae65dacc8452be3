"""Width of the entry corridor of `aerocapture_codesign` by passages from the entry on: the program that made the table beside the case.

    python tests/truths/corridor.py [--out FILE.csv]

For each of the ballistic coefficients and lifts over drag the shallowest and the steepest path angle at the entry are roots, of which each
trial is a flight in the simplified equations of `passage`, over time. The table that is there is of a former program, which followed
passages from the exit with steps that were a little long: it differs by 0.001 deg up to a lift over drag of 0.8, and by 0.012 deg at 0.9.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from problems.cases.aerocapture import codesign
from problems.cases.aerocapture.codesign import BALLISTIC, RATIO

MU, TOP, TARGET, HEIGHT, DENSITY = 4.2828e13, 3490.7e3, 3590.7e3, 8.92e3, 3.17e-7
"""As printed there."""


def exit_apoapsis(entry_angle: float, ballistic: float, lift: float) -> float:
    """Altitude of the apoapsis over the target, m, of a planar passage with constant lift; far above if it escapes, far below if it does
    not leave the air."""
    weight = MU / TOP**2

    def slope(_, y):
        h, v, g = y.tolist()
        drag = 0.5 * DENSITY * math.exp(-h / HEIGHT) * v**2 / ballistic
        turn = lift * drag / v + (v / TOP - weight / v) * math.cos(g)
        return [v * math.sin(g), -drag - weight * math.sin(g), turn]

    def out(_, y):
        return y[0]

    def crash(_, y):
        return y[0] + 150e3

    out.terminal, out.direction, crash.terminal = True, 1, True
    begin = [0.0, np.sqrt(25e6 + 2 * MU / TOP), entry_angle]
    flown = solve_ivp(slope, (0, 1e4), begin, method="DOP853", rtol=1e-10, atol=[1e-4, 1e-7, 1e-12], events=[out, crash])
    if not len(flown.t_events[0]):
        return -1e6
    _, v, g = flown.y[:, -1]
    energy, momentum = v**2 / 2 - MU / TOP, TOP * v * np.cos(g)
    if energy >= 0:
        return 1e6
    return -MU / (2 * energy) * (1 + np.sqrt(max(1 + 2 * energy * momentum**2 / MU**2, 0.0))) - TARGET


def edge(ballistic: float, lift: float) -> float:
    """Path angle at the entry, deg, from which constant lift over drag that points upward leads to the target orbit."""
    return math.degrees(brentq(exit_apoapsis, math.radians(-40.0), math.radians(-4.0), args=(ballistic, lift), xtol=1e-10))


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
