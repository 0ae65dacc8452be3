"""Integrals and peaks of absolute values: smooth for gradient tools where they are minimised or bounded above, else the same numbers."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

from macs import optimize
from problems import Problem
from transcription import DFET, MultipleShooting, SingleShooting

DISTANCE, TIME = 3.0, 4.0


def transfer(state=lambda problem, fuel: problem.minimize("fuel", fuel), integral=lambda phase, u: phase.integral(ca.fabs(u))) -> Problem:
    """From rest to rest over a distance in a time, with a thrust of at most 1 either way."""
    problem = Problem("transfer")
    phase = problem.phase("push", t0=0.0, tf=TIME)
    phase.state("x", bounds=(-10, 10), initial=0, final=DISTANCE)
    v = phase.state("v", bounds=(-5, 5), initial=0, final=0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=v, v=u)
    state(problem, integral(phase, u))
    return problem


@pytest.mark.parametrize(
    "method", [DFET(4, 2), DFET(4, 2, basis="bernstein"), SingleShooting(9), MultipleShooting(4, steps=3, control_nodes=9)], ids=str
)
def test_least_fuel_is_bang_off_bang(method):
    """Thrust, coast, thrust against: each burn lasts (T - sqrt(T^2 - 4 d)) / 2 = 1, and ends on this mesh."""
    point = optimize(transfer(), method, starts=1)
    assert point.status == "converged" and point.optimality < 1e-6
    assert point.objectives["fuel"] == pytest.approx(TIME - np.sqrt(TIME**2 - 4 * DISTANCE), abs=1e-6)
    assert point.trajectory["push"].at(np.array([0.5, 2.0, 3.6]))["u"] == pytest.approx([1.0, 0.0, -1.0], abs=1e-5)
    assert point.simulate().objectives["fuel"] == pytest.approx(2.0, abs=1e-6)


@pytest.mark.parametrize(
    ("off", "integral"),
    [
        (1e-7, lambda phase, u: 3 * phase.integral(ca.fabs(u) / 3.0)),
        (1e-7, lambda phase, u: -phase.integral(phase["v"] - (ca.fabs(2 * u) + ca.fabs(u)) / 3) + DISTANCE),
        (1e-7, lambda phase, u: phase.integral(ca.norm_1(u))),
        (1e-4, lambda phase, u: phase.integral(1 - ca.sqrt(u**2 + 1e-16) / -1) - TIME),
        (1e-4, lambda phase, u: phase.integral(ca.norm_2(ca.vertcat(3 * u, 4 * u))) / 5),
    ],
)
def test_terms_factors_and_roots_are_no_obstacle(integral, off):
    """Roots are right to the root of an interior point method's accuracy: at its tip, a cone has no slope."""
    point = optimize(transfer(integral=integral), DFET(4, 2), starts=1)
    assert point.status == "converged" and point.objectives["fuel"] == pytest.approx(2.0, abs=off)


def plane(x: float, y: float):
    """Two such transfers at once, along two axes; and its phase and controls."""
    problem = Problem("plane")
    phase = problem.phase("push", t0=0.0, tf=TIME)
    rates, controls = {}, []
    for axis, distance in (("x", x), ("y", y)):
        phase.state(axis, bounds=(-10, 10), initial=0, final=distance)
        v = phase.state(f"v{axis}", bounds=(-5, 5), initial=0, final=0)
        controls.append(phase.control(f"u{axis}", bounds=(-1, 1)))
        rates |= {axis: v, f"v{axis}": controls[-1]}
    phase.dynamics(**rates)
    return problem, phase, controls


def test_two_controls_each_have_their_own():
    """Distances 3 and 1.75 need burns of 1 and of 0.5, two each."""
    problem, phase, controls = plane(DISTANCE, -1.75)
    problem.minimize("fuel", phase.integral(ca.dot(ca.DM([1, 2]), ca.fabs(ca.vertcat(*controls)))))
    assert problem.compile().phases[0].sized == (0, 1)
    point = optimize(problem, DFET(8, 2), starts=1)
    assert point.status == "converged" and point.objectives["fuel"] == pytest.approx(2 * 1.0 + 2 * 2 * 0.5, abs=1e-7)


