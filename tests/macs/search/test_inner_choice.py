"""How MACS chooses among inner solvers: which gets the next proposals, and what points bring to a front."""

import re
from functools import cache

import casadi as ca
import numpy as np
import pytest

from macs import MACS, NSGA2
from macs.evaluation.bilevel import Bilevel
from macs.evaluation.evaluator import Evaluation
from macs.search.state import Credit
from macs.search.trials import INNER_SHARES, Gains, choose_inner_solvers
from problems import Problem, load
from problems.compiled import CompiledProblem
from transcription import DFET, parse
from transcription.inner import inner_solver


def known(*rows) -> tuple[Credit, np.ndarray]:
    """Of each inner solver, and of gradient solves: what it gained, at which cost, all work, and evaluations."""
    gained, cost, work, evaluations = np.array(rows, dtype=float).T
    return Credit(gained, cost), np.stack([work, evaluations, np.zeros(len(work))], axis=1)


NO_SOLVES = (0.0, 0.0, 0.0, 0.0)


def test_proposals_go_to_the_solver_that_brings_most_for_its_work():
    credit, spent = known((0.1, 100, 5000, 500), (0.8, 200, 5000, 100), (0.1, 500, 5000, 50), NO_SOLVES)
    assert set(choose_inner_solvers(credit, spent, 10, None)) == {1}
    credit.gained[0] = 1.0
    assert (choose_inner_solvers(credit, spent, 10, None) == 0).sum() >= 9
    ways = known((0.1, 100, 5000, 500), (0.8, 200, 50000, 100), (0.1, 500, 50000, 50), (2.0, 100, 1000, 1))
    assert (choose_inner_solvers(*ways, 10, 20) == 0).all()
    credit, spent = known((0.0, 100, 50, 9), (0.8, 200, 5000, 90), (0.0, 1, 5000, 1), NO_SOLVES)
    assert (choose_inner_solvers(credit, spent, 10, None) == 0).all()
    spent[0, 1] += 2.0
    assert (choose_inner_solvers(credit, spent, 10, None) == 1).all()


def test_solvers_that_take_more_have_their_share_of_work_and_of_solves_to_come():
    """900 by propagation, at one of work each; 45 gradient solves, of ten each, are to come. A candidate takes 10 and 100."""
    credit, spent = known((0.0, 1, 900, 900), (0.0, 1, 0, 0), (0.0, 1, 0, 0), (1.0, 10, 0, 0))
    compiling = INNER_SHARES.least * 900
    assert choose_inner_solvers(credit, spent, 10, None, compiling).tolist() == [0] * 8 + [2, 1], "one each, to know what they take"
    assert (choose_inner_solvers(credit, spent, 10, None, 9 * compiling) == 0).all(), "their functions would take more than their share"
    credit, spent = known((0.0, 1, 900, 900), (0.01, 1, 10, 1), (0.0, 1, 100, 1), (1.0, 9, 0, 0))
    share = INNER_SHARES.dearer - INNER_SHARES.least
    left = share * (900 + 110) - 10, share * (900 + 110 + 902 / 20 * 9) - 10
    assert [(choose_inner_solvers(credit, spent, 40, every) == 1).sum() for every in (None, 20)] == [int(one / 10) for one in left]
    assert (choose_inner_solvers(credit, spent, 40, 20) == 2).sum() == 0, "it has had its least share"


def found(F, violation) -> Evaluation:
    F = np.array(F, dtype=float)
    return Evaluation(np.zeros((len(F), 1)), F, np.array(violation, dtype=float), np.full(len(F), "converged"))


