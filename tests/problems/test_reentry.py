"""The re-entry against an implementation of its own in numpy, from the published figures in SI, and against closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from statements import refused

from problems import load
from problems.cases.reentry import case1, case2, case3, statement
from problems.cases.reentry.vehicle import MASS, PRESSURE, SHUTTLE
from transcription import DFET, Trajectory, parse
from transcription.trajectories.simulate import simulate

STATES = ["altitude", "longitude", "latitude", "speed", "flight-path angle", "heading", "angle of attack", "bank angle"]
CASES = ["reentry_case1", "reentry_case2", "reentry_case3"]
R, MU, S, M = 6371203.92, 3.98603e14, 249.909, 92079.2


def by_hand(x: np.ndarray, commands: np.ndarray, mass: float = M, gain: float = 0.1) -> tuple[np.ndarray, tuple[float, float, float]]:
    """Rates of the eight states, and heating rate (Btu/ft2/s), dynamic pressure (lbf/ft2) and load factor."""
    h, _, lat, v, path, heading, attack, bank = x
    r, rho = R + h, 1.225571 * np.exp(-h / 7254.24)
    g = MU / r**2
    force = 0.5 * rho * v**2 * S
    lift = force * (-0.20704 + 1.67556 * attack)
    drag = force * (0.07854 - 0.352896 * attack + 2.039962 * attack**2)
    rates = np.array([
        v * np.sin(path),
        v * np.cos(path) * np.sin(heading) / (r * np.cos(lat)),
        v * np.cos(path) * np.cos(heading) / r,
        -drag / mass - g * np.sin(path),
        lift * np.cos(bank) / (mass * v) + (v**2 - g * r) / (r * v) * np.cos(path),
        lift * np.sin(bank) / (mass * v * np.cos(path)) + v / r * np.cos(path) * np.sin(heading) * np.tan(lat),
        gain * (commands[0] - attack),
        gain * (commands[1] - bank),
    ])  # fmt: skip
    a = np.degrees(attack)
    heating = 1.570305e-8 * np.sqrt(rho) * v**3.07 * (1.0672181 - 0.019213774 * a + 2.1286289e-4 * a**2 - 1.0117249e-6 * a**3)
    return rates, (heating, 0.5 * rho * v**2 / 47.880259, np.hypot(lift, drag) / (mass * g))


def anywhere(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """States and commands of some flight."""
    lower = [20e3, -1.0, -1.0, 700.0, -0.3, -3.0, 0.0, -1.5]
    upper = [90e3, 2.0, 1.0, 8000.0, 0.3, 3.0, 0.7, 0.0]
    return rng.uniform(lower, upper), rng.uniform([0.0, -1.5], [0.7, 0.0])


@pytest.mark.parametrize("case", CASES)
def test_the_vehicle_is_the_published_one(case):
    phase, rng = load(case).compile().phases[0], np.random.default_rng(1)
    assert [v.name for v in phase.states] == STATES
    for _ in range(20):
        x, u = anywhere(rng)
        rates, limited = by_hand(x, u)
        static = [0.0, 2000.0]
        np.testing.assert_allclose(np.array(phase.dynamics(x, u, 0.0, static)).ravel(), rates, rtol=2e-5, atol=1e-9)
        np.testing.assert_allclose(np.array(phase.path(x, u, 0.0, static)).ravel()[:3], limited, rtol=2e-5)
        turning, heating = abs(rates[4]), limited[0]
        np.testing.assert_allclose(np.array(phase.integrands(x, u, 0.0, static)).ravel(), [heating, turning], rtol=2e-5, atol=1e-9)
        np.testing.assert_allclose(np.array(phase.peaks(x, u, 0.0, static)).ravel(), [heating], rtol=2e-5)


def test_the_constants_are_those_of_the_literature():
    assert pytest.approx(R, abs=0.01) == SHUTTLE.radius
    assert pytest.approx(MU, rel=1e-6) == SHUTTLE.mu
    assert pytest.approx(M, abs=0.1) == MASS and pytest.approx(S, abs=1e-3) == SHUTTLE.area
    assert pytest.approx(1.570305e-8, rel=1e-6) == SHUTTLE.heating_constant
    # 280 lbf/ft2 are 13406.46 Pa.
    assert float(SHUTTLE.dynamic_pressure(1e9, 0.0)) == 0.0
    assert pytest.approx(13406.46, abs=0.02) == 280 * PRESSURE


def test_the_ends_and_the_limits_are_those_of_the_paper():
    ft, deg = 0.3048, math.pi / 180
    phase = load("reentry_case1").compile().phases[0]
    initial = dict(zip(STATES, phase.initial, strict=True))
    assert [initial[name][0] for name in STATES] == pytest.approx(
        [260000 * ft, 0, 0, 25600 * ft, -1 * deg, 90 * deg, 17.4 * deg, -75 * deg]
    )
    assert all(low == high for low, high in phase.initial)
    ends = {limit.name: limit for limit in load("reentry_case1").compile().limits}
    for name, tolerance in (("altitude", 3000 * ft), ("speed", 350 * ft), ("flight-path angle", deg)):
        limit = ends[f"final {name}"]
        assert (limit.lower, limit.upper, limit.scale) == pytest.approx((-tolerance, tolerance, tolerance))
    assert (phase.t0.lower, phase.tf.lower, phase.tf.upper) == (0, 2000, 2000)
    for v in phase.controls:
        assert (v.lower, v.upper) == pytest.approx((0, 40 * deg) if "attack" in v.name else (-90 * deg, 1 * deg))
    for case, limits in (("reentry_case1", (200, 280, 2.5)), ("reentry_case2", (150, 250, 1.25)), ("reentry_case3", (200, 280, 2.5))):
        paths = load(case).compile().phases[0].paths
        assert [path.upper for path in paths[:3]] == list(limits) and len(paths) == (6 if case == "reentry_case3" else 3)


def test_zones_are_circles_on_the_map():
    phase = load("reentry_case3").compile().phases[0]
    x = np.array([50e3, math.radians(33), math.radians(11.5), 5000, 0, 1.5, 0.3, -1])
    distances = np.array(phase.path(x, [0.3, -1], 0, [0, 2000])).ravel()[3:]
    assert distances == pytest.approx([5.0, math.hypot(27, 3.5), math.hypot(37, 8.5)])
    assert [limit.lower for limit in phase.paths[3:]] == [5, 5, 5]


def test_the_objectives_have_the_units_of_the_paper():
    compiled = load("reentry_case1").compile()
    assert [(goal.unit, goal.sense) for goal in compiled.goals] == [
        ("deg", "maximize"), ("kBtu/ft2", "minimize"), ("rad", "minimize"), ("Btu/ft2/s", "minimize")
    ]  # fmt: skip
    latitude, load_, turned, peak, ends = math.radians(31.0), 112e3, 0.9, 145.0, [24000.0, 700.0, -0.09]
    # t0, tf, finals, integrals, peaks
    quantities = [0, 2000, *ends, latitude, load_, turned, peak]
    assert np.array(compiled.objectives(quantities, [])).ravel() == pytest.approx([-31, 112, 0.9, 145])
    errors = np.array(ends) - [24384.0, 762.0, math.radians(-5.0)]
    assert np.array(compiled.constraints(quantities, [])).ravel() == pytest.approx(errors)


def integrated(rates, state: list[float], seconds: float) -> np.ndarray:
    names = STATES[:6]

    def right_hand_side(_: float, y: np.ndarray) -> list[float]:
        found = rates(dict(zip(names, y, strict=True)))
        return [float(found[name]) for name in names]

    return solve_ivp(right_hand_side, (0, seconds), state, method="DOP853", rtol=1e-11, atol=1e-9).y[:, -1]


def test_far_above_the_air_the_flight_is_kepler_s():
    """Energy and angular momentum, all three components of it, stay what they are."""
    start = [1.5e6, 0.3, 0.5, 7000.0, 0.2, 0.9]

    def invariants(y: np.ndarray) -> list[float]:
        h, lon, lat, v, path, heading = y
        r = SHUTTLE.radius + h
        up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
        east, north = np.array([-math.sin(lon), math.cos(lon), 0.0]), np.array([
            -math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)])  # fmt: skip
        velocity = v * (math.sin(path) * up + math.cos(path) * (math.sin(heading) * east + math.cos(heading) * north))
        return [v**2 / 2 - SHUTTLE.mu / r, *np.cross(r * up, velocity)]

    end = integrated(lambda state: SHUTTLE.rates(state, 0.3, -1.0, MASS), start, 1500.0)
    assert abs(end[0] - start[0]) > 1e5 and abs(end[1] - start[1]) > 0.5
    np.testing.assert_allclose(invariants(end), invariants(np.array(start)), rtol=1e-9)


def test_without_bank_the_flight_stays_in_its_vertical_plane():
    """Along the equator; and anywhere on a great circle, by Clairaut's relation."""
    along = integrated(lambda state: SHUTTLE.rates(state, 0.3, 0.0, MASS), [79e3, 0.0, 0.0, 7800.0, -0.017, math.pi / 2], 800.0)
    assert abs(along[2]) < 1e-12 and along[5] == pytest.approx(math.pi / 2, abs=1e-12) and along[1] > 0.8
    start = [79e3, 0.0, 0.2, 7800.0, -0.017, 1.0]
    end = integrated(lambda state: SHUTTLE.rates(state, 0.3, 0.0, MASS), start, 800.0)
    assert end[2] > 0.4
    assert math.cos(end[2]) * math.sin(end[5]) == pytest.approx(math.cos(0.2) * math.sin(1.0), rel=1e-9)


