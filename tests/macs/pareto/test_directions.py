from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs.pareto.directions import (
    across,
    best_points,
    check_directions,
    divisions_below,
    draw,
    lattice_size,
    pair_up,
    pool,
    population_size,
    reference_directions,
    simplex_lattice,
    tchebycheff,
)
from macs.pareto.dominance import normalised


@given(st.integers(1, 6), st.integers(1, 300))
def test_directions_are_unit_nonnegative_different_and_begin_with_the_orthogonal_ones(m, size):
    directions = pool(m, size)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1.0) and (directions >= 0.0).all()
    assert np.array_equal(directions[:m], np.eye(m))
    assert len(np.unique(np.round(directions, 12), axis=0)) == len(directions)
    assert len(directions) <= max(size, m) + 1


@given(st.integers(2, 5), st.integers(1, 6))
def test_lattice_is_whole_and_sums_to_one(m, divisions):
    lattice = simplex_lattice(m, divisions)
    assert lattice.shape == (comb(divisions + m - 1, m - 1), m)
    assert np.allclose(lattice.sum(axis=1), 1.0)
    whole = np.round(lattice * divisions)
    assert np.allclose(lattice * divisions, whole) and (whole >= 0).all()
    assert np.array_equal(np.unique(whole, axis=0), whole)  # all different, in lexicographic order


