"""A search without a number of evaluations: when its rounds count as progress, and when it ends."""

import os
import signal
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from compiled_cases import compiled
from hypothesis import given, settings
from hypothesis import strategies as st
from test_gradient_actions import walk

from macs import MACS, NSGA2, Front
from macs.evaluation import bilevel
from macs.gradients import scalarised
from macs.gradients.scalarised import WORK
from macs.pareto import directions
from macs.search import rounds as module
from macs.search.rounds import DONE, ROUND_LIMITS, Rounds, beyond, gains, improves, next_round
from problems import load
from problems.cases import goddard
from problems.compiled import CompiledProblem
from runs.measures.indicators import gd, hypervolume
from transcription import DFET

QUARTER = np.stack([1 - np.sin(np.linspace(0, np.pi / 2, 41)), 1 - np.cos(np.linspace(0, np.pi / 2, 41))], axis=1)
"""Points of a convex front between (1, 0) and (0, 1)."""
ONE = np.ones(2)
EVERY = directions.pool(2, 100)


FIRST = ROUND_LIMITS.first


def after(known: Rounds, found: np.ndarray, evaluations: int, unsettled: bool = False, ceiling: int = 10**6, work: int = 0) -> Rounds:
    return next_round(known, found, np.empty((0, 2)), np.inf, EVERY, evaluations, work, True, unsettled, ceiling)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.0, 0.2), st.integers(0, 40))
def test_the_distance_beyond_a_front(distance, k):
    """A point moved straight towards the ideal lies beyond by the move, less what its neighbours' line is short of the curve."""
    sag = 1 - np.cos(np.pi / 160)
    found = beyond(QUARTER[[k]] - distance, QUARTER)[0]
    assert found <= distance + 1e-9
    assert found >= distance - 3 * sag or k in (0, 40)


def test_what_is_progress_beyond_a_front_of_many_points_or_one():
    better = QUARTER[18:23] - 0.05
    volume, mean, end = gains(better, QUARTER, ONE, EVERY)
    assert volume > 1e-3 and mean > 1e-3 and end == 0.0
    assert gains(np.array([[-0.01, 1.0]]), QUARTER, ONE, EVERY)[2] == pytest.approx(0.01 / 1.01)
    assert not improves(QUARTER - 0.5 * ROUND_LIMITS.beyond, QUARTER, ONE, EVERY)
    coarse = QUARTER[::8]
    middle = 0.5 * (coarse[:-1] + coarse[1:])
    assert beyond(middle, coarse).max() < 1e-9 and not improves(middle, coarse, ONE, EVERY)
    assert gains(coarse, coarse, ONE, EVERY) == (0.0, 0.0, 0.0)
    # Objectives in no conflict: rounding is no progress, in whatever units.
    extent = np.array([1e6, 1e-6])
    best = np.array([[3.0, 5.0]])
    assert not improves(best - 1e-7 * extent, best, extent, EVERY)
    assert improves(best - 1e-2 * extent, best, extent, EVERY)
    best, nearly, only = np.array([[-40.0]]), np.array([1e-5]), np.ones((1, 1))
    assert not improves(best - 1e-4, best, nearly, only)
    assert improves(best - 0.01, best, nearly, only)
    assert improves(np.array([[-1e-8]]), np.zeros((1, 1)), nearly, only), "of an optimum at 0 what was seen is all there is"


@pytest.mark.slow
def test_one_objective_ends_soon():
    front = MACS().solve(load("standard/car"), seed=1)
    assert front.stats["stopped"] == DONE and front.stats["evaluations"] < 2000
    assert front[0].objectives["time"] == pytest.approx(np.sqrt(2 * 300 * (1 / 1 + 1 / 2)), abs=1e-3)  # 300 m, by up to 1 and -2 m/s2


