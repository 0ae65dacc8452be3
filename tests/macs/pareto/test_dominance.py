import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from macs.evaluation.evaluator import CONVERGED, INFEASIBLE, Evaluation
from macs.pareto.dominance import (
    APART,
    alpha_nondominated,
    constrained_dominates,
    distinct,
    dominates,
    extremes,
    feasible_and_no_worse,
    nearest,
    nondominated,
    normalised,
    objective_units,
    ranges,
    separate,
    slack,
)

FRONTS = st.integers(1, 4).flatmap(
    lambda m: arrays(float, st.tuples(st.integers(1, 15), st.just(m)), elements=st.integers(0, 4).map(float))
)


@given(FRONTS)
def test_nondominated_rows_are_those_that_no_other_row_dominates(F):
    keep = nondominated(F)
    dominated = dominates(F[:, None], F[None]).any(axis=0)
    first = np.isin(np.arange(len(F)), np.unique(F, axis=0, return_index=True)[1])
    assert np.array_equal(keep, ~dominated & first)
    # Dominance is weak dominance without equality.
    strict, weak = dominates(F[:, None], F[None]), (F[:, None] <= F[None]).all(axis=-1)
    equal = (F[:, None] == F[None]).all(axis=-1)
    assert np.array_equal(strict, weak & ~equal) and not (strict & strict.T).any()


def test_rows_with_nan_are_never_kept_and_never_dominate():
    F = np.array([[np.nan, 0.0], [1.0, 1.0], [2.0, 2.0]])
    assert nondominated(F).tolist() == [False, True, False]
    assert nondominated(np.full((2, 2), np.nan)).tolist() == [False, False]
    assert nondominated(np.empty((0, 2))).shape == (0,) and not dominates(F[0], F[2])
    F = np.array([[0.0, 5.0], [0.0, 3.0], [2.0, 1.0], [1.0, 1.0]])
    assert extremes(F).tolist() == [1, 3]


@pytest.mark.parametrize(
    ("violation", "other", "expected"),
    [
        (0.0, 1.0, True),
        (1.0, 0.0, False),
        (1.0, 2.0, True),
        (2.0, 2.0, False),
        (0.0, np.inf, True),
        (np.inf, np.inf, False),
        (0.0, 0.0, False),
    ],
)
def test_feasible_beats_infeasible_and_less_violation_beats_more(violation, other, expected):
    worse, better = np.array([5.0, 5.0]), np.array([1.0, 1.0])
    assert constrained_dominates(worse, np.float64(violation), better, np.float64(other)) == expected


def test_feasible_points_are_compared_by_objectives_within_the_tolerance():
    assert constrained_dominates(np.zeros(2), np.float64(1e-7), np.ones(2), np.float64(0.0), tolerance=1e-6)
    assert not constrained_dominates(np.zeros(2), np.float64(1e-5), np.ones(2), np.float64(0.0), tolerance=1e-6)
    for violation, other in ((1e-6, 0.0), (0.0, 1e-6), (1e-6, 1e-6)):  # as much as the tolerance is feasible
        assert constrained_dominates(np.zeros(2), np.float64(violation), np.ones(2), np.float64(other), tolerance=1e-6)
        assert not constrained_dominates(np.ones(2), np.float64(violation), np.zeros(2), np.float64(other), tolerance=1e-6)


def test_points_far_worse_for_a_little_of_one_objective_are_left_out_but_not_the_best():
    a = np.linspace(0.2, 1.3, 6)
    F = np.stack([np.cos(a), np.sin(a), np.linspace(0.4, 0.6, 6)], axis=1)
    least = F[:, 0].min()
    far = np.vstack([F, [least - 1e-4, 5.0, 5.0], [least - 2e-4, 5.1, 5.1]])
    assert nondominated(far).all() and alpha_nondominated(F).all()
    assert alpha_nondominated(far).tolist() == [True] * 6 + [False, True]
    F = np.array([[0.0, 1.0], [0.5, 0.4], [1.0, 0.0], [0.9, 0.39]])
    assert alpha_nondominated(np.column_stack([F, np.full(4, 1e20)])).tolist() == alpha_nondominated(F).tolist()


def results(F: list[list[float]], status: str = CONVERGED) -> Evaluation:
    return Evaluation(np.zeros((len(F), 1)), np.array(F), np.zeros(len(F)), np.full(len(F), status))


@given(st.integers(0, 1), st.floats(1e-3, 1e6), st.booleans())
def test_a_result_that_is_worse_in_one_objective_is_not_taken_however_much_better_it_is_in_the_others(k, span, far):
    """Worse by a hundredth of the range, or only by a hundred-thousandth; what is worse by less than rounding may be taken."""
    F, scale = np.array([[3.0, -2.0]]), np.array([span, span])
    worse = F - scale
    worse[0, k] = F[0, k] + (1e-2 if far else 1e-5) * span
    assert not feasible_and_no_worse(results(worse.tolist()), F, np.zeros(1), scale)[0]
    worse[0, k] = F[0, k] + 1e-8 * span
    assert feasible_and_no_worse(results(worse.tolist()), F, np.zeros(1), scale)[0]


