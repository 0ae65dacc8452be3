from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from problems import load
from problems.cases import goddard


def test_the_shortest_ascent_is_bang_bang():
    a, g, h = goddard.THRUST, goddard.GRAVITY, goddard.HEIGHT
    assert goddard.shortest_time() == pytest.approx(math.sqrt(2 * h * (1 / (a - g) + 1 / (a + g))), rel=1e-14)
    assert goddard.shortest_time() == pytest.approx(109.10894511799619, rel=1e-14)
    # Flown: up at a - g until the speed is what a + g kills before the height is reached.
    up = math.sqrt(2 * h / (a - g) * (a + g) / (2 * a))
    fall = (a - g) * up / (a + g)
    assert up + fall == pytest.approx(goddard.shortest_time(), rel=1e-12)
    assert (a - g) * up**2 / 2 + (a - g) * up * fall - (a + g) * fall**2 / 2 == pytest.approx(h)


def test_the_longest_ascent_has_the_speed_of_the_literature():
    assert goddard.reference(points=3)[-1] == pytest.approx([250.0, 0.903889755358877], rel=1e-12)


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


def test_the_ascent_is_the_papers():
    phase = load("goddard").compile().phases[0]
    u = 0.7
    rates = np.array(phase.dynamics([1, 2, 3, 4], [u], 0, [0, 100])).ravel()
    assert rates == pytest.approx([2, 4e-3 * math.cos(u), 4, 4e-3 * math.sin(u) - 1.6e-3])
    assert (phase.t0.upper, phase.tf.lower, phase.tf.upper) == (0, 100, 250)
    ends = dict(zip((v.name for v in phase.states), phase.final, strict=True))
    assert ends == {
        "x": (-1, 200),
        "vx": (-10, 10),
        "y": (10, 10),
        "vy": (0, 0),
    }
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


def test_without_thrust_the_orbit_is_a_circle():
    phase = load("orbit_rise").compile().phases[0]

    def rates(t, x):
        coast = np.array(phase.dynamics(x, [0.0], t, [0, 30])).ravel()
        coast[1] -= 0.01
        return coast

    end = solve_ivp(rates, (0, 30), [v[0] for v in phase.initial], rtol=1e-10, atol=1e-12).y[:, -1]
    assert end == pytest.approx([1.1, 0, 30 * 1.1**-1.5, 1.1**-0.5], abs=1e-7)


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


def test_no_ascent_is_shorter_than_the_shortest():
    with pytest.raises(ValueError, match="the shortest one takes"):
        goddard.optimal_flight(100.0)
    assert goddard.optimal_flight(goddard.shortest_time() * (1 - 1e-4))["time"][-1] == goddard.shortest_time()