def test_gravity_is_newton_s_or_the_same_everywhere():
    at_sea_level = MU / R**2
    assert float(SHUTTLE.gravity(0.0, "newtonian")) == pytest.approx(at_sea_level, rel=1e-5)
    assert float(SHUTTLE.gravity(1e5, "newtonian")) == pytest.approx(MU / (R + 1e5) ** 2, rel=1e-5)
    assert float(SHUTTLE.gravity(1e5, "constant")) == pytest.approx(at_sea_level, rel=1e-5)


def test_data_change_the_flight():
    x, u = anywhere(np.random.default_rng(2))
    heavy = load("reentry_case1", mass=96683.0, lag_gain=0.2).compile().phases[0]
    np.testing.assert_allclose(np.array(heavy.dynamics(x, u, 0, [0, 2000])).ravel(), by_hand(x, u, 96683.0, 0.2)[0], rtol=2e-5, atol=1e-9)
    exact = load("reentry_case1", altitude_tolerance=0, speed_tolerance=0, angle_tolerance=0, final_time=1900).compile().phases[0]
    ends = dict(zip(STATES, exact.final, strict=True))
    assert ends["altitude"] == pytest.approx((24384.0, 24384.0)) and exact.tf.upper == 1900
    level = load("reentry_case1", gravity="constant").compile().phases[0]
    g = SHUTTLE.mu / SHUTTLE.radius**2
    newton = SHUTTLE.mu / (SHUTTLE.radius + x[0]) ** 2
    change = np.array(level.dynamics(x, u, 0, [0, 2000])).ravel()[3] - by_hand(x, u)[0][3]
    assert change == pytest.approx(-(g - newton) * math.sin(x[4]), abs=1e-4)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"mass": 0.0}, ["mass", "positive"]),
        ({"mass": "heavy"}, ["mass", "number"]),
        ({"lag_gain": -0.1}, ["lag_gain", "positive"]),
        ({"final_time": float("nan")}, ["final_time", "finite"]),
        ({"altitude_tolerance": -1.0}, ["altitude", "tolerance", "negative"]),
        ({"altitude_tolerance": 1e6}, ["altitude", "outside its bounds"]),
        ({"gravity": "none"}, ["gravity", "newtonian", "constant", "none"]),
        ({"weight": 1.0}, ["weight", "reentry_case1"]),
    ],
)
def test_data_that_make_no_sense_are_refused(data, words):
    refused(lambda: load("reentry_case1", **data), *words)


