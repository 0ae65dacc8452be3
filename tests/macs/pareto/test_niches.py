import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs.pareto.archive import Archive, insert
from macs.pareto.directions import simplex_lattice
from macs.pareto.dominance import dominates
from macs.pareto.niches import PENALTY, best_of_niches, intercepts, nearly_best

SCALES = np.array([1.0, 1e3, 1e-4, 5.0, 20.0])


def sphere(m, divisions):
    """Points of the positive part of the unit sphere, in the directions of a lattice."""
    lattice = simplex_lattice(m, divisions)
    return lattice / np.linalg.norm(lattice, axis=1, keepdims=True)


@pytest.mark.parametrize(("m", "divisions"), [(4, 3), (5, 4), (8, 3)])
@pytest.mark.parametrize("shape", ["sphere", "plane"])
def test_of_points_behind_each_other_the_nearer_to_the_ideal_point_are_chosen(m, divisions, shape):
    near = simplex_lattice(m, divisions)
    near = near if shape == "plane" else sphere(m, divisions)
    # Those behind are not dominated where one of the objectives is zero: there it is a little less.
    far = 1.5 * near
    rng = np.random.default_rng(m)
    order = rng.permutation(2 * len(near))
    F = np.vstack([near, far])[order]
    chosen = best_of_niches(F, len(near))
    assert sorted(map(tuple, F[chosen])) == sorted(map(tuple, near))


def test_units_and_origin_of_objectives_change_nothing():
    rng = np.random.default_rng(1)
    F = np.abs(rng.normal(size=(300, 5)))
    F = np.vstack([np.eye(5), F / np.linalg.norm(F, axis=1, keepdims=True) * rng.uniform(1, 2, (300, 1))])
    chosen = best_of_niches(F, 70)
    assert chosen.sum() == 70
    assert np.array_equal(chosen, best_of_niches(F * SCALES + 7 * SCALES, 70))


@given(st.integers(4, 8), st.integers(0, 2**32 - 1), st.booleans())
def test_as_many_as_asked_for_with_the_best_of_each_objective(m, seed, whole):
    rng = np.random.default_rng(seed)
    F = rng.integers(0, 4, (60, m)).astype(float) if whole else rng.normal(size=(60, m)) * 10.0 ** rng.integers(-6, 6, m)
    limit = int(rng.integers(m, 60))
    chosen = best_of_niches(F, limit)
    assert chosen.sum() == limit
    best = F[chosen].min(axis=0)
    assert (best <= F.min(axis=0) + 1e-6 * np.ptp(F, axis=0)).all()


def test_scales_are_those_of_the_corners_and_no_more_than_the_ranges():
    F = np.vstack([2.0 * np.eye(4), np.full((1, 4), 0.9), [[0.0, 0.01, 0.01, 50.0]]])
    assert np.allclose(intercepts(F), 2.0, rtol=0.02)
    assert np.allclose(intercepts(F * SCALES[:4] - 3.0), 2.0 * SCALES[:4], rtol=0.02)
    flat = np.array([[0.0, 1.0, 2.0, 3.0], [1.0, 0.0, 3.0, 3.0], [2.0, 2.0, 2.0, 3.0]])
    assert np.allclose(intercepts(flat), [2.0, 2.0, 1.0, 1.0])
    corners = np.array([[0.9, 0.3, 0.0, 0.0], [0.0, 0.9, 0.3, 0.0], [0.0, 0.0, 0.9, 0.3], [0.3, 0.0, 0.0, 0.9]])
    assert intercepts(corners).tolist() == [0.9] * 4
    F = np.hstack([simplex_lattice(4, 3), np.full((20, 1), 7.0)])
    assert intercepts(F).tolist() == [1.0] * 5
    total = F[:, :4] @ [1.0, 2.0, 3.0, 4.0]
    with np.errstate(all="raise"):
        assert nearly_best(F, total)[4] == total.argmin()
    F = np.array([[0.0, 5.0, 5.0, 5.0], [1e-9, 1.0, 1.0, 1.0], [0.1, 0.5, 0.5, 0.5], [1.0, 0.0, 0.0, 0.0]])
    assert nearly_best(F, F.sum(axis=1)).tolist() == [1, 3, 3, 3]


@pytest.mark.parametrize("last", [[0.5, 0.25, 0.25, 1.0], [0.7, 0.7, 0.6, 1.0]])
def test_scales_are_the_ranges_where_the_plane_runs_along_an_axis_or_meets_it_behind_the_ideal_point(last):
    F = np.vstack([np.eye(3, 4), last])
    with np.errstate(all="raise"):
        assert intercepts(F).tolist() == [1.0] * 4


@pytest.mark.parametrize(("share", "wins"), [(1.1, False), (0.9, True)])
def test_the_penalty_weighs_the_distance_from_a_direction(share, wins):
    lattice = simplex_lattice(4, 4)
    middle = int(np.flatnonzero((lattice == 0.25).all(axis=1))[0])
    # Nearer along its direction, and aside by so much of what that is worth.
    gain = 0.02 * np.linalg.norm(lattice[middle])
    other = 0.98 * lattice[middle] + share * gain / PENALTY * np.array([1.0, -1.0, 0.0, 0.0]) / np.sqrt(2.0)
    chosen = best_of_niches(np.vstack([lattice, other]), len(lattice))
    assert chosen[-1] == wins and chosen[middle] != wins


def test_an_archive_of_many_objectives_goes_forward_where_points_far_behind_are_not_dominated():
    rng = np.random.default_rng(3)
    archive = Archive(np.empty((0, 1)), np.empty((0, 6)), np.empty(0))
    for far in (3.0, 2.0, 1.5, 1.2, 1.0, 1.0, 1.0):
        F = np.abs(rng.normal(size=(60, 6)))
        F = far * F / np.linalg.norm(F, axis=1, keepdims=True)
        archive = insert(archive, np.zeros((60, 1)), F, np.zeros(60), limit=40, tolerance=1e-6)
        assert len(archive) == 40 and not dominates(archive.F[:, None], archive.F).any()
    assert np.median(np.linalg.norm(archive.F, axis=1)) == pytest.approx(1.0)


@pytest.mark.parametrize("m", [4, 5, 8])
def test_a_point_far_behind_for_a_little_of_one_objective_leaves_a_full_archive(m):
    near = 0.01 + sphere(m, 3)
    best = np.full(m, 0.7)
    best[0] = 0.009
    far = np.full(m, 0.0105)
    far[0], far[-1] = 0.0095, 40.0
    F = np.vstack([near, best, far])
    empty = Archive(np.empty((0, 1)), np.empty((0, m)), np.empty(0))
    Z, violation = np.arange(len(F), dtype=float)[:, None], np.zeros(len(F))
    kept = insert(empty, Z, F, violation, limit=len(near), tolerance=0.0)
    assert far.tolist() not in kept.F.tolist()
    assert kept.F.min(axis=0).tolist() == F.min(axis=0).tolist()
    everything = insert(empty, Z, F, violation, limit=len(F), tolerance=0.0)
    assert far.tolist() in everything.F.tolist()  # no point dominates it
