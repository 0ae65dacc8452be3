"""What the archive's points propose, and how operators earn their share."""

import numpy as np
import pytest
from boxes import boxed
from hypothesis import given
from hypothesis import strategies as st
from pymoo.core.problem import Problem
from pymoo.problems import get_problem

from macs.evaluation.evaluator import Box
from macs.search import breeding
from macs.search.individual import individual_actions
from macs.search.macs import MACS
from macs.search.social import social_actions
from macs.search.state import remember
from macs.search.trials import Trials

SEEDS = st.integers(0, 2**32 - 1)


def box(d, wraps=()):
    return Box(np.zeros(d), np.ones(d), np.isin(np.arange(d), wraps))


@given(SEEDS, st.integers(1, 40), st.integers(1, 6), st.booleans())
def test_offspring_are_in_the_box_and_the_same_seed_gives_the_same(seed, size, d, wrap):
    pool = np.random.default_rng(seed).random((size, d))
    pool[::3] = np.round(pool[::3])  # some on the bounds
    cube = box(d, [0] if wrap else [])
    shares = np.full(len(breeding.OPERATORS), 1 / len(breeding.OPERATORS))
    first, again = (breeding.breed(cube, cube.put_back(pool), pool, shares, np.random.default_rng(seed)) for _ in range(2))
    assert ((first[0] >= 0.0) & (first[0] <= 1.0)).all()
    assert np.array_equal(first[0], again[0])
    assert np.array_equal(first[1], again[1])
    assert set(first[1]) <= set(range(len(breeding.OPERATORS)))


@given(SEEDS, st.integers(4, 60))
def test_mates_are_different_others(seed, size):
    rng = np.random.default_rng(seed)
    pool = rng.random((size, 3))
    found = breeding.mates(box(3), pool, pool, rng)
    assert found.shape == (3, size, 3)
    every = np.concatenate([pool[None], found])
    for i in range(size):
        assert len(np.unique(every[:, i], axis=0)) == 4


def test_mates_are_mostly_near():
    pool = np.linspace(0.0, 1.0, 401)[:, None]
    found = breeding.mates(box(1), np.tile(pool[:1], (1000, 1)), pool, np.random.default_rng(0))
    near = (found < (breeding.NEAR + 0.5) / 400).all(axis=(0, 2)).mean()
    assert 0.65 < near < 0.75


@pytest.mark.parametrize("size", [1, 2, 3])
def test_a_point_stands_in_for_the_mates_that_are_missing(size):
    pool = np.linspace(0.2, 0.8, size)[:, None] * np.ones(4)
    found = breeding.mates(box(4), pool[:1], pool, np.random.default_rng(0))
    missing = (found == pool[0]).all(axis=(1, 2)).sum()
    assert missing == 4 - size
    if size == 1:
        assert np.array_equal(breeding.differential(box(4), pool, found, np.random.default_rng(0)), pool)
        assert np.array_equal(breeding.crossover(box(4), pool, found, np.random.default_rng(0)), pool)


def test_crossover_leaves_what_parents_share_and_centres_between_them():
    rng = np.random.default_rng(0)
    X, mate = np.tile([0.3, 0.5], (4000, 1)), np.tile([0.3, 0.7], (4000, 1))
    child = breeding.crossover(box(2), X, np.stack([mate] * 3), rng)
    assert (child[:, 0] == 0.3).all()
    changed = child[:, 1] != 0.5
    assert 0.45 < changed.mean() < 0.55
    near_mate = np.abs(child[changed, 1] - 0.7) < np.abs(child[changed, 1] - 0.5)
    assert 0.2 < near_mate.mean() < 0.3
    assert np.abs(child[changed, 1] - 0.6).mean() == pytest.approx(0.1, abs=0.01)


def test_differences_take_the_short_way_round():
    X = np.full((1, 2), 0.5)
    others = np.array([[[0.5, 0.5]], [[0.05, 0.55]], [[0.95, 0.45]]])
    steps = [breeding.differential(box(2, [0]), X, others, np.random.default_rng(seed)) - X for seed in range(20)]
    assert np.abs(steps).max() == pytest.approx(0.05)


def test_redrawing_changes_one_coordinate_and_reaches_everywhere():
    X = np.full((5000, 3), 0.1)
    trial = breeding.redraw_coordinate(box(3), X, np.stack([X] * 3), np.random.default_rng(0))
    assert ((trial != X).sum(axis=1) == 1).all()
    assert np.histogram(trial[trial != X], bins=10, range=(0, 1))[0].min() > 400


def test_mutation_is_small_symmetric_and_of_one_coordinate_on_average():
    X = np.zeros((20_000, 10))
    step = breeding.mutate(X, np.random.default_rng(0))
    assert (step != 0).sum(axis=1).mean() == pytest.approx(1.0, abs=0.03)
    assert abs(step[step != 0].mean()) < 0.002
    assert 0.02 < np.abs(step[step != 0]).mean() < 0.07
    assert np.abs(step).max() <= 1.0


