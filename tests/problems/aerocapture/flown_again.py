"""Flights over the round planet again, in Cartesian coordinates, by code of its own and from the bank angle alone."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from truths.corridor import DENSITY, ENTRY_SPEED, HEIGHT, MU, RADIUS, TARGET, TOP, heating
from vectors import cross, norm

from problems.cases.aerocapture.capsule import lift_and_drag
from problems.cases.aerocapture.designs import shapes_of

MASS = 946.0
CIRCULAR = np.sqrt(MU / TARGET)
NAMES = ("altitude", "longitude", "latitude", "speed", "flight-path angle", "heading")


def areas(design) -> tuple[float, float, float]:
    """Lift and drag areas over the mass, m2/kg, and nose radius, m, of a capsule by its five variables."""
    shapes, attack = shapes_of(np.array([design]))
    return *(float(c[0]) * np.pi * float(shapes.base[0]) ** 2 / MASS for c in lift_and_drag(shapes, attack)), float(shapes.nose[0])


def flown_again(flight, lift: float, drag: float, nose: float) -> tuple[np.ndarray, np.ndarray]:
    """Position, velocity and heat load (7,) at the entry and where the air is left; lift and drag areas are over the mass, m2/kg."""
    first, end = flight.at(0.0), flight.tf
    column = [state.name for state in flight.state_variables].index("bank angle")
    h, lon, lat, v, path, heading = (float(first[n]) for n in NAMES)
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    velocity = v * (np.sin(path) * up + np.cos(path) * (np.sin(heading) * east + np.cos(heading) * np.cross(up, east)))
    assert v == pytest.approx(ENTRY_SPEED, rel=1e-9)

    def slope(t, y):
        r, w = y[:3], y[3:6]
        distance, speed = norm(r), norm(w)
        rho = DENSITY * math.exp(-(distance - TOP) / HEIGHT)
        along, right = w / speed, cross(w, r) / norm(cross(w, r))
        bank = flight.state(np.array(min(t, end)))[column]
        side = math.cos(bank) * cross(right, along) + math.sin(bank) * right
        return [*w, *(0.5 * rho * speed**2 * (lift * side - drag * along) - MU / distance**3 * r), heating(rho, speed, nose)]

    def out(t, y):
        return norm(y[:3]) - TOP if t > 100.0 else -1.0

    out.terminal = True
    # Where the lift is downward for long, errors grow. The bank angle is smooth between the ends of elements, so steps end there: across
    # them, flights of one front differ by kilometres at the apoapsis with the step, within elements by metres.
    settings = {"method": "DOP853", "rtol": 1e-13, "atol": [1e-5] * 3 + [1e-8] * 3 + [1e-3], "max_step": 2.0}
    begin = y = np.array([*(RADIUS + h) * up, *velocity, 0.0])
    begun = 0.0
    for until in [*flight.state.edges[1:-1], end + 60]:
        flown = solve_ivp(slope, (begun, until), y, events=out, **settings)
        if flown.status == 1:
            break
        y, begun = flown.y[:, -1], until
    assert flown.status == 1
    return begin, flown.y[:, -1]


def confirm(point, design) -> np.ndarray:
    """Raise AssertionError unless a point is flown again as it says, to the polar orbit; the state at the entry."""
    begin, end = flown_again(point.trajectory["atmosphere"], *areas(design))
    r, v = end[:3], end[3:6]
    momentum, energy = np.cross(r, v), v @ v / 2 - MU / norm(r)
    apoapsis = -MU / (2 * energy) * (1 + norm(np.cross(v, momentum) / MU - r / norm(r)))
    assert apoapsis == pytest.approx(TARGET, abs=500.0)
    assert np.degrees(np.arccos(momentum[2] / norm(momentum))) == pytest.approx(90.0, abs=0.01)
    # A flight of least delta v is unstable: it misses the apoapsis a little, by another speed at the exit. For an exit that is nearly level
    # d(delta v) / d(apoapsis) = h / r_a^2 - r / (r_a dr_a/dv), with dr_a/dv = 4 a^2 v / mu.
    per_metre = norm(momentum) / apoapsis**2 - norm(r) / apoapsis * energy**2 / (MU * norm(v))
    burn = point.objectives["delta v"] + per_metre * (apoapsis - TARGET)
    assert CIRCULAR - norm(momentum) / apoapsis == pytest.approx(burn, abs=0.01)
    assert 0.091 * end[6] ** 0.51575 == pytest.approx(point.objectives["TPS mass fraction"], abs=0.002)
    return begin