def test_points_bring_what_they_improve_on_average_over_the_directions():
    """With two directions, the single objectives: from 0.4 to 0.1 of the range in the one, nothing in the other."""
    box = Bilevel(DFET(3, 3).nlp(load("goddard")), inner_solver("auto"), 1e-6)
    state = MACS(agents=4, archive=5).begin(box, 100, np.random.default_rng(0))
    state.directions = np.eye(2)
    state.archive = state.archive.take(np.arange(2))
    state.archive.F[:] = [[0.4, 0.5], [0.9, 0.0]]
    state.ideal, state.nadir = np.zeros(2), np.ones(2)
    gains = Gains(state, 1e-6)
    assert gains.of(found([[0.1, 0.9]], [0.0])) == pytest.approx(0.3 / 2)
    assert gains.of(found([[0.1, 0.9]], [0.0])) == 0.0, "it is known now"
    assert gains.of(found([[0.0, -1.0]], [1.0])) == 0.0, "it is infeasible"
    assert gains.of(found([[9.0, -50.0]], [0.0])) == pytest.approx(0.5), "of each direction at most one"
    state.archive = state.archive.take(np.arange(0))
    assert Gains(state, 1e-6).of(found([[0.1, 0.9], [3, 3], [4, 4]], [0.0, 0.0, 1.0])) == 0.0, "there is no front"


def swing() -> Problem:
    """A cart that takes its pole upright: whatever is only propagated misses the end."""
    problem = Problem("swing")
    ride = problem.phase("ride", t0=0.0, tf=(1.0, 3.0))
    ride.state("x", bounds=(-2, 2), initial=0, final=1)
    angle = ride.state("angle", bounds=(-6, 6), initial=0, final=ca.pi)
    v, w = ride.state("v", bounds=(-10, 10), initial=0, final=0), ride.state("w", bounds=(-20, 20), initial=0, final=0)
    u = ride.control("u", bounds=(-20, 20))
    c, s = ca.cos(angle), ca.sin(angle)
    D = 1.3 - 0.3 * c**2
    ride.dynamics(x=v, angle=w, v=(0.15 * s * w**2 + u + 2.943 * c * s) / D, w=-(0.15 * c * s * w**2 + u * c + 12.753 * s) / (0.5 * D))
    problem.minimize("time", ride.tf)
    problem.minimize("energy", ride.integral(u**2))
    return problem


@cache
def swinging() -> CompiledProblem:
    """With which its NLPs are kept."""
    return swing().compile()


MESH = DFET(6, 4)


@pytest.mark.slow
def test_a_divided_search_takes_a_part_of_the_work_and_finds_as_good_a_front():
    def found(inner):
        return MACS(mesh="fixed").solve(swing(), MESH, evaluations=240, seed=1, inner=inner, verify=None)

    projected, auto = found("projection"), found("auto")
    assert 2 * auto.stats["work"] < projected.stats["work"]
    assert (auto.F.min(axis=0) < projected.F.min(axis=0) + 1e-3).all()
    ways = auto.stats["ways"]
    assert set(ways) == {"propagate", "newton", "ipopt"} and "ways" not in projected.stats
    assert sum(one["evaluations"] for one in ways.values()) <= 240 == auto.stats["evaluations"]
    assert all(0 <= one["feasible"] <= one["evaluations"] for one in ways.values())
    # The first population, and gradient solves, fail too, but are not among the candidates of `ways`.
    assert sum(one["evaluations"] - one["feasible"] for one in ways.values()) <= sum(auto.stats["failures"].values())
    told = {name: one for name, one in ways.items() if one["evaluations"]}
    lines = [line for line in auto.table().split("\n") if "candidate" in line]
    assert [[int(one) for one in re.findall(r"\d+", line)] for line in lines] == [
        [one["evaluations"], one["feasible"]] for one in told.values()
    ]


@pytest.mark.slow
def test_a_divided_search_goes_on_to_the_same_bits(tmp_path):
    def go(problem, **more):
        return MACS(agents=4, archive=4, mesh="fixed").solve(problem, MESH, evaluations=120, seed=2, inner="auto", verify=None, **more)

    left = iter(range(2))
    whole = go(swinging())
    part = go(swinging(), checkpoint=tmp_path / "run.ckpt", callback=lambda progress: next(left, None) is None)
    assert part.stats["evaluations"] < 120
    again = go(swing(), checkpoint=tmp_path / "run.ckpt")
    assert np.array_equal(again.F, whole.F) and again.stats["ways"] == whole.stats["ways"]


@pytest.mark.slow
def test_others_use_the_fixed_rule():
    projected, auto = (
        NSGA2(population=8).solve(load("goddard"), parse("dfet:3x3"), evaluations=40, seed=1, inner=inner, verify=None)
        for inner in ("projection", "auto")
    )
    assert np.array_equal(auto.F, projected.F) and "ways" not in auto.stats
