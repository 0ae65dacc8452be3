from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs.evaluation.evaluator import UnitBox
from macs.pareto.directions import pair_up
from macs.search.individual import acting_agents, along_archive, coordinate_step, differential, distinct_others, inertia, share_evaluations
from macs.search.social import current_to_rand, like_improvements, nearest_rows
from macs.search.state import Credit

SEEDS = st.integers(0, 2**32 - 1)


def box(d, wraps=()):
    return UnitBox(np.full(d, -2.0), np.full(d, 6.0), np.isin(np.arange(d), wraps))


@pytest.mark.parametrize("wraps", [(), (0, 2), (0, 1, 2, 3)])
def test_distances_are_those_of_the_differences(wraps):
    rng, cube = np.random.default_rng(len(wraps)), box(4, wraps)
    X, others = rng.random((9, 4)), rng.random((30, 4))
    squares = (cube.difference(X[:, None], others) ** 2).sum(axis=2)
    assert cube.squared_distances(X, others) == pytest.approx(squares, rel=1e-13)
    assert not np.diag(cube.squared_distances(X, X)).any()


@given(SEEDS, st.booleans())
def test_every_proposal_is_in_the_box(seed, wrap):
    rng = np.random.default_rng(seed)
    cube, k, d = box(4, [0, 2] if wrap else []), 6, 4
    X = rng.choice([0.0, 0.25, 1.0], (k, d)) if seed % 2 else rng.random((k, d))
    X = cube.put_back(X)
    velocity, rho = rng.normal(size=(k, d)), rng.random(k)
    donors = rng.random((3, k, d))
    proposals = [
        inertia(cube, X, velocity, rho, True, rng),
        inertia(cube, X, velocity, rho, False, rng),
        coordinate_step(cube, X, rng.integers(d, size=k), rng.uniform(-0.5, 0.5, k)),
        differential(cube, X, donors, 0.9, 0.9, rng),
        along_archive(cube, X, rng.random((10, d)), rng),
        current_to_rand(cube, X, rng.random((10, d)), 5, 0.9, rng),
        like_improvements(cube, X, rng.normal(size=(10, d)), rng),
    ]
    for trial in proposals:
        assert trial.shape == X.shape and ((trial >= 0.0) & (trial <= 1.0)).all()
        values = cube.to_values(trial)
        assert ((values >= -2.0) & (values <= 6.0)).all()


def test_improvements_are_repeated_with_their_mean_and_their_second_moments():
    rng, X = np.random.default_rng(0), np.full((100_000, 3), 0.5)
    past = 0.01 * rng.normal(size=(12, 3)) @ np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]) + [0.01, 0.0, 0.0]
    steps = like_improvements(box(3), X, past, rng) - X
    assert np.allclose(steps.mean(axis=0), past.mean(axis=0), atol=5e-4)
    assert np.allclose(np.cov(steps.T), past.T @ past / 12, atol=5e-5)
    assert (steps[:, 2] == 0.0).all()  # only along past improvements


def test_periodic_coordinates_wrap_and_others_stop_at_the_bound():
    cube = box(2, [0])
    X = np.array([[0.9, 0.9]])
    assert np.allclose(coordinate_step(cube, X, np.array([0]), np.array([0.3])), [[0.2, 0.9]])
    assert np.allclose(coordinate_step(cube, X, np.array([1]), np.array([0.3])), [[0.9, 1.0]])
    assert np.allclose(cube.difference(np.array([0.1, 0.1]), np.array([0.9, 0.9])), [0.2, -0.8])
    assert np.allclose(cube.confine(np.array([7.0, 7.0])), [-1.0, 6.0])
    assert cube.confine(np.array([0.1, 0.3])).tolist() == [0.1, 0.3]
    assert np.allclose(cube.to_unit(np.array([7.0, 7.0])), [0.125, 1.0])
    assert cube.reach(X, np.array([[0.4, 0.0]])) == 1.0
    assert np.allclose(cube.reach(X, np.array([[0.4, 0.4]])), 0.25)
    assert cube.stop_outward(np.array([1.0, 1.0]), np.array([1.0, 1.0])).tolist() == [1.0, 0.0]


