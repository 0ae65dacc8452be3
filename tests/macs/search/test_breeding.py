"""Offspring of the archive's points, and of the least violated ones as long as nothing is feasible."""

import numpy as np
import pytest
from boxes import boxed
from hypothesis import given
from hypothesis import strategies as st
from pymoo.problems import get_problem

from macs.evaluation.evaluator import UnitBox
from macs.search import breeding
from macs.search.macs import MACS
from macs.search.settings import Variant

SEEDS = st.integers(0, 2**32 - 1)


def box(d, wraps=()):
    return UnitBox(np.zeros(d), np.ones(d), np.isin(np.arange(d), wraps))


@given(SEEDS, st.integers(4, 60))
def test_mates_are_different_others(seed, size):
    rng = np.random.default_rng(seed)
    pool = rng.random((size, 3))
    found = breeding.mates(box(3), pool, pool, rng, 0.3)
    assert found.shape == (3, size, 3)
    every = np.concatenate([pool[None], found])
    for i in range(size):
        assert len(np.unique(every[:, i], axis=0)) == 4


def test_mates_are_mostly_near():
    pool = np.linspace(0.0, 1.0, 401)[:, None]
    found = breeding.mates(box(1), np.tile(pool[:1], (1000, 1)), pool, np.random.default_rng(0), 0.3)
    near = (found < (breeding.NEAREST_MATES + 0.5) / 400).all(axis=(0, 2)).mean()
    assert 0.65 < near < 0.75
    pool = np.linspace(0.0, 1.0, 101)[:, None]
    X = np.zeros((400, 1))
    everywhere = breeding.mates(box(1), X, pool, np.random.default_rng(0), wide=1.0)
    assert np.histogram(everywhere, bins=4, range=(0, 1))[0].min() > 200
    assert (breeding.mates(box(1), X, pool, np.random.default_rng(0), wide=0.0) <= 0.21).all()


@pytest.mark.parametrize("size", [1, 2, 3])
def test_a_point_stands_in_for_the_mates_that_are_missing(size):
    pool = np.linspace(0.2, 0.8, size)[:, None] * np.ones(4)
    found = breeding.mates(box(4), pool[:1], pool, np.random.default_rng(0), 0.3)
    missing = (found == pool[0]).all(axis=(1, 2)).sum()
    assert missing == 4 - size
    if size == 1:
        assert np.array_equal(breeding.difference(box(4), pool, found, np.random.default_rng(0)), pool)
        assert np.array_equal(breeding.crossover(box(4), pool, found, np.random.default_rng(0), 15.0, 0.25), pool)


def test_crossover_leaves_what_parents_share_and_centres_between_them():
    rng = np.random.default_rng(0)
    X, mate = np.tile([0.3, 0.5], (4000, 1)), np.tile([0.3, 0.7], (4000, 1))
    child = breeding.crossover(box(2), X, np.stack([mate] * 3), rng, 15.0, 0.25)
    assert (child[:, 0] == 0.3).all()
    changed = child[:, 1] != 0.5
    assert 0.45 < changed.mean() < 0.55
    near_mate = np.abs(child[changed, 1] - 0.7) < np.abs(child[changed, 1] - 0.5)
    assert 0.2 < near_mate.mean() < 0.3
    assert np.abs(child[changed, 1] - 0.6).mean() == pytest.approx(0.1, abs=0.01)


def test_differences_take_the_short_way_round():
    X = np.full((1, 2), 0.5)
    others = np.array([[[0.5, 0.5]], [[0.05, 0.55]], [[0.95, 0.45]]])
    steps = [breeding.difference(box(2, [0]), X, others, np.random.default_rng(seed)) - X for seed in range(20)]
    assert np.abs(steps).max() == pytest.approx(0.05)


@pytest.mark.parametrize("index", [0.0, 10.0, 20.0])
def test_mutation_is_as_long_as_its_index_says(index):
    """The mean of its polynomial distribution is 1 / (index + 2)."""
    step = breeding.mutate(np.zeros((20_000, 10)), np.random.default_rng(1), index)
    assert np.abs(step[step != 0]).mean() == pytest.approx(1.0 / (index + 2.0), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 9])
