"""Searches over whole vectors: states are variables of the search, and the dynamics constraints like others."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from cases import candidates, integrator, oscillator

from macs import NSGA3
from problems import load
from transcription import DFET, Collocation, MultipleShooting, SingleShooting
from transcription.inner import NAMED, inner_solver

METHODS = (
    DFET(2, 3),
    Collocation(2, 4),
    Collocation(1, 8, points="gauss"),
    Collocation(1, 8, points="chebyshev"),
    MultipleShooting(6),
    SingleShooting(9),
)


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_all_variables_with_bounds_are_searched_and_scored_as_they_are(method):
    nlp = method.nlp(load("goddard").compile())
    whole = NAMED["none"].program(nlp)
    assert whole is nlp.whole and len(whole.free) == len(nlp.variables) and not np.array_equal(whole.free, nlp.free)
    X = candidates(whole, 5)
    found = inner_solver("none").solve(whole, X)
    F, residuals = nlp.residuals(X)
    assert np.array_equal(found.z, X) and np.array_equal(found.F, F) and not found.moved.any()
    assert found.violation == pytest.approx(residuals.max(axis=1)) and set(found.status) == {"infeasible"}
    flown = nlp.propagate(nlp.first_guess(candidates(nlp, 1)))
    inside = np.clip(flown, nlp.lower, nlp.upper)
    assert inner_solver("none").solve(whole, inside).violation == pytest.approx(nlp.evaluate(inside)[1]), "nothing is propagated"


def test_peaks_and_absolute_values_follow_from_the_rest():
    problem, run = integrator()
    problem.minimize("peak", run.peak(run["x"] ** 2))
    problem.minimize("way", run.integral(ca.fabs(run["u"])))
    nlp = Collocation(2, 3).nlp(problem.compile())
    whole = nlp.whole
    left = np.setdiff1d(np.arange(len(nlp.variables)), whole.free)
    assert {nlp.variables[i].name.split("[")[0] for i in left} == {"run.peak", "run.size"}
    z = inner_solver("none").solve(whole, candidates(whole, 1)).z
    assert np.array_equal(z, nlp.tighten(z)) and np.abs(z[0, left]).max() > 0


@pytest.mark.slow
def test_a_population_search_has_the_dynamics_among_its_constraints():
    method = Collocation(2, 3)
    front = NSGA3(population=20).solve(oscillator(), method, evaluations=2_000, seed=1, inner="none", tolerance=0.05, verify=None)
    assert len(front) and front.violation.max() <= 0.05 and front.stats["inner"] == "none" and front.stats["evaluations"] == 2_000
    flown = front[0].simulate()
    assert 1e-4 < flown.max_defect < 0.5, "nothing has propagated them"
    again = NSGA3(population=20).solve(oscillator(), method, evaluations=2_000, seed=1, inner="none", tolerance=0.05, verify=None)
    assert np.array_equal(front.F, again.F), "the same seed gives the same bits"
    tight = NSGA3(population=20).solve(load("goddard"), method, evaluations=200, seed=1, inner="none", verify=None)
    assert not len(tight) and "violates" in tight.message