@given(st.integers(1, 4), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_orthogonal_directions_are_drawn_first_and_none_twice_before_all_are_taken(m, count, seed):
    directions = pool(m, 12)
    rows = draw(directions, count, np.random.default_rng(seed))
    assert rows.shape == (count,) and len(set(rows.tolist())) == min(count, len(directions))
    assert rows[:m].tolist() == list(range(m))[:count] or count < m


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
    F = np.array([[1.0, 3.0], [2.0, 3.0]])
    values = tchebycheff(F, np.full(2, 2**-0.5), np.array([1.0, 3.0]), np.array([2.0, 3.0]))
    assert values.tolist() == pytest.approx([0.0, 2**-0.5])
    assert np.array_equal(normalised(F, np.array([1.0, 3.0]), np.array([2.0, 3.0])), [[0.0, 0.0], [1.0, 0.0]])
    ideal, nadir = np.zeros(2), np.ones(2)
    assert tchebycheff(np.array([-0.1, 5.0]), np.array([1.0, 0.0]), ideal, nadir) < tchebycheff(ideal, np.array([1.0, 0.0]), ideal, nadir)


@pytest.mark.parametrize("rows", [0.1, 0.5, 0.9])
def test_every_point_of_a_front_that_bends_away_from_the_ideal_is_best_for_a_direction(rows):
    """Of a quarter of a circle about the nadir; a weighted sum is least at one of its ends, whatever the weights."""
    angle = np.linspace(0.0, np.pi / 2, 101)
    F = np.column_stack([np.sin(angle), np.cos(angle)])
    row = int(100 * rows)
    weights = 1.0 / F[row]
    assert best_points(F, weights[None] / np.linalg.norm(weights), np.zeros(2), np.ones(2)).tolist() == [row]
    assert (F @ weights).argmin() in (0, 100)


@pytest.mark.parametrize(("m", "size", "count"), [(3, 1, 4), (3, 10, 10), (3, 15, 16), (3, 20, 16), (4, 35, 35)])
def test_directions_on_a_surface_are_those_of_a_lattice_and_its_centre(m, size, count):
    """Lattices of three objectives have 3, 6, 10, 15, 21 points, of four 4, 10, 20, 35; the centre is one of them if
    m divides the divisions."""
    directions = pool(m, size)
    assert len(directions) == count and np.isclose(directions, m**-0.5).all(axis=1).sum() == 1


@pytest.mark.parametrize("size", [1, 2, 3, 50])
def test_of_two_objectives_there_are_as_many_directions_as_wanted_and_of_one_there_is_one(size):
    assert len(pool(2, size)) == max(size, 2) and pool(1, size).tolist() == [[1.0]]


def test_a_direction_with_a_larger_share_is_drawn_more_often():
    """Of ten others than the two orthogonal ones, one has half of all shares."""
    directions, rng = pool(2, 12), np.random.default_rng(0)
    shares = np.where(np.arange(12) == 7, 9.0, 1.0)
    drawn = np.array([draw(directions, 3, rng, shares) for _ in range(2000)])
    assert (drawn[:, :2] == [0, 1]).all()
    counts = np.bincount(drawn[:, 2], minlength=12) / 2000
    assert counts[7] == pytest.approx(0.5, abs=0.05) and counts[[*range(2, 7), *range(8, 12)]] == pytest.approx(1 / 18, abs=0.02)
    assert sorted(draw(directions, 12, rng, shares)) == list(range(12))


def test_sizes_of_lattices_as_tabulated_and_of_populations_equal_angles_and_cheapest_pairs():
    """Das and Dennis (1998): 91 points of three objectives with 12 divisions, 210 of five with 6."""
    assert [lattice_size(3, divisions) for divisions in (1, 2, 3, 12)] == [3, 6, 10, 91] and lattice_size(5, 6) == 210
    assert [divisions_below(3, count) for count in (1, 3, 5, 6, 9, 91, 104, 105)] == [1, 1, 1, 2, 2, 12, 12, 13]
    assert divisions_below(2, 100) == 99 and divisions_below(5, 210) == 6
    assert population_size(None, 7, None) == population_size(3, 7, 4) == 7
    assert population_size(None, None, None) is population_size(None, None, 4) is None
    found = across(np.array([[1.0, 2.0, 6.0], [5.0, 5.0, 5.0]]))
    assert found.tolist() == [[-2.0, -1.0, 3.0], [0.0, 0.0, 0.0]]
    directions = pool(2, 9)
    angles = np.sort(np.arctan2(directions[:, 0], directions[:, 1]))
    assert np.allclose(np.diff(angles), np.pi / 2 / 8)
    costs = np.array([[3.0, 2.0, 9.0], [1.0, 4.0, 9.0]])
    rows, columns = pair_up(costs)
    assert rows.tolist() == [1, 0] and columns.tolist() == [0, 1]
    assert costs.tolist() == [[3.0, 2.0, 9.0], [1.0, 4.0, 9.0]]
    assert [len(side) for side in pair_up(np.empty((0, 3)))] == [0, 0]


SIZES = [(2, None, None, 100), (3, None, None, 91), (3, None, 4, 15), (3, 15, None, 15)]


@pytest.mark.parametrize(("m", "population", "divisions", "count"), SIZES)
def test_reference_directions_are_a_lattice_where_one_has_their_number(m, population, divisions, count):
    found = reference_directions(m, population, divisions)
    assert len(found) == count == population_size(m, population, divisions)
    assert np.array_equal(found, simplex_lattice(m, divisions_below(m, count)))
    found[:] = 7.0
    assert reference_directions(m, population, divisions).max() == 1.0


@pytest.mark.parametrize(("m", "population"), [(3, 3 + 5), (3, 20), (4, 30)])
def test_other_numbers_of_reference_directions_are_chosen_from_a_finer_lattice(m, population):
    """Of one with up to four times as many, corners included, in its order."""
    found = reference_directions(m, population, None)
    fine = simplex_lattice(m, divisions_below(m, 4 * population))
    rows = [int(np.flatnonzero((fine == row).all(axis=1))[0]) for row in found]
    assert len(rows) == population and rows == sorted(set(rows))
    assert all((corner == found).all(axis=1).any() for corner in np.eye(m))


def test_too_few_individuals_for_their_directions_are_refused():
    for good in ((2, 2, None), (3, None, None), (3, 15, 4), (3, 30, 4)):
        check_directions("NSGA3", *good)
    refused = {
        (1, None, None): "NSGA3 needs at least two objectives, not 1; NSGA2 and MACS also search for the best of one",
        (3, 2, None): "NSGA3: population=2 is too few: 3 objectives need at least as many reference directions",
        (3, 14, 4): "NSGA3: divisions=4 makes 15 reference directions with 3 objectives, more than population=14; leave one of the two out",
        (3, 31, 4): "NSGA3: divisions=4 makes 15 reference directions with 3 objectives, too few for population=31; divisions=6 makes 28",
    }
    for wrong, message in refused.items():
        with pytest.raises(ValueError) as caught:
            check_directions("NSGA3", *wrong)
        assert str(caught.value) == message


@pytest.mark.parametrize(("m", "population"), [(9, 10), (10, 13), (11, 70), (13, 100), (15, 150), (40, 41)])
def test_with_many_objectives_the_finer_lattice_has_enough_directions(m, population):
    """At least one of its next sizes is more than four times the one before."""
    directions = reference_directions(m, population, None)
    assert directions.shape == (population, m) and np.allclose(directions.sum(axis=1), 1.0)
    assert len(np.unique(directions, axis=0)) == population and (directions.max(axis=1) == 1.0).sum() == m
