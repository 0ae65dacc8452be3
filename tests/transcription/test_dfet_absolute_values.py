"""Integrals of absolute values: smooth for gradient tools where they are minimised or bounded above, the same numbers everywhere else."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from macs import optimize
from problems import Phase, Problem
from transcription import DFET

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


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_least_fuel_is_bang_off_bang(basis):
    """Thrust, coast, thrust against: each burn lasts (T - sqrt(T^2 - 4 d)) / 2 = 1, an element of this mesh."""
    point = optimize(transfer(), DFET(4, 2, basis=basis), starts=1)
    assert point.status == "converged"
    assert point.objectives["fuel"] == pytest.approx(TIME - np.sqrt(TIME**2 - 4 * DISTANCE), abs=1e-7)
    u = point.trajectory["push"].at(np.array([0.5, 2.0, 3.5]))["u"]
    np.testing.assert_allclose(u, [1.0, 0.0, -1.0], atol=1e-6)
    assert point.simulate().objectives["fuel"] == pytest.approx(2.0, abs=1e-6)
    assert point.optimality < 1e-6


@pytest.mark.parametrize(
    "integral",
    [
        lambda phase, u: 2 * phase.integral(0.5 * ca.fabs(u)),
        lambda phase, u: 3 * phase.integral(ca.fabs(u) / 3.0),
        lambda phase, u: phase.integral(ca.fabs(u) + phase["v"]) - DISTANCE,
        lambda phase, u: -phase.integral(phase["v"] - (ca.fabs(2 * u) + ca.fabs(u)) / 3) + DISTANCE,
        lambda phase, u: phase.integral(ca.norm_1(u)),
    ],
)
def test_terms_and_factors_are_no_obstacle(integral):
    point = optimize(transfer(integral=integral), DFET(4, 2), starts=1)
    assert point.status == "converged"
    assert point.objectives["fuel"] == pytest.approx(TIME - np.sqrt(TIME**2 - 4 * DISTANCE), abs=1e-7)


@pytest.mark.parametrize(
    "integrand", [lambda a, b: ca.fabs(a) + 2 * ca.fabs(b), lambda a, b: ca.dot(ca.DM([1, 2]), ca.fabs(ca.vertcat(a, b)))]
)
def test_two_controls_each_have_their_own(integrand):
    """Two such transfers at once, along two axes; distances 3 and 1.75 need burns of 1 and of 0.5, two each."""
    problem = Problem("plane")
    phase = problem.phase("push", t0=0.0, tf=TIME)
    rates, controls = {}, []
    for axis, distance in (("x", DISTANCE), ("y", -1.75)):
        phase.state(axis, bounds=(-10, 10), initial=0, final=distance)
        v = phase.state(f"v{axis}", bounds=(-5, 5), initial=0, final=0)
        u = phase.control(f"u{axis}", bounds=(-1, 1))
        rates |= {axis: v, f"v{axis}": u}
        controls.append(u)
    phase.dynamics(**rates)
    problem.minimize("fuel", phase.integral(integrand(*controls)))
    assert problem.compile().phases[0].sized == (0, 1)
    point = optimize(problem, DFET(8, 2), starts=1)
    assert point.status == "converged"
    assert point.objectives["fuel"] == pytest.approx(2 * 1.0 + 2 * 2 * 0.5, abs=1e-7)


def test_each_term_is_judged_by_its_own_sign():
    def fuel(phase: Phase, u: ca.MX) -> ca.MX:
        return phase.integral(ca.fabs(u) - 0.5 * ca.fabs(phase["v"]) + u**2)

    assert transfer(integral=fuel).compile().phases[0].sized == (0,)
    assert transfer(lambda problem, value: problem.maximize("fuel", value), fuel).compile().phases[0].sized == (1,)


def test_a_bound_above_is_as_good():
    """As far as possible with a given amount of fuel: two burns of half of it each, d = tb (T - tb)."""

    def farthest(problem: Problem, fuel: ca.MX) -> None:
        problem.constraint("fuel", fuel, upper=1.0)
        problem.maximize("distance", problem.phases["push"].final(problem.phases["push"]["x"]))

    problem = Problem("far")
    phase = problem.phase("push", t0=0.0, tf=4.0)
    phase.state("x", bounds=(-10, 10), initial=0)
    v = phase.state("v", bounds=(-5, 5), initial=0, final=0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=v, v=u)
    farthest(problem, phase.integral(ca.fabs(u)))
    assert problem.compile().phases[0].sized == (0,)
    point = optimize(problem, DFET(8, 2), starts=1)
    assert point.status == "converged" and point.objectives["distance"] == pytest.approx(0.5 * 3.5, abs=1e-6)


def test_candidates_are_scored_by_the_absolute_values_themselves():
    nlp = DFET(3, 2).transcribe(transfer())
    rng = np.random.default_rng(0)
    candidates = rng.uniform(-1, 1, (5, len(nlp.free)))
    Z = nlp.propagate(nlp.first_guess(candidates))
    nodes, weights = np.polynomial.legendre.leggauss(3)
    for z, F in zip(Z, nlp.evaluate(Z)[0], strict=True):
        flight = nlp.unpack(z)["push"]
        total = sum(0.5 * TIME / 3 * weights @ np.abs(flight.controls_on(j, nodes)[:, 0]) for j in range(3))
        assert F[0] == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize(
    "state",
    [
        lambda problem, fuel: problem.maximize("fuel", fuel),
        lambda problem, fuel: problem.minimize("fuel", -fuel),
        lambda problem, fuel: problem.minimize("fuel", (fuel - 1.0) ** 2),
        lambda problem, fuel: (problem.minimize("fuel", fuel), problem.constraint("least", fuel, lower=1.0)),
    ],
)
def test_where_large_is_good_they_are_left_as_they_are(state):
    assert transfer(state).compile().phases[0].sized == ()
    assert DFET(3, 2).transcribe(transfer(state)).problem.phases[0].sizes.size_out(0) == (0, 1)
    assert transfer().compile().phases[0].sized == (0,)