def test_the_guess_is_a_flight():
    """The nominal law leads near the end, and the guessed states are what it leads to."""
    phase = load("reentry_case1").compile().phases[0]
    times, states = phase.guesses["altitude"][0], np.array([phase.guesses[name][1] for name in STATES])
    u = np.array([phase.guesses[v.name][1] for v in phase.controls])

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.array(phase.dynamics(y, [np.interp(t, times, row) for row in u], t, [0, 2000])).ravel()

    end = solve_ivp(rates, (0, 2000), states[:, 0], rtol=1e-8, max_step=20.0).y[:, -1]
    span = np.array([v.span for v in phase.states])
    np.testing.assert_allclose(states[:, -1] / span, end / span, atol=1e-4)
    for v, (low, high), value in zip(phase.states, phase.final, end, strict=True):
        assert low <= value <= high, v.name
    assert statement.START.keys() == set(STATES)


@dataclass
class Flight:
    """What pictures need of a point or a simulation."""

    trajectory: Trajectory | None


@pytest.fixture(scope="module")
def flights() -> dict[str, list[Flight]]:
    """The guesses of all cases, and a heavier one's."""
    made = {}
    for case in CASES:
        nlps = [DFET(10, 2).transcribe(load(case, mass=mass)) for mass in (MASS, 1.05 * MASS)]
        made[case] = [Flight(nlp.unpack(nlp.first_guess(nlp.guess[None])[0])) for nlp in nlps]
    return made


