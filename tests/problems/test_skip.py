"""The skip entry: its statement against the paper, its optimum confirmed by code of its own."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from statements import refused

from macs import payoff
from problems import load
from problems.cases.skip_entry.skip import reference
from transcription import stated

DEGREE = math.pi / 180
RADIUS, MU, AREA, DENSITY, HEIGHT, IMPULSE = 6371203.92, 3.9856e14, 249.91, 1.2256, 7254.24, 319.0


def air(h: float, v: float, attack: float, m: float) -> tuple[float, float, float, float, float]:
    """Lift and drag, N, and what is limited: heating rate, Btu/ft2/s, dynamic pressure, Pa, load factor; eqs. (42)-(49)."""
    rho = DENSITY * math.exp(-h / HEIGHT)
    q, a = 0.5 * rho * v**2, attack / DEGREE
    lift, drag = q * AREA * (-0.2070 + 1.676 * attack), q * AREA * (0.07854 - 0.3529 * attack + 2.040 * attack**2)
    # The constant of Betts, from (kg/m3)^0.5 (m/s)^3.07 to Btu/ft2/s.
    heating = 1.570305e-8 * math.sqrt(rho) * v**3.07 * (1.0672181 - 1.9213774e-2 * a + 2.1286289e-4 * a**2 - 1.0117249e-6 * a**3)
    return lift, drag, heating, q, math.hypot(lift, drag) / (m * MU / (RADIUS + h) ** 2)


def rates(y: np.ndarray, u: np.ndarray) -> list[float]:
    """Eqs. (34)-(40)."""
    h, _, lat, v, path, heading, m = y
    attack, bank, thrust = u
    r = RADIUS + h
    g, (lift, drag, *_) = MU / r**2, air(h, v, attack, m)
    return [
        v * math.sin(path),
        v * math.sin(heading) * math.cos(path) / (r * math.cos(lat)),
        v * math.cos(heading) * math.cos(path) / r,
        (thrust * math.cos(attack) - drag) / m - g * math.sin(path),
        (lift * math.cos(bank) + thrust * math.sin(attack)) / (m * v) - g * math.cos(path) / v + v * math.cos(path) / r,
        lift * math.sin(bank) / (m * v * math.cos(path)) + v * math.cos(path) * math.sin(heading) * math.tan(lat) / r,
        -thrust / (IMPULSE * g),
    ]


@pytest.mark.parametrize("seed", range(5))
def test_the_statement_is_the_paper_s(seed):
    rng = np.random.default_rng(seed)
    phase = load("skip").compile().phases[seed % 2]
    x, u = (
        np.array([rng.uniform(0.9 * v.lower + 0.1 * v.upper, 0.1 * v.lower + 0.9 * v.upper) for v in group])
        for group in (phase.states, phase.controls)
    )
    s = [0.0, 600.0]
    np.testing.assert_allclose(np.array(phase.dynamics(x, u, 0.0, s)).ravel(), rates(x, u), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(np.array(phase.path(x, u, 0.0, s)).ravel(), air(x[0], x[3], u[0], x[6])[2:], rtol=1e-5)


def test_the_ends_and_limits_are_the_paper_s():
    down, up = load("skip").compile().phases
    assert [low for low, _ in down.initial] == pytest.approx([79248, 0, 0, 7802.88, -DEGREE, 90 * DEGREE, 90719])
    assert down.final[0] == (51880, 51880) and up.final[0] == (79248, 79248)
    assert down.final[4] == (0, 0), "level at the lowest point"
    assert [limit.upper for limit in up.paths] == pytest.approx([200, 13406.4583, 2.5])
    # 2269.7864 kW/m2 are 200 thermochemical Btu/ft2/s.
    assert pytest.approx(2269786.4, rel=1e-7) == 200 * 1054.350264488889 / 0.3048**2
    bounds = {v.name: (v.lower, v.upper) for v in (*up.states, *up.controls)}
    assert bounds["altitude"] == (51880, 79248) and bounds["mass"] == (3177, 90719) and bounds["speed"][1] == 7802.88
    assert bounds["angle of attack"] == pytest.approx((-10 * DEGREE, 30 * DEGREE)) and bounds["thrust"] == (0, 2e6)
    assert [(goal.name, goal.unit, goal.sense) for goal in load("skip").compile().goals] == [
        ("terminal mass", "kg", "maximize"), ("terminal speed", "m/s", "maximize")
    ]  # fmt: skip


def test_data_change_the_flight():
    lagged = load("skip", thrust_lag=0.2, impulse=300.0, lowest=55e3, mass=80e3).compile().phases[1]
    assert [v.name for v in lagged.states][-1] == "thrust" and [v.name for v in lagged.controls][-1] == "thrust command"
    assert lagged.states[0].lower == 55e3 and lagged.states[6].upper == 80e3


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"impulse": 0.0}, ["impulse", "positive"]),
        ({"thrust_lag": -1.0}, ["lag", "thrust", "positive"]),
        ({"lowest": 90e3}, ["lowest altitude", "outside"]),
        ({"fastest": 100.0}, ["initial speed", "outside"]),
        ({"mass": 1000.0}, ["mass", "outside"]),
        ({"lift": 1.0}, ["lift", "skip"]),
    ],
)
def test_data_that_make_no_sense(data, words):
    refused(lambda: load("skip", **data), *words)


@pytest.mark.slow
def test_the_ends_of_the_front_fly():
    """Both ends, flown by code of its own: limits within half a per cent, the end within a metre, never below the lowest altitude by more;
    and as good as what hours of search found."""
    problem = load("skip")
    front = payoff(problem, stated(problem.default_transcription), starts=1)
    known = reference()
    assert front[0].objectives["terminal mass"] > known[:, 0].max() - 20.0
    assert front[1].objectives["terminal speed"] > 7802.87 and front[1].objectives["terminal mass"] > known[:, 0].min() - 20.0
    for point in front:
        state = np.array([79248.0, 0.0, 0.0, 7802.88, -DEGREE, 90 * DEGREE, 90719.0])
        for phase in point.trajectory.values():
            edges, ends = phase.control.edges, phase.control.on_elements
            lowest = np.inf
            for j in range(len(edges) - 1):
                values = ends(np.linspace(-1, 1, 9))[j]
                law = np.polynomial.polynomial.Polynomial.fit
                fits = [law(np.linspace(edges[j], edges[j + 1], 9), column, 8) for column in values.T]
                flown = solve_ivp(
                    lambda t, y, fits=fits: rates(y, np.array([fit(t) for fit in fits])),
                    (edges[j], edges[j + 1]), state, method="DOP853", rtol=1e-10, atol=1e-9, dense_output=True,
                )  # fmt: skip
                for t in np.linspace(edges[j], edges[j + 1], 21):
                    y, u = flown.sol(t), np.array([fit(t) for fit in fits])
                    heating, pressure, load_ = air(y[0], y[3], u[0], y[6])[2:]
                    assert max(heating / 200, pressure / 13406.4583, load_ / 2.5) < 1.005
                    assert y[3] < 7802.88 * 1.0005
                    lowest = min(lowest, y[0])
                state = flown.y[:, -1]
            assert lowest > 51880 - 1.0
        assert state[0] == pytest.approx(79248, abs=1.0)
        assert [state[6], state[3]] == pytest.approx(list(point.objectives.values()), rel=1e-5)
