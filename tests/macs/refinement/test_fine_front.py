"""A front on a finer mesh: a cart from rest to rest, whose least effort in time T is 12 / T^3, and places on a front whose ends move."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs import Front, sweep
from macs.evaluation.evaluator import CONVERGED
from macs.gradients.ends import ENDS, moved_along
from macs.refinement.front_refinement import solve_on
from macs.refinement.mesh_loop import Programs
from problems import Problem
from transcription import DFET
from transcription.stopping import stopped_by

FINE = DFET(4, 3)


def cart() -> Problem:
    """Time against effort."""
    problem = Problem("cart")
    move = problem.phase("move", t0=0.0, tf=(1.0, 2.0))
    move.state("x", bounds=(-1, 2), initial=0, final=1)
    v = move.state("v", bounds=(-5, 5), initial=0, final=0)
    u = move.control("u", bounds=(-20, 20))
    move.dynamics(x=v, v=u)
    problem.minimize("time", move.tf)
    problem.minimize("effort", move.integral(u**2))
    return problem


@pytest.fixture(scope="module")
def coarse() -> Front:
    """Five points with controls that are constant on three elements: each effort is too large."""
    front = sweep(cart(), DFET(3, 2, control_order=0), points=5, starts=1)
    assert len(front) == 5 and (front.F[:, 1] > 1.02 * 12.0 / front.F[:, 0] ** 3).all()
    return front


def solved(front: Front, rows: list[int]):
    return solve_on(front, rows, FINE, Programs(front.compiled()))


@pytest.mark.slow
def test_points_are_as_good_as_they_can_be_and_where_they_were(coarse):
    fine = solved(coarse, [0, 1, 2, 3, 4])
    assert (fine.status == CONVERGED).all() and fine.F[:, 1] == pytest.approx(12.0 / fine.F[:, 0] ** 3, rel=1e-7)
    assert fine.F[[0, -1], 0] == pytest.approx([1.0, 2.0], abs=1e-7), "the ends of the front"
    apart = np.abs((fine.F - coarse.F) / np.ptp(coarse.F, axis=0)).max(axis=1)
    assert apart.max() < 0.15, "less than the distance of neighbours"
    assert (np.diff(fine.F[:, 0]) > 0).all() and max(fine.optimality) < 1e-6


def test_only_the_rows_that_are_named_change_and_what_they_cost_is_counted(coarse):
    fine = solved(coarse, [1, 3])
    same = [one is other for one, other in zip(fine.trajectories, coarse.trajectories, strict=True)]
    assert same == [True, False, True, False, True]
    more = {name: fine.stats[name] - coarse.stats[name] for name in ("gradient_solves", "inner_iterations", "work")}
    # Both are ends of what is solved, for the least of one objective, again near where it was, and then of the other.
    assert more["gradient_solves"] == 6 and more["work"] == more["inner_iterations"] * len(FINE.nlp(cart()).variables)


def test_asked_to_end_points_stay_as_they_were(coarse):
    with stopped_by(lambda: True):
        assert solved(coarse, [0, 1, 2, 3, 4]).trajectories == coarse.trajectories


def test_programs_that_a_search_has_are_not_made_again():
    problem = cart().compile()
    programs = Programs(problem)
    assert programs(FINE) is programs(FINE) is not FINE.nlp(problem) and programs.built == len(FINE.nlp(problem).variables)
    searched = DFET(2, 3)
    assert Programs(problem)(searched) is not searched.nlp(problem), "without a search nothing is kept for good"
    assert programs(searched) is searched.nlp(problem) and programs.built == len(FINE.nlp(problem).variables)


# Places between the ends

numbers = st.floats(-100, 100)
spans = st.floats(1.0, 100)


@given(a=numbers, b=numbers, before=st.tuples(spans, spans), after=st.tuples(spans, spans), share=st.floats(0, 1))
def test_points_move_along_with_the_ends(a, b, before, after, share):
    """Points on the line between two ends are on the line between these in their new places, at the same share of it."""
    old = np.array([[a, b + before[1]], [a + before[0], b]])
    new = np.array([[b, a + after[1]], [b + after[0], a]])
    F = old[:1] + share * (old[1:] - old[:1])
    references, weights = moved_along(F, old, new, np.array(before))
    if np.abs((new - old) / before).max() > ENDS.moved:
        assert references == pytest.approx(new[:1] + share * (new[1:] - new[:1]), abs=1e-9) and weights == pytest.approx(after)
    else:
        assert references is F and weights == pytest.approx(before)


def test_without_both_ends_or_with_small_moves_points_are_where_they_were():
    F, units = np.array([[0.5, 0.5]]), np.ones(2)
    old = np.array([[0.0, 1.0], [1.0, 0.0]])
    for before, after in ((F[:0], F[:0]), (old, old + 0.9 * ENDS.moved), (old, np.ones((2, 2)))):
        references, weights = moved_along(F, before, after, units)
        assert references is F and weights is units
    assert moved_along(F, old, old + 1.1 * ENDS.moved, units)[0] == pytest.approx(F + 1.1 * ENDS.moved)
