"""A search that ends where nothing is feasible, and what it says of that."""

import numpy as np
import pytest

from macs import MACS, optimize, payoff, sweep
from macs.gradients.multistart import MultistartSolver, guessed_start
from macs.gradients.scalarised import GradientSolves, Scalarised
from problems import Problem
from transcription import DFET


def ride(low: float) -> Problem:
    """A walk whose sum of place and speed stays below `low`, and whose difference above 0.2: both at the start, at rest at 0, only if low
    is at least 0."""
    problem = Problem("ride")
    walk = problem.phase("walk", t0=0.0, tf=(0.5, 3.0))
    x, v = walk.state("x", bounds=(-10, 10), initial=0), walk.state("v", bounds=(-5, 5), initial=0, final=-1)
    u = walk.control("u", bounds=(-5, 5))
    walk.dynamics(x=v, v=u)
    walk.path("sum", x + v, upper=low, unit="m")
    walk.path("place", x, lower=-2.0)
    problem.minimize("time", walk.tf)
    problem.minimize("effort", walk.integral(u**2))
    return problem


@pytest.mark.parametrize(("inner", "least", "most"), [("auto", 5, 10), pytest.param("projection", 30, 500, marks=pytest.mark.slow)])
def test_a_search_ends_where_solves_for_feasibility_find_nothing(tmp_path, inner, least, most):
    """At rest at 0 the sum is 0: it exceeds -0.5 by half of its scale, wherever a solve begins."""
    terms = {"evaluations": 5000, "seed": 1, "inner": inner, "checkpoint": tmp_path / "run.ckpt"}
    front = MACS(agents=5, archive=5).solve(ride(-0.5), DFET(3, 3), **terms)
    assert len(front) == 0 and front.stats["stopped"] == "settled" and least <= front.stats["evaluations"] < most
    assert (
        "solves for feasibility from different starts find none nearby" in front.message
        and "violates path 'sum' of 'walk' by 0.5 of its scale, 1 m" in front.message
    )
    assert front.closest.violations["path 'sum' of 'walk'"] == pytest.approx(0.5, abs=1e-3)
    again = MACS(agents=5, archive=5).solve(ride(-0.5), DFET(3, 3), **terms)
    assert again.message == front.message


def unreachable() -> Problem:
    """From rest at 0 to rest at 1 in a unit of time, where 0.25 is the most."""
    problem = Problem("walk")
    walk = problem.phase("walk", t0=0.0, tf=1.0)
    walk.state("x", bounds=(-4, 4), initial=0, final=1)
    v, u = walk.state("v", bounds=(-1, 1), initial=0, final=0), walk.control("u", bounds=(-1, 1))
    walk.dynamics(x=v, v=u)
    problem.minimize("effort", walk.integral(u**2))
    problem.minimize("jerk", walk.integral(u**4))
    return problem


@pytest.mark.slow
def test_the_conflict_is_known_after_few_solves_by_all_ways():
    """A metre is an eighth of the scale; the nearest end at rest, on any mesh with an edge or node in the middle, is at 0.25."""
    problem = unreachable().compile()
    fronts = [MACS().solve(problem, seed=1), sweep(problem, points=5), payoff(problem), optimize(problem).alone()]
    for front in fronts:
        point = front[0] if len(front) else front.closest
        assert point.status == "infeasible" and point.violations["final value of walk.x"] == pytest.approx(0.75 / 8, abs=1e-3)
        words = front.message or point.note
        assert "violates final value of walk.x by 0.094 of its scale, in conflict with final value of walk.v" in words
        assert front.stats["gradient_solves"] <= 60 and front.stats["evaluations"] <= 60


def test_what_is_feasible_is_reached_from_infeasible_solves():
    """With as good as no iterations, a solve from the guess ends where nothing is feasible; one from a feasible vector follows."""
    nlp = DFET(4, 3).nlp(ride(0.0))
    solver = MultistartSolver(nlp, guessed_start(nlp), None, np.random.default_rng(0), GradientSolves(1e-6))
    task = Scalarised.single(0, 2)
    with solver.solves.at_most(2):
        poor = solver.solve(task)
    assert poor.status != "converged" and poor.violation > 1e-3
    assert solver.with_feasible_start(poor, task).status == "converged" and solver.closest is None


@pytest.mark.slow
def test_it_goes_on_where_something_is_feasible():
    front = MACS(agents=5, archive=5, mesh="fixed").solve(ride(0.0), DFET(3, 3), evaluations=300, seed=1, verify=None)
    assert len(front) == 5 and front.stats["stopped"] == "budget" and front.stats["evaluations"] == 300


def test_what_is_only_propagated_is_no_reason_to_end():
    solver = MACS(agents=5, archive=5, mesh="fixed", refine=False)
    front = solver.solve(ride(-0.5), DFET(3, 3), evaluations=300, seed=1, verify=None, inner="propagate")
    assert len(front) == 0 and front.stats["evaluations"] == 300 and "solves for feasibility" not in front.message
    function = lambda X: (np.column_stack([X[:, 0], 1 - X[:, 0]]), np.ones((len(X), 1)))  # noqa: E731
    front = MACS(agents=5, archive=5).minimize(function, [(0, 1)] * 2, evaluations=200, seed=1)
    assert len(front) == 0 and front.stats["evaluations"] == 200