@pytest.mark.parametrize("index", [0.0, 10.0, 20.0])
def test_mutation_is_as_long_as_its_index_says(index):
    """The mean of its polynomial distribution is 1 / (index + 2)."""
    step = breeding.mutate(np.zeros((20_000, 10)), np.random.default_rng(1), index)
    assert np.abs(step[step != 0]).mean() == pytest.approx(1.0 / (index + 2.0), rel=0.03)


class Parabolas(Problem):
    """m paraboloids of three variables, with a constraint that nothing satisfies unless it is `feasible`."""

    def __init__(self, m, feasible):
        super().__init__(n_var=3, n_obj=m, n_ieq_constr=1, xl=0.0, xu=1.0)
        self.excess = -1.0 if feasible else 1.0

    def _evaluate(self, X, out, *args, **kwargs):
        out["F"] = np.stack([((X - k / self.n_obj) ** 2).sum(axis=1) for k in range(self.n_obj)], axis=1)
        out["G"] = self.excess + 0.1 * X[:, :1]


@pytest.mark.parametrize(
    ("m", "feasible", "index"),
    [
        (2, True, breeding.INDEX_MUTATION),
        (3, True, breeding.INDEX_MUTATION),
        (4, True, breeding.INDEX_MUTATION_MANY),
        (2, False, breeding.INDEX_MUTATION_INFEASIBLE),
        (4, False, breeding.INDEX_MUTATION_INFEASIBLE),
    ],
)
def test_mutation_takes_longer_steps_with_many_objectives_and_as_long_as_nothing_is_feasible(m, feasible, index, monkeypatch):
    seen = set()

    def noted(X, rng, index):
        seen.add(index)
        return X

    monkeypatch.setattr(breeding, "mutate", noted)
    MACS().minimize(Parabolas(m, feasible), evaluations=300, seed=1)
    assert seen == {index}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 9])
def test_a_constraint_with_many_local_optima_is_satisfied(seed):
    """C1-DTLZ1 (Jain and Deb 2014): feasible is only what is near the front. With shorter steps these two of ten searches found two
    feasible points, or none."""
    assert len(MACS(archive=100).minimize(get_problem("c1dtlz1"), evaluations=30_000, seed=seed)) == 100


def test_operators_that_succeed_get_more_and_none_gets_nothing():
    credit, count = breeding.no_credit(len(breeding.OPERATORS)), len(breeding.OPERATORS)
    assert np.allclose(breeding.operator_shares(credit), 1 / count)
    operator = np.repeat(np.arange(count), 25)
    for _ in range(40):
        credit = breeding.updated_credit(credit, operator, operator == 1)
    share = breeding.operator_shares(credit)
    assert share.sum() == pytest.approx(1.0)
    assert share.argmax() == 1
    assert share[1] > 0.8
    assert np.allclose(share[[0, 2, 3]], breeding.LEAST_SHARE, atol=0.01)
    for _ in range(40):  # what was is forgotten
        credit = breeding.updated_credit(credit, operator, operator == 2)
    assert breeding.operator_shares(credit).argmax() == 2


def test_nothing_tried_changes_nothing_that_can_be_seen():
    credit = np.zeros((len(breeding.OPERATORS), 2))
    assert np.array_equal(breeding.updated_credit(credit, np.arange(0), np.zeros(0, dtype=bool)), credit)
    assert np.allclose(breeding.operator_shares(credit), 1 / len(credit))


def test_where_shares_are_fixed_crossover_has_most():
    assert breeding.SHARES.sum() == pytest.approx(1.0)
    assert breeding.SHARES[0] > 0.8
    assert (breeding.SHARES >= breeding.LEAST_SHARE).all()


def test_on_surfaces_crossover_is_another_and_all_else_the_same():
    for (curve, mutates), (surface, also) in zip(breeding.OPERATORS, breeding.OPERATORS_SURFACE, strict=True):
        assert mutates == also
        assert (curve is surface) == (curve is not breeding.crossover)


def test_crossover_on_surfaces_centres_between_the_parents_and_is_as_often_near_each():
    X, mate = np.full((8000, 1), 0.3), np.full((8000, 1), 0.7)
    many, few = (f(box(1), X, np.stack([mate] * 3), np.random.default_rng(0)) for f in (breeding.even_crossover, breeding.crossover))
    changed = many[many != 0.3]
    assert 0.45 < len(changed) / len(many) < 0.55
    assert 0.46 < (changed > 0.5).mean() < 0.54
    near_many, near_few = (np.abs(np.abs(children[children != 0.3] - 0.5) - 0.2).mean() for children in (many, few))
    assert near_many < 0.7 * near_few


def test_mates_are_from_the_whole_pool_where_that_is_asked_for():
    pool = np.linspace(0.0, 1.0, 101)[:, None]
    X = np.zeros((400, 1))
    everywhere = breeding.mates(box(1), X, pool, np.random.default_rng(0), wide=1.0)
    assert np.histogram(everywhere, bins=4, range=(0, 1))[0].min() > 200
    assert (breeding.mates(box(1), X, pool, np.random.default_rng(0), wide=0.0) <= 0.21).all()


