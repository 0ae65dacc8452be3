"""Integrals of absolute values: smooth for gradient tools where they are minimised or bounded above, the same numbers everywhere else."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from macs import optimize
from problems import Problem
from transcription import DFET

DISTANCE, TIME = 3.0, 4.0


def transfer(state=lambda problem, fuel: problem.minimize("fuel", fuel)) -> Problem:
    """From rest to rest over a distance in a time, with a thrust of at most 1 either way."""
    problem = Problem("transfer")
    phase = problem.phase("push", t0=0.0, tf=TIME)
    phase.state("x", bounds=(-10, 10), initial=0, final=DISTANCE)
    v = phase.state("v", bounds=(-5, 5), initial=0, final=0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=v, v=u)
    state(problem, phase.integral(ca.fabs(u)))
    return problem


@pytest.mark.parametrize("basis", ["lobatto", "bernstein"])
def test_least_fuel_is_bang_off_bang(basis):
    """Thrust, coast, thrust against: each burn lasts (T - sqrt(T^2 - 4 d)) / 2 = 1, an element of this mesh."""
    point = optimize(transfer(), DFET(4, 2, basis=basis))
    assert point.status == "converged"
    assert point.objectives["fuel"] == pytest.approx(TIME - np.sqrt(TIME**2 - 4 * DISTANCE), abs=1e-7)
    u = point.trajectory["push"].at(np.array([0.5, 2.0, 3.5]))["u"]
    np.testing.assert_allclose(u, [1.0, 0.0, -1.0], atol=1e-6)
    assert point.simulate().objectives["fuel"] == pytest.approx(2.0, abs=1e-6)
    assert point.optimality < 1e-6


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
    point = optimize(problem, DFET(8, 2))
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
    assert transfer().compile().phases[0].sized == (0,)