def test_inertia_and_differential_evolution_along_velocities_and_differences():
    rng = np.random.default_rng(0)
    cube, X = box(3), np.full((2, 3), 0.5)
    velocity = np.array([[0.0, 0.0, 0.0], [0.1, -0.2, 0.0]])
    trial = inertia(cube, X, velocity, np.ones(2), True, rng)
    assert np.array_equal(trial[0], X[0])
    step = trial[1] - X[1]
    assert np.allclose(step / step[0], velocity[1] / velocity[1, 0]) and 0 < step[0] <= 0.1
    rng = np.random.default_rng(0)
    X, donors = np.full((3, 5), 0.5), rng.random((3, 3, 5))
    assert (differential(box(5), X, donors, 0.9, 0.0, rng) != X).sum(axis=1).tolist() == [1, 1, 1]
    assert np.array_equal(differential(box(5), X, np.full((3, 3, 5), 0.5), 0.9, 0.9, rng), X)
    # Where the third agent is the point itself only the difference is left; with F = 0 the way leads straight to the third.
    cube, X = box(3), np.full((4, 3), 0.5)
    donors = np.stack([X + np.array([0.2, -0.1, 0.05]), X, X])
    steps = {F: differential(cube, X, donors, F, 1.0, np.random.default_rng(3)) - X for F in (0.25, 0.5, 1.0)}
    assert np.allclose(steps[1.0], 2.0 * steps[0.5]) and np.allclose(steps[1.0], 4.0 * steps[0.25])
    assert np.allclose(steps[1.0] / steps[1.0][:, :1], [1.0, -0.5, 0.25]) and (steps[1.0][:, 0] > 0.0).all()
    straight = differential(cube, X, np.stack([X + 0.3, X, X + np.array([0.1, 0.2, 0.0])]), 0.0, 1.0, np.random.default_rng(3)) - X
    assert np.allclose(straight[:, 1], 2.0 * straight[:, 0]) and np.allclose(straight[:, 2], 0.0)
    cube = box(1, [0])
    pool = np.array([[0.05], [0.5], [0.9], [0.0]])
    assert nearest_rows(cube, np.array([[0.0]]), pool, 2).tolist() == [[0, 2]]
    assert nearest_rows(cube, np.array([[0.0]]), np.zeros((2, 1)), 2).tolist() == [[-1, -1]]


@given(SEEDS, st.integers(4, 12))
def test_parents_are_others_and_all_different(seed, population):
    rng = np.random.default_rng(seed)
    agents = np.arange(population)
    parents = distinct_others(agents, population, 3, rng)
    assert parents.shape == (3, population)
    for agent in agents:
        assert len({agent, *parents[:, agent].tolist()}) == 4


@given(SEEDS, st.integers(1, 6), st.integers(1, 6))
def test_pairs_are_one_to_one_and_begin_with_the_cheapest(seed, rows, columns):
    costs = np.random.default_rng(seed).random((rows, columns))
    first, second = pair_up(costs)
    assert len(first) == len(second) == min(rows, columns) == len(set(first)) == len(set(second))
    assert costs[first[0], second[0]] == costs.min()


def test_as_many_agents_without_a_direction_act_as_there_are_others():
    rng = np.random.default_rng(0)
    assert acting_agents(10, 10, 0.0, rng).tolist() == list(range(10)) and acting_agents(20, 10, 0.0, rng).tolist() == list(range(20))
    assert rng.bit_generator.state == np.random.default_rng(0).bit_generator.state, "nothing is drawn where all act"
    drawn = [acting_agents(55, 10, 0.0, rng) for _ in range(200)]
    assert all(rows.tolist() == sorted(set(rows)) and len(rows) == 20 and rows[:10].tolist() == list(range(10)) for rows in drawn)
    assert set(np.concatenate(drawn)) == set(range(55)), "each has its turn"


@pytest.mark.slow
@pytest.mark.parametrize("gain", [1e-6, 1.0])
def test_agents_without_a_direction_have_their_share_of_the_evaluations(gain):
    """Others gain 1e-3 in each of four evaluations, agents without a direction this much in each of sixty."""
    rng, spent = np.random.default_rng(0), np.zeros(2)
    state = SimpleNamespace(undirected=Credit(np.zeros(2), np.zeros(2)), excess=0.0)
    each, gains = np.where(np.arange(55) < 10, 4, 60), np.where(np.arange(55) < 10, 1e-3, gain)
    for _ in range(4000):
        acting = np.isin(np.arange(55), acting_agents(55, 10, state.excess, rng))
        tried = np.where(acting, each, 0)
        share_evaluations(state, gains * tried, tried, 10)
        spent += [tried[:10].sum(), tried[10:].sum()]
    assert spent[1] / spent.sum() == pytest.approx(0.05 + 0.9 * gain / (gain + 1e-3), abs=0.02)


@given(SEEDS)
def test_agents_without_a_direction_go_along_differences_of_the_archive(seed):
    rng, cube = np.random.default_rng(seed), box(3)
    archive, X = rng.uniform(0.4, 0.6, (3, 3)), rng.uniform(0.4, 0.6, (50, 3))
    steps = along_archive(cube, X, archive, rng) - X
    differences = np.array([archive[i] - archive[j] for i in range(3) for j in range(3) if i != j])
    part = (steps @ differences.T) / (differences**2).sum(axis=1)
    off = np.linalg.norm(steps[:, None] - part[:, :, None] * differences, axis=2)
    best = np.take_along_axis(part, np.where(part > 0, off, np.inf).argmin(axis=1)[:, None], axis=1)
    assert np.where(part > 0, off, np.inf).min(axis=1).max() < 1e-12
    assert best.min() >= 0.01 * (1 - 1e-9) and best.max() <= 1.0 + 1e-9
    assert 0.01 < np.median(best) < 0.5
