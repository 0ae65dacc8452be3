"""The tables of the re-entry's fronts: rows simulated again, by equations of motion that are written anew here."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from math import degrees, radians

import casadi as ca
import numpy as np
import pytest
from moocore import hypervolume, is_nondominated
from test_reentry import STATES, by_hand

from macs import MACS
from problems import load
from problems.cases.reentry import case1, case2, case3, statement
from transcription import DFET
from transcription.nlp.scalarized import scalarize

LIMITS = {"case1": (200, 280, 2.5), "case2": (150, 250, 1.25), "case3": (200, 280, 2.5)}
ROOMS = {"case1": case1, "case2": case2, "case3": case3}
START = [79248.0, 0.0, 0.0, 7802.88, *np.radians([-1.0, 90.0, 17.4, -75.0])]
END = {0: (24384.0, 914.4), 3: (762.0, 106.68), 4: (np.radians(-5.0), np.radians(1.0))}
STEPS = 20
SIGNS = [-1.0, 1.0, 1.0, 1.0]


def table(case: str) -> np.ndarray:
    with files("problems.cases.reentry").joinpath(f"{case}.csv").open() as file:
        return np.loadtxt(file, delimiter=",", ndmin=2)


def simulated(commands: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All flights at once, by the classical Runge-Kutta method in steps of less than two seconds.

    Parameters
    ----------
    commands : array (k, elements, 2 ends, 2 angles)
        In rad.

    Returns
    -------
    objectives (k, 4), largest limited quantities (3, k), states (n, 8, k)
    """
    count, elements = commands.shape[:2]
    h, y = 2000.0 / elements / STEPS, np.zeros((10, count))
    y[:8] = np.array(START)[:, None]
    worst, states = by_hand(y[:8], commands[:, 0, 0].T)[1], []

    def rates(y: np.ndarray, law: np.ndarray) -> np.ndarray:
        found, (heating, *_) = by_hand(y[:8], law)
        return np.array([*found, heating, np.abs(found[4])])

    for left, right in commands.transpose(1, 2, 3, 0):
        for step in range(STEPS):
            begin, middle, end = (left + (right - left) * (step + share) / STEPS for share in (0.0, 0.5, 1.0))
            k1 = rates(y, begin)
            k2 = rates(y + 0.5 * h * k1, middle)
            k3 = rates(y + 0.5 * h * k2, middle)
            k4 = rates(y + h * k3, end)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            worst = np.maximum(worst, by_hand(y[:8], end)[1])
            states.append(y[:8])
    return np.column_stack([np.degrees(y[2]), 1e-3 * y[8], y[9], worst[0]]), worst, np.array(states)


