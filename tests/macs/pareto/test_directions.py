from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs.pareto.directions import best_points, draw, pool, simplex_lattice, tchebycheff
from macs.pareto.ranges import normalised


@given(st.integers(1, 6), st.integers(1, 300))
def test_directions_are_unit_nonnegative_different_and_begin_with_the_orthogonal_ones(m, size):
    directions = pool(m, size)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert (directions >= 0.0).all()
    assert np.array_equal(directions[:m], np.eye(m))
    assert len(np.unique(np.round(directions, 12), axis=0)) == len(directions)
    assert len(directions) <= max(size, m) + 1


def test_two_objectives_have_equal_angles():
    directions = pool(2, 9)
    angles = np.sort(np.arctan2(directions[:, 0], directions[:, 1]))
    assert np.allclose(np.diff(angles), np.pi / 2 / 8)


@given(st.integers(2, 5), st.integers(1, 6))
def test_lattice_is_whole_and_sums_to_one(m, divisions):
    lattice = simplex_lattice(m, divisions)
    assert lattice.shape == (comb(divisions + m - 1, m - 1), m)
    assert np.allclose(lattice.sum(axis=1), 1.0)


@given(st.integers(1, 4), st.integers(0, 30), st.integers(0, 2**32 - 1))
def test_the_orthogonal_directions_are_always_drawn(m, extra, seed):
    directions = pool(m, 100)
    rows = draw(directions, m + extra, np.random.default_rng(seed))
    assert rows.shape == (m + extra,)
    assert rows[:m].tolist() == list(range(m))
    if m > 1:
        assert len(set(rows.tolist())) == m + extra


@given(st.integers(1, 4), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_no_direction_is_drawn_twice_before_all_are_taken(m, count, seed):
    directions = pool(m, 12)
    rows = draw(directions, count, np.random.default_rng(seed))
    assert rows.shape == (count,)
    assert len(set(rows.tolist())) == min(count, len(directions))


def test_scalarisation_is_safe_where_an_objective_has_no_range():
    F = np.array([[1.0, 3.0], [2.0, 3.0]])
    values = tchebycheff(F, np.full(2, 2**-0.5), np.array([1.0, 3.0]), np.array([2.0, 3.0]))
    assert values.tolist() == pytest.approx([0.0, 2**-0.5])
    assert np.array_equal(normalised(F, np.array([1.0, 3.0]), np.array([2.0, 3.0])), [[0.0, 0.0], [1.0, 0.0]])


def test_a_new_best_objective_is_better_for_the_direction_that_owns_it():
    ideal, nadir = np.zeros(2), np.ones(2)
    assert tchebycheff(np.array([-0.1, 5.0]), np.array([1.0, 0.0]), ideal, nadir) < tchebycheff(ideal, np.array([1.0, 0.0]), ideal, nadir)


@given(st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_scalarisation_never_prefers_a_dominated_point(m, seed):
    rng = np.random.default_rng(seed)
    better = rng.random(m)
    worse = better + rng.random(m)
    for direction in pool(m, 20):
        assert tchebycheff(better, direction, np.zeros(m), np.ones(m)) <= tchebycheff(worse, direction, np.zeros(m), np.ones(m))


def test_scalarisation_is_the_largest_weighted_objective_and_no_sum():
    """From the ideal (1, 10) to the nadir (5, 50) the point (3, 20) is (1/2, 1/4)."""
    ideal, nadir, F = np.array([1.0, 10.0]), np.array([5.0, 50.0]), np.array([3.0, 20.0])
    assert tchebycheff(F, np.array([0.6, 0.8]), ideal, nadir) == pytest.approx(0.3)
    assert tchebycheff(F, np.array([0.2, 0.8]), ideal, nadir) == pytest.approx(0.2)
    assert tchebycheff(F, np.array([0.0, 1.0]), ideal, nadir) == pytest.approx(0.25)
    assert tchebycheff(-F, np.array([0.0, 1.0]), -F, nadir) == pytest.approx(0.0)


@pytest.mark.parametrize("rows", [0.1, 0.5, 0.9])
def test_every_point_of_a_front_that_bends_away_from_the_ideal_is_best_for_a_direction(rows):
    """Of a quarter of a circle about the nadir; a weighted sum is least at one of its ends, whatever the weights."""
    angle = np.linspace(0.0, np.pi / 2, 101)
    F = np.column_stack([np.sin(angle), np.cos(angle)])
    row = int(100 * rows)
    weights = 1.0 / F[row]
    assert best_points(F, weights[None] / np.linalg.norm(weights), np.zeros(2), np.ones(2)).tolist() == [row]
    assert (F @ weights).argmin() in (0, 100)
