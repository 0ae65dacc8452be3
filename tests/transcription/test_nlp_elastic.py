"""The least violation near a vector: a closed form, conflicts, methods, and where it does not begin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from problems import Problem, load
from transcription import DFET, Collocation, MultipleShooting, SingleShooting
from transcription.nlp.elastic import least_violation, opposing
from transcription.stopping import stopped_by

METHODS = [DFET(2, 2, control_order=0), MultipleShooting(2), SingleShooting(3)]


def walk(end: float) -> Problem:
    """From rest at 0 to rest at `end` in a unit of time, with |u| <= 1: at most 0.25, by the full push and the full brake."""
    problem = Problem("walk")
    phase = problem.phase("walk", t0=0.0, tf=1.0)
    phase.state("x", bounds=(-4, 4), initial=0, final=end)
    v = phase.state("v", bounds=(-1, 1), initial=0, final=0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=v, v=u)
    problem.minimize("effort", phase.integral(u**2))
    return problem


def started(nlp, seed=0):
    rng = np.random.default_rng(seed)
    return nlp.first_guess((nlp.lower[nlp.free] + rng.random(len(nlp.free)) * nlp.span[nlp.free])[None])[0]


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=repr)
@settings(max_examples=20)
@given(end=st.floats(0.3, 3.0), seed=st.integers(0, 50))
def test_what_is_out_of_reach_is_missed_by_least(method, end, seed):
    """A metre costs 1/8, a metre per second 1/2: 0.25 at rest is nearest. Beyond, a metre per second would bring half a metre."""
    nlp = method.nlp(walk(end))
    solved = least_violation(nlp, started(nlp, seed))
    assert solved.status == "infeasible" and "no smaller" in solved.message and 0 < solved.iterations < 100
    violations = nlp.violations(solved.z)
    assert violations.pop("final value of walk.x") == pytest.approx((end - 0.25) / 8, abs=1e-6)
    assert max(violations.values()) < 1e-6
    assert opposing(nlp, solved.z) == ("final value of walk.v",)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "method"), [("goddard", DFET(8, 3)), ("landing_site", Collocation(6, 3)), ("orbit_rise", DFET(20, 3))])
def test_trajectories_are_found_from_anywhere(name, method):
    nlp = method.nlp(load(name))
    for seed in range(5):
        solved = least_violation(nlp, started(nlp, seed))
        assert solved.status == "converged" and solved.iterations < 100


def test_constraints_in_conflict_are_named_and_dynamics_obeyed():
    problem = Problem("drift")
    drift = problem.phase("drift", t0=0.0, tf=1.0)
    x, u = drift.state("x", bounds=(-4, 4), initial=0), drift.control("u", bounds=(-4, 4))
    drift.dynamics(x=u)
    drift.path("low", x, upper=0.5)
    problem.constraint("high", drift.final(x), lower=1.0)
    problem.minimize("effort", drift.integral(u**2))
    for method in (DFET(4, 3), Collocation(4, 3), MultipleShooting(8)):
        nlp = method.nlp(problem)
        solved = least_violation(nlp, started(nlp))
        missed = {name: size for name, size in nlp.violations(solved.z).items() if size > 1e-6}
        assert solved.status == "infeasible" and missed and missed.keys() <= {"path 'low' of 'drift'", "constraint 'high'"}


def test_it_does_not_begin_where_the_work_is_to_end_or_nothing_is_a_number():
    nlp = DFET(2, 2).nlp(walk(0.1))
    with stopped_by(lambda: "enough"):
        solved = least_violation(nlp, started(nlp))
    assert (solved.status, solved.begun) == ("timeout", False)
    solved = least_violation(nlp, np.full(len(nlp.variables), np.nan))
    assert (solved.status, solved.begun) == ("failed", False)
