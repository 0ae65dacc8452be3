"""A winged vehicle over a planet that turns, against what an observer who does not turn sees."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from problems.cases.reentry import MASS, SHUTTLE
from problems.cases.winged import STATES

TURNING = replace(SHUTTLE, turning=7.2921151e-5)
START = [1.5e6, 0.3, 0.5, 7000.0, 0.2, 0.9]


def flown(vehicle, seconds: float, bank: float = -1.0, start: list[float] = START) -> np.ndarray:
    def rates(_: float, y: np.ndarray) -> list[float]:
        found = vehicle.rates(dict(zip(STATES, y, strict=True)), 0.3, bank, MASS)
        return [float(found[name]) for name in STATES]

    return solve_ivp(rates, (0, seconds), start, method="DOP853", rtol=1e-11, atol=1e-9).y[:, -1]


def seen_from_outside(vehicle, y: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity in a frame that does not turn, of a state over the ground at a time."""
    h, lon, lat, v, path, heading = y
    lon = lon + vehicle.turning * t
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    east = np.array([-math.sin(lon), math.cos(lon), 0.0])
    north = np.cross(up, east)
    position = (vehicle.radius + h) * up
    over_ground = v * (math.sin(path) * up + math.cos(path) * (math.sin(heading) * east + math.cos(heading) * north))
    return position, over_ground + np.cross([0.0, 0.0, vehicle.turning], position)


def test_without_bank_the_flight_stays_in_its_vertical_plane():
    """Along the equator; and anywhere on a great circle, by Clairaut's relation."""
    along = flown(SHUTTLE, 800.0, 0.0, [79e3, 0.0, 0.0, 7800.0, -0.017, math.pi / 2])
    assert abs(along[2]) < 1e-12 and along[5] == pytest.approx(math.pi / 2, abs=1e-12) and along[1] > 0.8
    end = flown(SHUTTLE, 800.0, 0.0, [79e3, 0.0, 0.2, 7800.0, -0.017, 1.0])
    assert end[2] > 0.4
    assert math.cos(end[2]) * math.sin(end[5]) == pytest.approx(math.cos(0.2) * math.sin(1.0), rel=1e-9)


def test_a_planet_that_turns_changes_no_orbit():
    """Energy and angular momentum, all three components of it, are those of Kepler's motion, seen from outside."""

    def invariants(y: np.ndarray, t: float) -> list[float]:
        r, v = seen_from_outside(TURNING, y, t)
        return [v @ v / 2 - TURNING.mu / np.linalg.norm(r), *np.cross(r, v)]

    end = flown(TURNING, 1500.0)
    still = flown(SHUTTLE, 1500.0)
    assert np.abs(end[:3] - still[:3]).max() > 1e3, "the turning must be seen over the ground"
    np.testing.assert_allclose(invariants(end, 1500.0), invariants(np.array(START), 0.0), rtol=1e-9)


def test_thrust_works_along_the_axis():
    """What it adds to the rates of speed and path angle is its force along the velocity and upward, over the mass."""
    state = dict(zip(STATES, START, strict=True))
    with_thrust, without = (SHUTTLE.rates(state, 0.3, -1.0, MASS, thrust) for thrust in (1e6, 0.0))
    added = {name: float(with_thrust[name] - without[name]) for name in STATES}
    np.testing.assert_allclose(added["speed"], 1e6 * math.cos(0.3) / MASS, rtol=1e-9)
    np.testing.assert_allclose(added["flight-path angle"], 1e6 * math.sin(0.3) / (MASS * START[3]), rtol=1e-6)
    assert all(added[name] == 0 for name in ("altitude", "longitude", "latitude", "heading"))