def test_what_is_equal_is_no_worse_and_what_failed_is_never_taken():
    F = np.array([[1.0, 2.0]])
    assert feasible_and_no_worse(results(F.tolist()), F, np.zeros(1), np.ones(2))[0]
    for status in (INFEASIBLE, "failed", "timeout"):
        assert not feasible_and_no_worse(results([[0.0, 0.0]], status), F, np.zeros(1), np.ones(2))[0]
    assert not feasible_and_no_worse(results([[np.nan, 0.0]]), F, np.zeros(1), np.ones(2))[0]
    F, unit = np.zeros((2, 2)), np.ones(2)
    assert slack(np.array([0.0, 1e-6])) == pytest.approx([1e-7, 1e-7 + 1e-5])
    found = results([[5e-6, 0.0], [5e-6, 0.0]])
    assert feasible_and_no_worse(found, F, np.array([0.0, 1e-6]), unit).tolist() == [False, True]
    assert not feasible_and_no_worse(results([[2e-5, 0.0]]), F[:1], np.array([1e-6]), unit)[0]


def test_ranges_neighbours_normalised_values_and_points_that_differ_by_rounding():
    F = np.array([[1.0, 7.0, -0.5], [4.0, 7.0, -0.5]])
    assert ranges(F).tolist() == [3.0, 7.0, 1.0] and ranges(-F).tolist() == [3.0, 7.0, 1.0]
    # In the units as they are the second would be the nearer one.
    F = np.array([[100.0, 0.0], [0.0, 3.0], [0.0, 0.0]])
    assert nearest(np.zeros(2), F, np.array([1000.0, 1.0])).tolist() == [2, 0, 1]
    assert nearest(np.zeros(2), F, np.array([1.0, 1.0])).tolist() == [2, 1, 0]
    ideal, nadir = np.array([1.0, -10.0, 3.0]), np.array([3.0, 10.0, 3.0])
    assert normalised(np.array([[1.0, -10.0, 3.0], [3.0, 10.0, 5.0], [2.0, 5.0, 2.0]]), ideal, nadir).tolist() == [
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 2.0],
        [0.5, 0.75, -1.0],
    ]
    F = np.array([[0.0, 10.0], [1e-9, 10.0 - 1e-8], [0.5, 5.0], [1.0, 0.0], [0.6, 5.5]])
    assert distinct(F, np.array([1.0, 10.0])).tolist() == [True, False, True, True, False]
    assert distinct(F, np.array([1e-3, 1e-2])).tolist() == [True, True, True, True, False]


@pytest.mark.parametrize(
    ("several", "more", "unit"),
    [
        pytest.param([[[0.0], [2.0]], [[0.0], [9.0]]], {}, 2.0, id="the range over the first set"),
        pytest.param([[[5.0], [5.0 + 4e-6]], [[0.0], [9.0]]], {}, 9.0, id="over the next, where it hardly varies"),
        pytest.param([[[5.0], [5.0 + 6e-6]], [[0.0], [9.0]]], {}, 6e-6, id="which depends on its size"),
        pytest.param([[[5.0]], [[-7.0]]], {}, 7.0, id="its size at the last"),
        pytest.param([[[5.0]], [[-7.0]]], {"sizes": 8.0}, 8.0, id="its terms"),
        pytest.param([[[0.0], [2.0]]], {"sizes": 8.0, "least": 1.0}, 2.0, id="its range, whatever its terms"),
        pytest.param([[[0.0], [2.0]]], {"least": 3.0}, 3.0, id="at least so much"),
        pytest.param([[[0.0], [2.0]]], {"least": 3.0, "stated": 0.1}, 0.1, id="what is stated"),
        pytest.param([[[0.0]]], {}, 1.0, id="one, where all is nothing"),
    ],
)
def test_what_counts_as_one(several, more, unit):
    values = {"stated": 0.0, "least": 0.0, "sizes": 0.0} | more
    arrays = {name: np.array([value]) for name, value in values.items()}
    assert objective_units([np.array(F) for F in several], **arrays) == pytest.approx(unit, rel=1e-9)


@given(FRONTS, st.floats(0.1, 300.0))
def test_points_in_different_places(F, width):
    """Each point that is left out has one in its place, no two of the others are in one place, and the best of each objective are there."""
    kept, least = separate(F, np.full(F.shape[1], width)), APART * width / len(F)
    apart = np.abs(F[:, None] - F).max(axis=2) > least
    assert (~apart[:, kept]).any(axis=1).all() and (apart | np.eye(len(F), dtype=bool))[np.ix_(kept, kept)].all()
    assert separate(F[:0], np.ones(F.shape[1])).shape == (0,)
    # Where the width is many times the range, the best of two objectives may be in one place.
    ends = np.unique(extremes(F))
    if (apart | np.eye(len(F), dtype=bool))[np.ix_(ends, ends)].all():
        assert (F[kept].min(axis=0) == F.min(axis=0)).all()