@pytest.fixture(scope="module", params=LIMITS)
def flights(request) -> tuple[str, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    rows = table(request.param)
    return request.param, rows, simulated(np.radians(rows[:, 4:]).reshape(len(rows), -1, 2, 2))


@pytest.mark.parametrize("case", LIMITS)
def test_the_reference_is_a_front(case):
    rows = table(case)
    front = ROOMS[case].reference()
    np.testing.assert_array_equal(front, rows[:, :4])
    assert len(front) >= 15 and np.isfinite(rows).all()
    assert is_nondominated(front * SIGNS).all()


@pytest.mark.slow
def test_rows_are_flights_within_the_limits(flights):
    case, rows, (objectives, worst, states) = flights
    np.testing.assert_allclose(objectives, rows[:, :4], rtol=1e-3, atol=2e-4)
    assert (worst <= 1.01 * np.array(LIMITS[case])[:, None]).all()
    for k, (target, tolerance) in END.items():
        assert (np.abs(states[-1, k] - target) <= 1.02 * tolerance).all(), STATES[k]
    if case == "case3":
        for zone in case3.ZONES:
            apart = np.hypot(np.degrees(states[:, 1]) - zone.longitude, np.degrees(states[:, 2]) - zone.latitude)
            assert (apart >= 0.99 * zone.radius).all()


def test_zones_cost_and_narrow_limits_too():
    """What is best in one objective in the harder case is no better than in the easier one, but for the margins of the solves."""
    best = {case: (table(case)[:, :4] * SIGNS).min(axis=0) for case in LIMITS}
    assert (best["case2"][:2] >= best["case1"][:2] - [0.1, 1.0]).all()
    assert (best["case3"][:2] >= best["case1"][:2] - [0.1, 1.0]).all()


def test_references_reach_the_corner_in_which_hypervolume_is_measured():
    """And in this order: narrower limits take less away than zones do."""
    volumes = {case: hypervolume(table(case)[:, :4] * SIGNS, ref=[-28.5, 150.0, 1.5, 200.0]) for case in LIMITS}
    assert volumes["case1"] > volumes["case2"] > volumes["case3"] > 20000


def test_flights_of_the_reference_pass_south_of_all_zones(flights):
    case, _, (_, _, states) = flights
    if case == "case3":
        for east, north in np.degrees(states[:, 1:3]).transpose(2, 1, 0):
            assert all(np.interp(zone.longitude, east, north) < zone.latitude for zone in case3.ZONES)


@pytest.mark.slow
def test_points_that_the_default_search_calls_verified_are_right():
    """Each of those that stayed on the mesh of the search, by the equations that are written here."""
    problem = load("reentry_case1")
    given = {"inner": problem.default_inner, "start": problem.default_start, "evaluations": problem.default_evaluations}
    front = MACS().solve(problem, seed=3, **given)
    assert len(front) == 10 and front.verified.sum() >= 8
    kept = [point for point in front if point.verified and point.transcription["settings"]["mesh"] is None]
    laws = np.array([point.trajectory["entry"].control.coefficients for point in kept])
    objectives, worst, states = simulated(laws)
    off = np.abs(objectives * SIGNS - np.array([point.F for point in kept])) / np.ptp(front.F, axis=0)
    assert len(kept) >= 6 and off.max() < 1.1e-3
    assert (worst <= (1 + 1.1e-3) * np.array(LIMITS["case1"])[:, None]).all()
    for k, (target, tolerance) in END.items():
        assert (np.abs(states[-1, k] - target) <= (1 + 1.1e-3) * tolerance).all(), STATES[k]


@pytest.mark.slow
@pytest.mark.parametrize(("passed", "least"), [(0, 6.2), (1, 1.5), (2, 7.9)])
def test_there_is_no_way_north_of_a_zone(passed, least):
    """How many degrees farther south a zone would have to lie for a flight to pass north of it, all limits one per cent wider.

    Those before it are passed on the south, as there is no other way, and those behind it are left out.
    """
    wider, limits, zone = 1.01, case3.LIMITS, case3.ZONES[passed]
    problem = statement.reentry(
        "north",
        statement.Limits(wider * limits.heating_rate, wider * limits.dynamic_pressure, wider * limits.load_factor),
        [replace(before, radius=before.radius / wider) for before in case3.ZONES[:passed]],
        altitude_tolerance=wider * 914.4,
        speed_tolerance=wider * 106.68,
        angle_tolerance=wider * radians(1.0),
    )
    entry, south = problem.phases["entry"], problem.parameter("south", bounds=(0.0, 60.0), scale=1.0)
    apart = degrees(1.0) * entry["longitude"] - zone.longitude, degrees(1.0) * entry["latitude"] - (zone.latitude - south)
    entry.path("distance from the zone", ca.hypot(*apart), lower=zone.radius / wider, scale=zone.radius)
    problem.minimize("south", south)
    nlp = DFET(60, 2, control_order=1, basis="bernstein").transcribe(problem)
    found = []
    for row in table("case3")[::30]:
        laws, candidate = np.radians(row[4:]).reshape(-1, 2), np.full(len(nlp.free), 40.0)
        for profile, law in zip(nlp.profiles, laws.T, strict=True):
            candidate[profile.columns] = law
        start = nlp.propagate(nlp.first_guess(candidate[None]))[0]
        only = np.append(np.full(4, np.inf), 0.0)
        solved = scalarize(nlp, start, reference=only, weights=np.eye(5)[4], max_iterations=200)
        found += [solved.F[4]] if solved.status == "converged" else []
    assert len(found) >= 3 and min(found) > least