def test_a_constraint_with_many_local_optima_is_satisfied(seed):
    """C1-DTLZ1 (Jain and Deb 2014): feasible is only what is near the front. With shorter steps these two of ten searches found two
    feasible points, or none."""
    assert len(MACS(archive=100).minimize(get_problem("c1dtlz1"), evaluations=30_000, seed=seed)) == 100


@given(SEEDS, st.integers(1, 40), st.integers(1, 6), st.booleans())
def test_offspring_are_in_the_box_and_the_same_seed_gives_the_same(seed, size, d, wrap):
    pool = np.random.default_rng(seed).random((size, d))
    pool[::3] = np.round(pool[::3])  # some on the bounds
    cube = box(d, [0] if wrap else [])
    how = (breeding.ALONG_CURVE, breeding.INFEASIBLE_POINTS)[seed % 2]
    first, again = (breeding.breed(cube, cube.put_back(pool), pool, how, 0.4, np.random.default_rng(seed)) for _ in range(2))
    assert ((first[0] >= 0.0) & (first[0] <= 1.0)).all() and np.array_equal(first[0], again[0]) and np.array_equal(first[1], again[1])


def test_how_many_are_sampled_and_bred():
    many = MACS(archive=100)
    assert MACS().points_to_sample(10_000) == MACS().offspring(10, 2) == 10 and MACS().offspring(0, 2) == 0
    assert [many.points_to_sample(budget) for budget in (30_000, 500, 20)] == [100, 25, 10]
    assert [many.offspring(100, m) for m in (2, 3, 4)] == [15, 100, 100] and many.offspring(3, 2) == 10
    assert many.offspring(100, 2, undirected=45) == many.offspring(100, 3, undirected=45) == 55
    assert many.offspring(100, 2, feasible=False) == 200
    paper = MACS.paper(agents=7, archive=100)
    assert paper.points_to_sample(30_000) == 7 and paper.offspring(10, 2) == paper.offspring(10, 2, feasible=False) == 0


def searched(solver: MACS, constraints, d: int, evaluations: int, seed: int):
    """The state of a search of the segment between (0, 1) and (1, 0), moved by the sum of all variables but the first."""
    box = boxed(lambda X: np.column_stack([X[:, 0], 1.0 - X[:, 0]]) + X[:, 1:].sum(axis=1)[:, None], [(0, 1)] * d, constraints=constraints)
    state = solver.begin(box, evaluations, np.random.default_rng(seed))
    while state.evaluations < evaluations:
        solver.advance(state, box, evaluations)
        assert len(state.parents) and (len(state.closest) > 0) != (len(state.archive) > 0)
    return state


def rippled(X: np.ndarray) -> np.ndarray:
    """Violation (k, 1) with many local minima: Rastrigin's function of all variables but the first."""
    Y = X[:, 1:] - 0.3
    return 10.0 * (Y**2 + 0.1 * (1.0 - np.cos(20.0 * np.pi * Y))).sum(axis=1, keepdims=True) - 0.2


@pytest.mark.slow
def test_as_long_as_nothing_is_feasible_the_least_violated_points_are_bred():
    """And so violations get smaller than by agents alone, which try all coordinates."""
    variants = Variant(), Variant(breeding=False)
    bred, alone = (searched(MACS(archive=50, variant=one), rippled, 20, 8000, 1) for one in variants)
    assert len(bred.parents) == 50 and (np.diff(bred.parents.violation) >= 0.0).all()
    assert bred.closest.violation[0] < 0.5 * alone.closest.violation[0]


def apart(X: np.ndarray) -> np.ndarray:
    """Violation (k, 1) where the sum of all variables but the first is between one half and two: the front is in a part of its own."""
    total = X[:, 1:].sum(axis=1, keepdims=True)
    return np.minimum(total - 0.5, 2.0 - total)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_feasible_parts_behind_infeasible_points_are_reached(seed):
    """Through the points outside: they are infeasible, and no point of the archive dominates them."""
    state = searched(MACS(archive=20), apart, 12, 3000, seed)
    assert state.archive.F.sum(axis=1).max() < 2.0
    assert not len(state.infeasible) or not (state.archive.F[:, None] <= state.infeasible.F).all(axis=2).any()
