"""Ends of fronts whose own best value leaves the other objective open."""

from __future__ import annotations

import numpy as np
import pytest

from macs.gradients.multistart import GradientSolves, MultistartSolver
from problems import Problem
from transcription import DFET

GOOD, POOR = -1.0, 1.0


def solver_of_two_valleys() -> MultistartSolver:
    """Objective 0 depends on the control alone; objective 1 on the control and on a parameter with valleys near -1 and 1."""
    problem = Problem("valleys")
    run = problem.phase("run", t0=0.0, tf=1.0)
    x, p = run.state("x", bounds=(-2, 2), initial=0), problem.parameter("p", bounds=(-2, 2))
    run.dynamics(x=run.control("u", bounds=(-1, 1)))
    problem.minimize("miss", (run.final(x) - 0.5) ** 2)
    problem.minimize("cost", (p**2 - 1) ** 2 + 0.2 * p + (run.final(x) + 0.5) ** 2)
    return MultistartSolver(DFET(1, 1).nlp(problem), None, 1, np.random.default_rng(0), GradientSolves(1e-6))


def optimum_from(solver: MultistartSolver, i: int, p: float):
    place = [v.name for v in solver.nlp.variables].index("p")
    start = solver.nlp.first_guess(np.zeros((1, len(solver.nlp.free))))[0]
    start[place] = p
    return solver.from_vector(start, np.where(np.arange(2) == i, 0.0, np.inf), np.eye(2)[i]), place


@pytest.mark.parametrize("other", [GOOD, POOR])
def test_an_end_lies_in_the_best_valley_that_is_known(other):
    solver = solver_of_two_valleys()
    (first, place), (second, _) = optimum_from(solver, 0, 0.9 * POOR), optimum_from(solver, 1, other)
    end = solver.ends([first, second])[0]
    valley = min(np.roots([4, 0, -4, 0.2]).real, key=lambda p: abs(p - other))
    assert end.z[place] == pytest.approx(valley, abs=1e-5)
    assert end.F[0] <= first.F[0] + 1e-12 and end.F[1] == pytest.approx((valley**2 - 1) ** 2 + 0.2 * valley + 1.0, abs=1e-5)


def test_optima_that_are_not_given_are_found():
    solver = solver_of_two_valleys()
    ends = solver.ends()
    assert len(ends) == 2 and ends[0].F[0] < 1e-10 and ends[1].F[0] == pytest.approx(1.0, abs=1e-5)


def test_an_end_is_also_sought_from_those_of_the_others():
    problem = Problem("valleys of one")
    run = problem.phase("run", t0=0.0, tf=1.0)
    x, p = run.state("x", bounds=(-2, 2), initial=0), problem.parameter("p", bounds=(-2, 2))
    run.dynamics(x=run.control("u", bounds=(-1, 1)))
    problem.minimize("valleys", (p**2 - 1) ** 2 + 0.2 * p + run.final(x) ** 2)
    problem.minimize("bowl", (p + 1.5) ** 2 + (run.final(x) - 0.5) ** 2)
    solver = MultistartSolver(DFET(1, 1).nlp(problem), None, 1, np.random.default_rng(0), GradientSolves(1e-6))
    (poor, place), (other, _) = optimum_from(solver, 0, 0.9 * POOR), optimum_from(solver, 1, GOOD)
    assert poor.z[place] > 0 > other.z[place], "the one that was found is in the poor valley"
    end = solver.ends([poor, other])[0]
    assert end.z[place] == pytest.approx(np.roots([4, 0, -4, 0.2]).real.min(), abs=1e-5) and end.F[0] < poor.F[0] - 0.3