def test_the_search_credits_what_the_archive_keeps():
    settings = MACS(archive=20)
    box = boxed(lambda X: np.stack([(X**2).sum(axis=1), ((X - 1) ** 2).sum(axis=1)], axis=1), [(-2, 2)] * 4)
    state = settings.begin(box, 2000, np.random.default_rng(0))
    while state.evaluations < 2000:
        settings.advance(state, box, 2000)
        assert (state.credit[:, 0] <= state.credit[:, 1]).all()
    assert not np.array_equal(state.credit, breeding.no_credit(len(breeding.OPERATORS)))


def test_copies_of_known_points_are_no_success(monkeypatch):
    """There are 101 different points, and the front is all of them: once they are known, nothing can be a success."""

    def stairs(X):
        f = np.round(X[:, :1], 1)
        return np.hstack([f, -f])

    kept, update = [], breeding.updated_credit
    monkeypatch.setattr(breeding, "updated_credit", lambda credit, operator, won: kept.append(won.sum()) or update(credit, operator, won))
    settings, box = MACS(archive=120), boxed(stairs, [(-5, 5)] * 4)
    state = settings.begin(box, 4000, np.random.default_rng(0))
    complete = 0
    while state.evaluations < 4000:
        complete += len(state.archive) == 101
        settings.advance(state, box, 4000)
    assert complete > 5 and sum(kept) > 0 and not any(kept[-complete:])


def test_how_many_are_sampled_and_bred():
    assert MACS().points_to_sample(10_000) == MACS().offspring(10, 2) == 10
    assert MACS(archive=100).points_to_sample(30_000) == MACS(archive=100, breeding=1).offspring(100, 3) == 100
    assert MACS(archive=100).offspring(100, 2) == 15
    assert MACS(archive=100).offspring(100, 3) == MACS(archive=100).offspring(100, 4) == 100
    assert MACS(archive=100).offspring(100, 2, lone=45) == MACS(archive=100).offspring(100, 3, lone=45) == 55
    assert MACS(archive=100).offspring(100, 2, feasible=False) == 200
    assert MACS(breeding=0).offspring(100, 2, feasible=False) == 0
    assert MACS(archive=100, breeding=0.15).offspring(100, 4) == 15
    assert MACS(archive=100).points_to_sample(500) == 25
    assert MACS(archive=100).points_to_sample(20) == MACS(archive=100).offspring(3, 2) == 10
    assert MACS(sample=40).points_to_sample(20) == 40
    assert MACS().offspring(0, 2) == MACS(breeding=0).offspring(50, 2) == 0
    assert MACS.paper(agents=7, archive=100).points_to_sample(30_000) == 7
    assert MACS.paper(sample=30).sample == 30
    assert MACS.paper().offspring(10, 2) == 0


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
    bred, alone = (searched(MACS(archive=50, breeding=each), rippled, 20, 8000, 1) for each in (None, 0.0))
    assert len(bred.parents) == 50 and (np.diff(bred.parents.violation) >= 0.0).all()
    assert bred.closest.violation[0] < 0.5 * alone.closest.violation[0]


def test_what_agents_find_is_not_bred_as_long_as_nothing_is_feasible():
    solver = MACS(archive=30)
    box = boxed(lambda X: np.column_stack([X[:, 0], -X[:, 0]]), [(0, 1)] * 20, constraints=rippled)
    state = solver.begin(box, 5000, np.random.default_rng(1))
    for actions in (individual_actions, social_actions):
        trials, known = Trials(solver, state, box, 5000), state.breeders
        actions(trials)
        remember(state, trials.seen, solver, box, bred=False)
        assert state.breeders is known and len(trials.seen)
    assert state.closest.violation[0] < state.breeders.violation[0]


def test_parents_are_the_better_of_two_as_long_as_nothing_is_feasible(monkeypatch):
    """So that of n the i-th best is one with the probability (2 (n - i) + 1) / n^2."""
    solver, rows = MACS(archive=20, breeding=10.0), []
    box = boxed(lambda X: np.column_stack([X[:, 0], -X[:, 0]]), [(0, 1)] * 20, constraints=rippled)
    state = solver.begin(box, 50_000, np.random.default_rng(1))
    known, points = state.breeders, box.box.to_unit(state.breeders.Z)
    breed = breeding.breed
    monkeypatch.setattr(breeding, "breed", lambda cube, X, *rest: (rows.append(X), breed(cube, X, *rest))[1])
    for _ in range(20):
        state.breeders = known
        breeding.breed_archive(Trials(solver, state, box, 50_000))
    parents = np.vstack(rows)
    shares = (parents[:, None] == points).all(axis=2).mean(axis=0)
    assert np.allclose(shares, (2 * np.arange(20, 0, -1) - 1) / 400, atol=0.01)


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
    assert not len(state.outside) or not (state.archive.F[:, None] <= state.outside.F).all(axis=2).any()