def test_it_ends_after_as_much_without_progress_as_is_stated_or_at_a_ceiling():
    first = after(Rounds.first(2, True, 10**6), QUARTER, FIRST)
    assert first.end == 2 * FIRST and first.improved == FIRST and not first.stopped
    assert after(first, QUARTER, 2 * FIRST).stopped == DONE
    some = after(first, QUARTER, 2 * FIRST, unsettled=True)
    assert not some.stopped and some.end == 3 * FIRST and some.due > first.due > 0
    late = after(first, QUARTER - 0.1, 2 * FIRST)
    assert late.improved == 2 * FIRST and not after(late, QUARTER - 0.1, 3 * FIRST).stopped, "a later round made progress"
    long = replace(late, improved=10_000)
    at = int(10_000 * (1 + ROUND_LIMITS.again))
    assert not after(long, QUARTER, at - 1, work=WORK.little).stopped and after(long, QUARTER, at, work=WORK.little).stopped == DONE
    first = after(Rounds.first(2, True, 10**6), QUARTER, FIRST, unsettled=True, work=1000)
    at, enough = 3 * FIRST, 1000 + int(WORK.little)
    assert first.work == 1000 and not after(first, QUARTER, at, unsettled=True, work=enough - 1).stopped
    assert after(first, QUARTER, at, unsettled=True, work=enough).stopped == DONE
    assert after(first, QUARTER, at, work=1000).stopped == DONE
    assert after(first, QUARTER, (1 + ROUND_LIMITS.long) * FIRST, unsettled=True, work=enough - 1).stopped == DONE
    first = after(Rounds.first(2, True, FIRST + 50), QUARTER, FIRST, ceiling=FIRST + 50)
    assert first.end == FIRST + 50 and not first.stopped
    assert after(first, QUARTER - 0.1, FIRST + 50, ceiling=FIRST + 50).stopped == "ceiling"
    none = np.empty((0, 2))

    def later(known, violation, evaluations):
        return next_round(known, none, none, violation, EVERY, evaluations, evaluations * int(WORK.little), True, False, 10**6)

    first = later(Rounds.first(2, True, 10**6), 1.0, FIRST)
    assert first.improved == FIRST and not len(first.front)
    assert later(first, 0.5, 2 * FIRST).improved == 2 * FIRST and later(first, 0.95, 4 * FIRST).stopped == DONE


def vector(X: np.ndarray) -> np.ndarray:
    g = 1 + X[:, 1:].sum(axis=1)
    return np.stack([X[:, 0], g * (1 - np.sqrt(X[:, 0] / g))], axis=1)


MESH = DFET(3, 3)
SMALL = MACS(agents=4, archive=6, mesh="fixed")


@cache
def walking() -> CompiledProblem:
    """With which its NLPs are kept."""
    return walk().compile()


@cache
def whole(seed: int) -> Front:
    """Of a search that nothing stopped."""
    return SMALL.solve(walking(), MESH, seed=seed, verify=None)


@pytest.mark.slow
def test_a_front_is_found_without_a_number():
    """The front of `goddard` is known; five times the budget finds no more of it."""
    front = MACS(mesh="fixed").solve(compiled("goddard"), DFET(4, 6), seed=1, verify=None)
    assert front.stats["stopped"] == "done" and front.stats["evaluations"] <= 1500 and front.stats["rounds"] >= 2
    assert gd(front, goddard.reference()) < 1e-3 and len(front) == 10
    long = MACS(mesh="fixed").solve(compiled("goddard"), DFET(4, 6), evaluations=5 * front.stats["evaluations"], seed=1, verify=None)
    assert hypervolume(front, goddard.reference()) > 0.999 * hypervolume(long, goddard.reference())


@pytest.mark.slow
def test_a_function_without_gradients_is_searched_until_it_is_done():
    front = MACS().minimize(vector, [(0.0, 1.0)] * 5, seed=1)
    assert front.stats["stopped"] == "done" and 4000 <= front.stats["evaluations"] < 40_000
    assert np.abs(front.F[:, 1] - (1 - np.sqrt(front.F[:, 0]))).max() < 1e-2


@pytest.mark.slow
def test_a_ceiling():
    front = replace(SMALL, ceiling=100).solve(walking(), MESH, seed=1, verify=None)
    assert front.stats["stopped"] == "ceiling" and front.stats["evaluations"] == 100 and len(front) == 6


