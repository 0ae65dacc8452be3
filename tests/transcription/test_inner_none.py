"""Searches over whole vectors: states are variables of the search, and the dynamics constraints like others."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from cases import candidates, integrator, oscillator

from macs import MACS, NSGA3
from problems import Problem, load
from transcription import DFET, Collocation, MultipleShooting, SingleShooting, Smooth
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


def test_it_is_what_evaluations_are_made_of():
    nlp = Collocation(2, 4).nlp(load("goddard").compile())
    solved = inner_solver("ipopt").solve(nlp, candidates(nlp, 1))
    again = inner_solver("none").solve(nlp.whole, solved.z, solved.z)
    assert again.status[0] == "converged" and np.array_equal(again.F, solved.F)


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


def test_profiles_of_states_are_in_time_and_smooth_about_the_guess():
    problem = Problem("two")
    phase = problem.phase("run", t0=0, tf=(1, 2))
    phase.state("x", bounds=(-10, 10), initial=1, final=3)
    u = phase.control("u", bounds=(-5, 5))
    phase.dynamics(x=u)
    problem.minimize("time", phase.tf)
    phase.guess(x=(1, 3), u=2)
    for method in (Collocation(3, 4), Collocation(3, 4, points="lobatto"), DFET(3, 3), MultipleShooting(8)):
        nlp = method.nlp(problem.compile()).whole
        profile = next(one for one in nlp.profiles if one.name == "run.x")
        assert (np.diff(profile.places) >= 0).all()
        assert all(nlp.variables[nlp.free[i]].name.startswith("run.x") for i in profile.columns)
        assert nlp.guess[profile.columns] == pytest.approx(1 + 2 * profile.places)
        rng = np.random.default_rng(0)
        drawn = Smooth(spread=0.05, length=0.5).shaped(nlp, nlp.lower[nlp.free] + nlp.span[nlp.free] * rng.random((200, len(nlp.free))))
        away = drawn[:, profile.columns] - (1 + 2 * profile.places)
        assert 0.5 < away.std() < 1.5 and np.abs(np.diff(away, axis=1)).max() < 1.5


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


@pytest.mark.slow
def test_gradient_solves_make_its_points_feasible():
    front = MACS(mesh="fixed").solve(load("goddard"), Collocation(2, 4), evaluations=300, seed=1, inner="none")
    assert len(front) >= 5 and front.violation.max() < 1e-6
