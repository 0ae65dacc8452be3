"""Ascent, orbit rise and landing sites: statements against the papers, true fronts against other code; bad data of all cases."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from statements import refused

from macs import optimize
from macs.pareto.dominance import nondominated
from problems import load
from problems.cases import goddard, landing_site, orbit_rise
from runs import gd
from transcription import DFET

NAN = math.nan
BAD_DATA = {
    "aerocapture": [
        ({"exit_speed": 3600.0}, "exit_speed"),
        ({"arrival_speed": -1.0}, "arrival_speed"),
        ({"arrival_speed": NAN}, "arrival_speed"),
    ],
    "aerocapture_bank": [
        ({"shape": 7}, "no solution 7 of Table 2"),
        ({"shape": (0.5, 0.4, 50.0)}, "five variables, not 3"),
        ({"shape": 2.5}, "number of a solution"),
        ({"shape": (0.5, 0.4, NAN, 30.0, 20.0)}, "finite"),
        ({"shape": (0.5, 0.4, 50.0, 70.0, 25.0)}, "rear cone is lit"),
        ({"shape": (0.9, 0.2, 70.0, 5.0, 0.0)}, "not captured"),
        ({"bank_rate": 0.0}, "bank rate"),
        ({"declination": 20.0}, "declination"),
        ({"declination": NAN}, "declination"),
        ({"shield": -1.0}, "heat shield"),
    ],
    "aerocapture_codesign": [
        ({"shape": 6}, "aerocapture_codesign: there is no solution 6"),
        ({"corridor": 1}, "True or False"),
        ({"bank_rate": 0.0}, "aerocapture_codesign: the bank rate"),
        ({"declination": 20.0}, "declination"),
        ({"delta_v": 20.0}, "24.5 to"),
        ({"delta_v": 101.0}, "at most 0.05 rad"),
        ({"delta_v": "small"}, "aerocapture_codesign: delta_v", "must be a number"),
    ],
    "reentry_case1": [
        ({"mass": 0.0}, "mass", "positive"),
        ({"mass": "heavy"}, "mass", "number"),
        ({"lag_gain": -0.1}, "lag_gain", "positive"),
        ({"final_time": NAN}, "final_time", "finite"),
        ({"altitude_tolerance": -1.0}, "altitude", "tolerance", "negative"),
        ({"altitude_tolerance": 1e6}, "altitude", "outside its bounds"),
        ({"gravity": "none"}, "gravity", "newtonian", "constant", "none"),
        ({"weight": 1.0}, "weight", "reentry_case1"),
    ],
    "skip": [
        ({"impulse": 0.0}, "skip", "impulse", "positive"),
        ({"thrust_lag": -1.0}, "skip", "lag", "thrust", "positive"),
        ({"lowest": 90e3}, "skip", "lowest altitude", "outside"),
        ({"fastest": 100.0}, "skip", "initial speed", "outside"),
        ({"mass": 1000.0}, "skip", "mass", "outside"),
        ({"lift": 1.0}, "skip", "lift"),
    ],
    "smv": [({"lag_gain": 0.0}, "smv", "lag"), ({"mass": NAN}, "smv", "mass")],
}


@pytest.mark.parametrize(
    ("case", "data", "words"), [(case, data, words) for case, rows in BAD_DATA.items() for data, *words in rows], ids=str
)
def test_data_that_make_no_sense_are_refused(case, data, words):
    refused(lambda: load(case, **data), *words)


@pytest.mark.slow
@pytest.mark.parametrize("tf", [110.0, 120.0, 150.0, 190.0, 250.0])
def test_the_closed_form_is_the_linear_tangent_law_simulated(tf):
    """tan u = c0 - c1 t, its two constants by shooting, simulated by scipy."""
    a, g, h = goddard.THRUST, goddard.GRAVITY, goddard.HEIGHT

    def simulated(c):
        def rates(t, state):
            u = math.atan(c[0] - c[1] * t)
            return [a * math.cos(u), state[2], a * math.sin(u) - g]

        return solve_ivp(rates, (0, tf), [0, 0, 0], rtol=1e-11, atol=1e-13, max_step=tf / 50).y[:, -1]

    guess = {110.0: (13, 0.17), 120.0: (4.3, 0.058)}.get(tf, (2.0, 2.6 / tf))
    c, _, found, _ = fsolve(lambda c: np.array([simulated(c)[1] / h - 1, simulated(c)[2]]), guess, xtol=1e-12, full_output=True)
    assert found == 1
    front = goddard.reference(points=4001, longest=tf)
    assert front[-1] == pytest.approx([tf, simulated(c)[0]], rel=1e-8)


def test_the_reference_is_a_front():
    front = goddard.reference(points=501)
    assert front.shape == (501, 2) and np.isfinite(front).all()
    assert (np.diff(front, axis=0) > 0).all(), "longer flights are faster"
    slope = np.diff(front[:, 1]) / np.diff(front[:, 0])
    assert (np.diff(slope) < 0).all(), "and ever less so"
    assert goddard.reference(points=3)[-1] == pytest.approx([250.0, 0.903889755358877], rel=1e-12)
    with pytest.raises(ValueError, match="the shortest one takes"):
        goddard.optimal_flight(100.0)
    assert goddard.optimal_flight(goddard.shortest_time() * (1 - 1e-4))["time"][-1] == goddard.shortest_time()


def test_the_ascent_is_the_papers():
    phase = load("goddard").compile().phases[0]
    u = 0.7
    rates = np.array(phase.dynamics([1, 2, 3, 4], [u], 0, [0, 100])).ravel()
    assert rates == pytest.approx([2, 4e-3 * math.cos(u), 4, 4e-3 * math.sin(u) - 1.6e-3])
    assert (phase.t0.upper, phase.tf.lower, phase.tf.upper) == (0, 100, 250)
    ends = dict(zip((v.name for v in phase.states), phase.final, strict=True))
    assert ends == {"x": (-1, 200), "vx": (-10, 10), "y": (10, 10), "vy": (0, 0)}
    assert list(phase.initial) == [(0, 0)] * 4
    assert (phase.controls[0].lower, phase.controls[0].upper) == pytest.approx((-math.pi / 2, math.pi / 2))


@pytest.mark.parametrize("name", ["orbit_rise", "orbit_rise_full"])
def test_the_orbit_rise_is_the_papers(name):
    compiled = load(name).compile()
    phase = compiled.phases[0]
    r, vr, vt, u = 1.3, 0.1, 0.8, 0.4
    rates = np.array(phase.dynamics([r, vr, 2.0, vt], [u], 0, [0, 30])).ravel()
    assert rates == pytest.approx([vr, vt**2 / r - 1 / r**2 + 0.01 * math.cos(u), vt / r, -vt * vr / r + 0.01 * math.sin(u)])
    assert [v[0] for v in phase.initial] == pytest.approx([1.1, 0, 0, 1 / math.sqrt(1.1)])
    assert phase.final == tuple((v.lower, v.upper) for v in phase.states)
    energy = float(phase.finals([r, vr, 2.0, vt], [u], 30, [0, 30]))
    assert energy == pytest.approx((vr**2 + vt**2) / 2 - 1 / r)
    q = [0, 30, energy]
    assert np.array(compiled.objectives(q, [])).ravel() == pytest.approx([30, -energy])
    assert [goal.sense for goal in compiled.goals] == ["minimize", "maximize"]


@pytest.mark.parametrize("tf", [goddard.shortest_time(), 110.0, 150.0, 250.0])
def test_the_optimal_ascent_is_a_flight_of_its_control_and_ends_where_the_front_says(tf):
    flight = goddard.optimal_flight(tf, points=20_001)
    t, middle = flight["time"], lambda values: (values[1:] + values[:-1]) / 2
    rates = {
        "x": middle(flight["vx"]),
        "vx": goddard.THRUST * middle(np.cos(flight["u"])),
        "y": middle(flight["vy"]),
        "vy": goddard.THRUST * middle(np.sin(flight["u"])) - goddard.GRAVITY,
    }
    for name, rate in rates.items():
        # At the shortest time the control jumps within one of the steps.
        off = np.abs(np.diff(flight[name]) - rate * np.diff(t))
        assert np.sort(off)[-2] < 1e-7, name
        assert flight[name][0] == pytest.approx(0.0, abs=1e-12)
    assert flight["y"][-1] == pytest.approx(goddard.HEIGHT, abs=1e-10)
    assert flight["vy"][-1] == pytest.approx(0.0, abs=1e-12)
    longest = goddard.reference(points=2, longest=tf)[-1, 1] if tf > goddard.shortest_time() else 0.0
    assert flight["vx"][-1] == pytest.approx(longest, abs=1e-12)


A = orbit_rise.ACCELERATION


def hamiltonian_flow(_: float, y: np.ndarray) -> list[float]:
    """States r, vr, vt and costates under the angle that maximises the Hamiltonian: thrust along the costate of the velocity."""
    r, vr, vt, lr, lvr, lvt = y
    norm = np.hypot(lvr, lvt)
    return [
        vr,
        vt**2 / r - 1 / r**2 + A * lvr / norm,
        -vt * vr / r + A * lvt / norm,
        lvr * (vt**2 / r**2 - 2 / r**3) - lvt * vt * vr / r**2,
        -lr + lvt * vt / r,
        -2 * lvr * vt / r + lvt * vr / r,
    ]


def test_the_table_is_a_front() -> None:
    reference = orbit_rise.reference()
    assert reference.shape == (241, 2) and (np.diff(reference, axis=0) > 0).all()
    np.testing.assert_allclose(-reference[[0, -1], 1], [0.28345965587, -0.05344446957], atol=1e-10)
    for tf, energy, *costates in orbit_rise.reference_with_costates()[::24]:
        start = [orbit_rise.START_RADIUS, 0.0, orbit_rise.START_RADIUS**-0.5, *costates]
        r, vr, vt, lr, lvr, lvt = solve_ivp(hamiltonian_flow, (0.0, tf), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        assert abs((vr**2 + vt**2) / 2 - 1 / r - energy) < 1e-9
        np.testing.assert_allclose([lr, lvr, lvt], [1 / r**2, vr, vt], atol=1e-8)


@pytest.mark.slow
def test_the_optimal_flight_is_a_flight_of_its_control_and_ends_where_the_front_says() -> None:
    for tf in (20.0, 33.3, 80.0):
        flight = orbit_rise.optimal_flight(tf, points=4001)
        t = flight["time"]

        def rates(time: float, x: np.ndarray, t=t, flight=flight) -> list[float]:
            (r, vr, _, vt), u = x, np.interp(time, t, flight["u"])
            return [vr, vt**2 / r - 1 / r**2 + A * np.cos(u), vt / r, -vt * vr / r + A * np.sin(u)]

        found = solve_ivp(rates, (0.0, tf), [orbit_rise.START_RADIUS, 0.0, 0.0, orbit_rise.START_RADIUS**-0.5], rtol=1e-9, atol=1e-10)
        r, vr, theta, vt = found.y[:, -1]
        np.testing.assert_allclose([r, vr, theta, vt], [flight[name][-1] for name in ("r", "vr", "theta", "vt")], atol=1e-6)
        reference = orbit_rise.reference()
        near = np.argsort(np.abs(reference[:, 0] - tf))[:4]
        expected = np.polynomial.Polynomial.fit(*reference[near].T, 3)(tf)
        assert abs((vr**2 + vt**2) / 2 - 1 / r - expected) < 1e-6
    with pytest.raises(ValueError, match="from 20 to 80"):
        orbit_rise.optimal_flight(81.0)


@pytest.mark.slow
def test_least_effort_is_that_of_an_optimal_flight():
    point = optimize(landing_site.problem(landers=1), DFET(1, 3), objective="hazard", start=np.full((1, 8), 1e-3), starts=1)
    flight = point.trajectory["divert"].at(landing_site.DURATION)
    site = flight["x1"], flight["y1"]
    assert point.objectives["hazard"] == pytest.approx(landing_site.hazard(*site), rel=1e-9)
    # The cheapest flight to this very site, on a finer mesh: the thrust is linear in time, so that finer meshes gain nothing.
    problem = landing_site.problem(landers=1)
    for axis, goal in zip("xy", site, strict=True):
        problem.constraint(f"there {axis}", problem.phases["divert"].final(problem.phases["divert"][f"{axis}1"]), lower=goal, upper=goal)
    for mesh in (DFET(1, 3), DFET(3, 4)):
        best = optimize(problem, mesh, objective="effort", starts=1)
        assert best.objectives["effort"] == pytest.approx(landing_site.least_effort(*site), rel=1e-6)


@pytest.mark.slow
def test_the_front_of_one_is_that_of_a_scan_of_the_ground():
    axis = np.linspace(-1.0, landing_site.REACH, 1401)
    x, y = np.meshgrid(axis, axis)
    sites = np.stack([landing_site.least_effort(x, y).ravel(), landing_site.hazard(x, y).ravel()], axis=1)
    scan = sites[nondominated(sites)]
    truth = landing_site.reference(landers=1)
    scan = scan[scan[:, 0] <= truth[-1, 0]]
    assert gd(scan, truth) < 1e-3 and gd(truth, scan) < 2e-3
    assert len(scan) > 300


@pytest.mark.slow
def test_a_team_is_no_better_than_its_members():
    """Random teams of optimal and other members are nowhere below the front of teams."""
    rng = np.random.default_rng(0)
    truth, x, y = landing_site.reference(), *rng.uniform(-1, 3, (2, 20_000, 3))
    teams = np.stack([landing_site.least_effort(x, y).sum(axis=1), landing_site.hazard(x, y).sum(axis=1)], axis=1)
    one = landing_site.single()
    teams = np.vstack([teams, one[rng.integers(len(one), size=(20_000, 3))].sum(axis=1)])
    slack = 2e-3 * np.ptp(truth, axis=0)
    reached = np.searchsorted(truth[:, 0], teams[:, 0] + slack[0], side="right") - 1
    assert (teams[:, 1] >= truth[reached, 1] - slack[1]).all()
