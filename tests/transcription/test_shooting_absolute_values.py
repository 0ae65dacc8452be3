"""Integrals of absolute values by shooting: smooth where controls are piecewise constant, exact on their nodes."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import linprog

from macs import optimize
from problems import Problem
from transcription import MultipleShooting, SingleShooting

TIME = 4.0


def transfer(distance: float, integrand=lambda phase: ca.fabs(phase["u"])) -> Problem:
    """From rest to rest over a distance in a time, with a thrust of at most 1 either way."""
    problem = Problem("transfer")
    phase = problem.phase("push", t0=0.0, tf=TIME)
    phase.state("x", bounds=(-10, 10), initial=0, final=distance)
    v = phase.state("v", bounds=(-5, 5), initial=0, final=0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=v, v=u)
    problem.minimize("fuel", phase.integral(integrand(phase)))
    return problem


def least_fuel(distance: float, count: int) -> float:
    """Of controls that are constant on equal intervals: a linear program in their positive and negative parts."""
    h = TIME / count
    after = TIME - h * (np.arange(count) + 0.5)
    ends = np.array([h * after, np.full(count, h)])
    found = linprog(np.full(2 * count, h), A_eq=np.hstack([ends, -ends]), b_eq=[distance, 0.0], bounds=(0, 1))
    return float(found.fun)


@pytest.mark.parametrize("method", [MultipleShooting(8), SingleShooting(9), MultipleShooting(4, steps=3, control_nodes=9)])
def test_burns_that_end_on_nodes_are_exact(method):
    """Thrust, coast, thrust against: each burn lasts (T - sqrt(T^2 - 4 d)) / 2 = 1."""
    point = optimize(transfer(3.0), method, starts=1)
    assert point.status == "converged"
    assert point.objectives["fuel"] == pytest.approx(2.0, abs=1e-6)
    assert point.simulate().objectives["fuel"] == pytest.approx(2.0, abs=1e-6)
    u = point.trajectory["push"].at(np.array([0.2, 0.8, 1.4, 2.6, 3.4, 3.8]))["u"]
    np.testing.assert_allclose(u, [1, 1, 0, 0, -1, -1], atol=1e-5)


@pytest.mark.parametrize(
    "integrand", [lambda phase: 0.5 * ca.fabs(phase["u"]) + phase["v"], lambda phase: ca.fabs(0.5 * phase["u"]) + phase["v"]]
)
def test_others_are_as_good_as_such_controls_allow(integrand):
    point = optimize(transfer(-1.0, integrand), MultipleShooting(9), starts=1)
    assert point.status == "converged"
    assert point.objectives["fuel"] == pytest.approx(0.5 * least_fuel(-1.0, 9) - 1.0, abs=1e-6)


def test_candidates_are_scored_by_the_absolute_values_themselves():
    nlp = MultipleShooting(6).transcribe(transfer(1.0))
    candidates = np.random.default_rng(0).uniform(-1, 1, (5, len(nlp.free)))
    Z = nlp.propagate(nlp.first_guess(candidates))
    for z, F in zip(Z, nlp.evaluate(Z)[0], strict=True):
        u = nlp.unpack(z)["push"].at(TIME / 6 * (np.arange(6) + 0.5))["u"]
        assert F[0] == pytest.approx(TIME / 6 * np.abs(u).sum(), rel=1e-12)


def test_what_varies_on_an_interval_is_left_as_it_is():
    def rows(method: MultipleShooting, integrand) -> int:
        return sum("absolute values" in label for label in method.transcribe(transfer(1.0, integrand)).g_labels)

    assert rows(MultipleShooting(6), lambda phase: ca.fabs(phase["u"])) == 2 * 6
    assert rows(MultipleShooting(6), lambda phase: ca.fabs(phase["u"]) + ca.fabs(phase["v"]) + ca.fabs(phase.time * phase["u"])) == 2 * 6
    assert rows(MultipleShooting(6, control="linear"), lambda phase: ca.fabs(phase["u"])) == 0