@pytest.mark.parametrize("method", [DFET(4, 2), MultipleShooting(4, steps=3, control_nodes=9)], ids=str)
def test_a_norm_of_two_controls_is_no_obstacle(method):
    """Fuel is the norm of the thrust, which has to be along the line from start to goal: each burn lasts 1, as along one axis."""
    problem, phase, controls = plane(0.6 * DISTANCE, -0.8 * DISTANCE)
    thrust = controls[0] ** 2 + controls[1] ** 2
    phase.path("most thrust", thrust, upper=1.0)
    problem.minimize("fuel", phase.integral(ca.sqrt(thrust + 1e-10)))
    point = optimize(problem, method, starts=1)
    assert point.status == "converged" and point.objectives["fuel"] == pytest.approx(2.0, abs=1e-4)
    assert point.trajectory["push"].at(np.array([0.5]))["uy"] == pytest.approx(-0.8, abs=1e-3)


def test_a_root_that_is_smooth_stays_as_it_is():
    length = transfer(integral=lambda phase, u: phase.integral(ca.sqrt(1 + u**2)))
    speed = transfer(integral=lambda phase, u: phase.integral(ca.sqrt(1e-2 + phase["v"] ** 2 + u**2)))
    assert length.compile().phases[0].sized == speed.compile().phases[0].sized == ()


@pytest.mark.parametrize("method", [DFET(3, 2), MultipleShooting(6)], ids=str)
def test_candidates_are_scored_by_the_absolute_values_themselves(method):
    nlp = method.transcribe(transfer())
    Z = nlp.propagate(nlp.first_guess(np.random.default_rng(0).uniform(-1, 1, (5, len(nlp.free)))))
    nodes, weights = np.polynomial.legendre.leggauss(3)
    for z, F in zip(Z, nlp.evaluate(Z)[0], strict=True):
        flight = nlp.unpack(z)["push"]
        lengths = np.diff(flight.state.edges)
        total = sum(0.5 * h * weights @ np.abs(flight.controls_on(j, nodes)[:, 0]) for j, h in enumerate(lengths))
        assert F[0] == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize(
    "state",
    [
        lambda problem, fuel: problem.minimize("fuel", -fuel),
        lambda problem, fuel: problem.minimize("fuel", (fuel - 1.0) ** 2),
        lambda problem, fuel: (problem.minimize("fuel", fuel), problem.constraint("least", fuel, lower=1.0)),
    ],
)
def test_where_large_is_good_they_are_left_as_they_are(state):
    assert transfer(state).compile().phases[0].sized == () and transfer().compile().phases[0].sized == (0,)


def test_by_shooting_controls_alone_have_one_absolute_value_where_they_are_constant():
    def rows(method: MultipleShooting, integrand) -> int:
        problem = transfer(integral=lambda phase, u: phase.integral(integrand(phase)))
        return sum("absolute values" in label for label in method.transcribe(problem).g_labels)

    assert rows(MultipleShooting(6), lambda phase: ca.fabs(phase["u"])) == 2 * 6
    assert rows(MultipleShooting(6, control="linear"), lambda phase: ca.fabs(phase["u"])) == 2 * 6 * 3
    assert rows(MultipleShooting(6), lambda phase: ca.fabs(phase["v"]) + ca.fabs(phase.time * phase["u"])) == 2 * 2 * 6 * 4


def least_deviation(target=lambda time: 0.0) -> Problem:
    problem = Problem("deviation")
    phase = problem.phase("move", t0=0.0, tf=3.0)
    x, u = phase.state("x", bounds=(-3, 3), initial=1), phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=u)
    problem.minimize("deviation", phase.integral(ca.fabs(x - target(phase.time))))
    return problem


