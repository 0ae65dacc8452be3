"""How MACS divides its effort among inner solvers: who gets the next proposals, and what points bring to a front."""

from __future__ import annotations

import re
from functools import cache

import casadi as ca
import numpy as np
import pytest

from macs import MACS
from macs.evaluation.bilevel import Bilevel
from macs.evaluation.evaluator import Evaluation
from macs.search.effort import CHEAP, DEAR, LEAST, Gains, credited, evaluated, no_effort, spent, ways_of
from problems import Problem, load
from problems.compiled import CompiledProblem
from transcription import DFET, parse
from transcription.inner import Auto, inner_solver


def effort(*rows) -> np.ndarray:
    """Of each way, and of gradient solves: what it brought, for which work, all work, evaluations, of which none was feasible."""
    return np.array([(*row, 0) for row in rows], dtype=float)


def test_proposals_go_to_the_way_that_brings_most_for_its_work():
    known = effort((0.1, 100, 5000, 500), (0.8, 200, 5000, 100), (0.1, 500, 5000, 50), (0.0, 0.0, 0.0, 0.0))
    assert set(ways_of(known, 10, None)) == {1}
    known[0, 0] = 1.0
    assert (ways_of(known, 10, None) == 0).sum() >= 9


def test_where_gradient_solves_bring_most_proposals_are_propagated():
    known = effort((0.1, 100, 5000, 500), (0.8, 200, 50000, 100), (0.1, 500, 50000, 50), (2.0, 100, 1000, 1))
    assert (ways_of(known, 10, 20) == 0).all()


def test_a_way_that_takes_less_has_its_share_of_evaluations():
    known = effort((0.0, 100, 50, CHEAP * 100 - 1), (0.8, 200, 5000, 100 - CHEAP * 100), (0.0, 1, 5000, 1), (0.0, 0.0, 0.0, 0.0))
    assert (ways_of(known, 10, None) == 0).all()
    known[0, 3] += 2.0
    assert (ways_of(known, 10, None) == 1).all()


def test_ways_that_take_more_have_their_share_of_work_and_of_solves_to_come():
    """900 by propagation, at one of work each; 45 gradient solves, of ten each, are to come. A candidate takes 10 and 100."""
    known = effort((0.0, 1, 900, 900), (0.0, 1, 0, 0), (0.0, 1, 0, 0), (1.0, 10, 0, 0))
    assert ways_of(known, 10, None).tolist() == [0] * 8 + [2, 1], "one each, as long as nobody knows what they take"
    making = LEAST * 900
    assert ways_of(known, 10, None, making).tolist() == [0] * 8 + [2, 1], "their shares are worth as much as their functions"
    assert (ways_of(known, 10, None, 1.01 * making)[:9] == 0).all() and (ways_of(known, 10, None, 9 * making) == 0).all()
    known[1, :4], known[2, :4] = (0.01, 1, 10, 1), (0.0, 1, 100, 1)
    share = DEAR - LEAST
    left = share * (900 + 110) - 10, share * (900 + 110 + 902 / 20 * 10) - 10
    assert [(ways_of(known, 40, every) == 1).sum() for every in (None, 20)] == [int(one / 10) for one in left]
    assert (ways_of(known, 40, 20) == 2).sum() == 0, "it has had its least share"


def test_what_was_brought_is_forgotten_but_not_what_gradient_solves_brought():
    after = credited(no_effort(2, 1000), 0, 0.5, 30, 10, 7)
    assert after.tolist() == [[0.5, 30, 30, 10, 7], [0, 0, 0, 0, 0], [1.0, 1000, 0, 0, 0]]
    again = credited(after, 1, 0.0, 70, 5)
    assert again[:2].tolist() == [[0.45, 27, 30, 10, 7], [0, 70, 70, 5, 0]] and (again[2] == after[2]).all()
    one, two = {"evaluations": 10, "feasible": 7, "work": 30}, {"evaluations": 5, "feasible": 0, "work": 70}
    assert spent(again, ("one", "two")) == {"one": one, "two": two}


def found(F, violation) -> Evaluation:
    F = np.array(F, dtype=float)
    return Evaluation(np.zeros((len(F), 1)), F, np.array(violation, dtype=float), np.full(len(F), "converged"))


def test_points_bring_what_they_improve_on_average_over_the_directions():
    """With two directions, the single objectives: from 0.4 to 0.1 of the range in the one, nothing in the other."""
    front = MACS(agents=4, archive=5, directions=2)
    box = Bilevel(DFET(3, 3).nlp(load("goddard")), inner_solver("auto"), 1e-6)
    state = front.begin(box, 100, np.random.default_rng(0))
    assert len(state.directions) == 2 and (np.sort(state.directions, axis=1) == [0.0, 1.0]).all()
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


def evaluator(tolerance: float = 1e-6) -> Bilevel:
    return Bilevel(MESH.nlp(swing()), Auto(), tolerance)


@pytest.mark.slow
def test_proposals_keep_their_order():
    box, rng = evaluator(), np.random.default_rng(3)
    state = MACS(agents=4, archive=4).begin(box, 200, rng)
    Z = state.agents.Z.copy()
    Z[:, box.free] = np.clip(Z[:, box.free] + 0.01 * rng.standard_normal(Z[:, box.free].shape), box.lower, box.upper)
    state.effort[:] = 0.0
    assert len(set(ways_of(state.effort, 4, None))) > 1
    together = evaluated(state, box, Z, Gains(state, 1e-6), None)
    for z, nearest in zip(Z, together.Z, strict=True):
        assert np.abs(nearest - z)[box.free].max() < 0.5 * np.ptp([box.lower, box.upper], axis=0).max()
        assert np.abs(nearest - z)[box.free].sum() <= min(np.abs(nearest - other)[box.free].sum() for other in Z) + 1e-9


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
    from macs import NSGA2

    projected, auto = (
        NSGA2(population=8).solve(load("goddard"), parse("dfet:3x3"), evaluations=40, seed=1, inner=inner, verify=None)
        for inner in ("projection", "auto")
    )
    assert np.array_equal(auto.F, projected.F) and "ways" not in auto.stats


@pytest.mark.slow
def test_without_gradients_candidates_are_made_feasible_as_by_the_fixed_rule():
    """Nothing else would: what is only propagated costs little, and is hardly ever feasible."""

    def found(inner):
        return MACS(agents=4, archive=5, refine=False).solve(swinging(), MESH, evaluations=60, seed=1, inner=inner, verify=None)

    assert np.array_equal(found("auto").F, found("projection").F)