@pytest.mark.slow
@pytest.mark.parametrize(("case", "room"), list(zip(CASES, (case1, case2, case3), strict=True)))
def test_pictures_show_states_limits_and_zones(case, room, flights, tmp_path):
    pictures = room.plot(flights[case])
    assert set(pictures) == {"population", "ground-track"}
    axes = pictures["population"].axes
    words = [ax.get_title(loc="left") for ax in axes]
    assert "altitude [km]" in words and "bank angle [deg]" in words and "heating rate [Btu/ft2/s]" in words
    assert axes[-1].get_ylabel() == "cross-range [deg]", "what the colours mean"
    altitude, heating = axes[words.index("altitude [km]")], axes[words.index("heating rate [Btu/ft2/s]")]
    assert altitude.lines[0].get_ydata()[[0, -1]] == pytest.approx([79.248, 25.0], abs=0.5)
    assert heating.lines[-1].get_ydata()[0] == room.LIMITS.heating_rate
    track = pictures["ground-track"].axes[0]
    assert len(track.patches) == (3 if case == "reentry_case3" else 0)
    for name, picture in pictures.items():
        picture.savefig(tmp_path / f"{name}.png")
    assert "cross-range [deg]" not in [ax.get_ylabel() for ax in room.plot(flights[case][:1])["population"].axes]
    with pytest.raises(ValueError, match="no flight"):
        room.plot([Flight(None)])


def test_the_track_is_in_degrees():
    found = case1.track({"longitude": np.array([0.0, math.pi / 2]), "latitude": np.array([0.0, math.pi / 6])})
    assert {name: values.tolist() for name, values in found.items()} == {
        "longitude [deg]": [0.0, pytest.approx(90.0)], "latitude [deg]": [0.0, pytest.approx(30.0)]
    }  # fmt: skip


@pytest.mark.parametrize("data", [{"final_time": 4000.0}, {"final_time": 10.0}, {"mass": 10.0}, {"mass": 1e9}, {"lag_gain": 100.0}])
def test_any_data_make_a_problem(data):
    """Where the nominal law leads nowhere, the guess stays within bounds."""
    nlp = DFET(3, 1).transcribe(load("reentry_case1", **data))
    Z = nlp.first_guess(nlp.guess[None])
    assert np.isfinite(nlp.evaluate(Z)[1]).all()


@pytest.mark.slow
def test_the_default_mesh_follows_commands_that_jump():
    """At the end a hundredth of the altitude's span is left open, of which a thousandth counts."""
    problem = load("reentry_case1")
    nlp = parse(problem.default_transcription).transcribe(problem)
    Z = nlp.first_guess(nlp.guess[None])
    for k in nlp.free:
        name = nlp.variables[k].name
        if "bank angle command" in name:
            element = int(name.split("[")[1].split(",")[0])
            Z[0, k] += math.radians(15.0 if element % 2 else -15.0)
    flight = nlp.unpack(nlp.propagate(np.clip(Z, nlp.lower, nlp.upper))[0])
    found = simulate(nlp.problem, flight, rtol=1e-10, atol=1e-11)
    assert found.max_defect < 1e-5 and np.degrees(np.abs(np.diff(flight["entry"].controls[:, 1]))).max() > 10.0


def test_the_oscillation_is_exact_in_the_search_and_smooth_for_gradients():
    """What stands for the absolute values is what they are, once a candidate is propagated."""
    nlp = DFET(8, 2).transcribe(load("reentry_case1"))
    Z = nlp.propagate(nlp.first_guess(nlp.guess[None]))
    phase, flight = nlp.problem.phases[0], nlp.unpack(Z[0])["entry"]
    nodes, weights = np.polynomial.legendre.leggauss(3)
    total = 0.0
    for j in range(8):
        x, u = flight.state.on_element(j, nodes), flight.controls_on(j, nodes)
        total += 125.0 * weights @ np.array([by_hand(*pair)[0][4] for pair in zip(x, u, strict=True)]).__abs__()
    assert nlp.evaluate(Z)[0][0, 2] == pytest.approx(total, rel=1e-3)
    assert phase.sized == (1,)