@pytest.mark.parametrize("method", [MultipleShooting(12), MultipleShooting(12, scheme="rk8"), SingleShooting(13), DFET(6, 2)], ids=str)
def test_a_state_is_brought_to_zero_and_held_there(method):
    """x = 1 - t until t = 1, then nothing: 1/2. Its costate is what deviation is still to come: 1 - t, then nothing."""
    point = optimize(least_deviation(), method, starts=1)
    assert point.status == "converged" and point.objectives["deviation"] == pytest.approx(0.5, abs=1e-6)
    assert point.trajectory["move"].at(np.array([0.5, 1.5, 2.5]))["x"] == pytest.approx([0.5, 0.0, 0.0], abs=1e-6)
    # The stage at t = 1, of weight 1/6 in a step of 1/4, has any multiplier up to its weight.
    assert np.abs(point.costates["move"]["x"]) == pytest.approx(np.maximum(1 - point.trajectory["move"].time, 0), abs=0.25 / 6 + 1e-4)


@pytest.mark.parametrize("method", [MultipleShooting(24, control="linear"), SingleShooting(25, control="spline")], ids=str)
def test_lines_and_splines_approach_thrust_that_jumps(method):
    point = optimize(transfer(), method, starts=1)
    assert point.status == "converged" and point.objectives["fuel"] == pytest.approx(2.0, abs=0.015)


@pytest.mark.parametrize("method", [MultipleShooting(40), SingleShooting(41)], ids=str)
def test_a_target_that_moves_is_met_and_followed(method):
    """x = 1 - t until it meets sin(t) / 2, at t with 1 - t = sin(t) / 2."""
    meets = brentq(lambda t: 1 - t - 0.5 * np.sin(t), 0.0, 1.0)
    point = optimize(least_deviation(lambda t: 0.5 * ca.sin(t)), method, starts=1)
    right = meets - 0.5 * meets**2 + 0.5 * np.cos(meets) - 0.5
    assert point.status == "converged" and point.objectives["deviation"] == pytest.approx(right, abs=2e-3)


def test_the_least_turn_rate_that_arrives_in_time():
    """Jennings: an arc, then its tangent through the origin; the rate is that at which both take as long as there is."""
    problem = Problem("turn")
    phase = problem.phase("drive", t0=0.0, tf=5.0)
    heading = phase.state("heading", bounds=(-7, 7), initial=np.pi / 2)
    for axis, start in (("x", 4.0), ("y", 0.0)):
        phase.state(axis, bounds=(-6, 6), initial=start, final=0)
    u = phase.control("u", bounds=(-2, 2))
    phase.dynamics(heading=u, x=ca.cos(heading), y=ca.sin(heading))
    problem.minimize("rate", phase.peak(ca.fabs(u)))

    def length(rate: float) -> float:
        radius, to_centre = 1 / rate, 4 - 1 / rate
        return radius * (np.pi - np.arccos(radius / to_centre)) + np.sqrt(to_centre**2 - radius**2)

    point = optimize(problem, DFET(10, 3), starts=6)
    assert point.status == "converged"
    assert point.objectives["rate"] == pytest.approx(brentq(lambda rate: length(rate) - 5.0, 0.501, 2.0), abs=1e-4)


@pytest.mark.parametrize("integrand", [ca.fabs, lambda u: ca.fmax(u, -u)], ids=["fabs", "fmax"])
def test_the_least_torque_that_swings_a_pendulum_up(integrand):
    problem = Problem("swing")
    phase = problem.phase("swing", t0=0.0, tf=8.0)
    angle = phase.state("angle", bounds=(-12, 12), initial=0, final=np.pi)
    rate = phase.state("rate", bounds=(-8, 8), initial=0, final=0)
    u = phase.control("u", bounds=(-2, 2))
    phase.dynamics(angle=rate, rate=u - ca.sin(angle))
    problem.minimize("torque", phase.peak(integrand(u)))
    point = optimize(problem, MultipleShooting(40), starts=3)
    # DFET has 0.47196 on meshes that it refines.
    assert point.status == "converged" and point.objectives["torque"] == pytest.approx(0.472, abs=1e-3)