def test_a_callback_ends_it():
    seen = []

    def stop(progress):
        assert progress.budget is None
        seen.append(progress.evaluations)
        return len(seen) == 3

    front = SMALL.solve(walking(), MESH, seed=1, verify=None, callback=stop)
    assert front.stats["stopped"] == "callback" and len(front) and front.stats["evaluations"] == seen[-1]
    front = SMALL.solve(walk(least=0.5), MESH, seed=1)
    assert front.stats["stopped"] == "settled" and "violates path 'place' of 'walk'" in front.message


@pytest.mark.slow
@pytest.mark.parametrize("solve", [3, 9])
def test_it_goes_on_to_the_same_bits_from_the_middle_of_a_polish(tmp_path, monkeypatch, solve):
    expected = whole(1)  # before anything is counted
    original, count = bilevel.scalarize, iter(range(10**6))

    def interrupting(*arguments, **more):
        found = original(*arguments, **more)
        if next(count) == solve:
            os.kill(os.getpid(), signal.SIGINT)
        return found

    with monkeypatch.context() as patch:
        patch.setattr(bilevel, "scalarize", interrupting)
        part = SMALL.solve(walking(), MESH, seed=1, verify=None, checkpoint=tmp_path / "run.ckpt")
    assert part.stats["stopped"] == "interrupted"
    rest = SMALL.solve(walk(), MESH, seed=1, verify=None, checkpoint=tmp_path / "run.ckpt")
    assert np.array_equal(rest.F, expected.F) and np.array_equal(rest.decision, expected.decision)
    assert rest.stats["rounds"] == expected.stats["rounds"] and rest.stats["stopped"] == expected.stats["stopped"] == "done"


@pytest.mark.slow
@pytest.mark.parametrize("iterations", [1, 20])
def test_it_goes_on_to_the_same_bits_from_between_iterations(tmp_path, iterations):
    expected, left = whole(2), iter(range(iterations))
    part = SMALL.solve(walking(), MESH, seed=2, verify=None, checkpoint=tmp_path / "run.ckpt", callback=lambda p: next(left, None) is None)
    assert part.stats["stopped"] == "callback"
    rest = SMALL.solve(walk(), MESH, seed=2, verify=None, checkpoint=tmp_path / "run.ckpt")
    assert np.array_equal(rest.F, expected.F) and rest.stats["evaluations"] == expected.stats["evaluations"]


@pytest.mark.slow
def test_a_fruitless_round_is_not_polished(monkeypatch):
    """The second round of `walk` finds nothing beyond its front: the archive stays as the first polish left it."""
    polishes, original = [], module.Rounds.has_improvement
    monkeypatch.setattr(module.Rounds, "has_improvement", lambda self, found: polishes.append(original(self, found)) or polishes[-1])
    front = SMALL.solve(walking(), MESH, seed=1, verify=None)
    assert polishes and polishes[-1] is False and front.stats["rounds"] == len(polishes) + 1


def test_others_need_a_number():
    with pytest.raises(ValueError, match=r"'walk' has no number of its own, and NSGA2 needs one: .*only MACS searches until it is done"):
        NSGA2().solve(walk(), MESH)
    problem = walk()
    problem.default_evaluations = 60
    assert NSGA2(population=10).solve(problem, MESH, verify=None).stats["evaluations"] == 60


@pytest.mark.slow
@pytest.mark.parametrize("solve", [2, 12])
def test_what_an_interrupt_cuts_short_among_the_first_solves_is_done_again(tmp_path, monkeypatch, solve):
    """Solve 2 and 9 are of the opening, which begins anew then, since there is no state yet; 25 of a later round."""
    expected = whole(1)  # before anything is counted
    original, count = scalarised.scalarize, iter(range(10**6))

    def interrupting(*arguments, **more):
        if next(count) == solve:
            os.kill(os.getpid(), signal.SIGINT)
        return original(*arguments, **more)

    with monkeypatch.context() as patch:
        patch.setattr(scalarised, "scalarize", interrupting)
        part = SMALL.solve(walking(), MESH, seed=1, verify=None, checkpoint=tmp_path / "run.ckpt")
    assert part.stats["stopped"] == "interrupted" and not part.stats["reproducible"]
    rest = SMALL.solve(walk(), MESH, seed=1, verify=None, checkpoint=tmp_path / "run.ckpt")
    assert np.array_equal(rest.F, expected.F) and rest.stats["gradient_solves"] == expected.stats["gradient_solves"]
