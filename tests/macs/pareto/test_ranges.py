"""Ranges, and what counts as equal, better and no worse in units of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macs.evaluation.evaluator import CONVERGED, INFEASIBLE, Evaluation
from macs.pareto.dominance import distinct, feasible_and_no_worse, nearest, normalised, ranges, slack


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


def test_a_point_that_is_feasible_only_within_the_tolerance_may_have_been_too_good_by_some_times_its_violation():
    F, unit = np.zeros((2, 2)), np.ones(2)
    assert slack(np.array([0.0, 1e-6])) == pytest.approx([1e-7, 1e-7 + 1e-5])
    found = results([[5e-6, 0.0], [5e-6, 0.0]])
    assert feasible_and_no_worse(found, F, np.array([0.0, 1e-6]), unit).tolist() == [False, True]
    assert not feasible_and_no_worse(results([[2e-5, 0.0]]), F[:1], np.array([1e-6]), unit)[0]


def test_what_is_equal_is_no_worse_and_what_failed_is_never_taken():
    F = np.array([[1.0, 2.0]])
    assert feasible_and_no_worse(results(F.tolist()), F, np.zeros(1), np.ones(2))[0]
    for status in (INFEASIBLE, "failed", "timeout"):
        assert not feasible_and_no_worse(results([[0.0, 0.0]], status), F, np.zeros(1), np.ones(2))[0]
    assert not feasible_and_no_worse(results([[np.nan, 0.0]]), F, np.zeros(1), np.ones(2))[0]


def test_an_objective_without_range_has_its_size_as_range_and_at_least_one():
    F = np.array([[1.0, 7.0, -0.5], [4.0, 7.0, -0.5]])
    assert ranges(F).tolist() == [3.0, 7.0, 1.0]
    assert ranges(-F).tolist() == [3.0, 7.0, 1.0]


def test_neighbours_are_counted_in_ranges():
    """In the units as they are the second would be the nearer one."""
    F = np.array([[100.0, 0.0], [0.0, 3.0], [0.0, 0.0]])
    assert nearest(np.zeros(2), F, np.array([1000.0, 1.0])).tolist() == [2, 0, 1]
    assert nearest(np.zeros(2), F, np.array([1.0, 1.0])).tolist() == [2, 1, 0]


def test_the_ideal_is_zero_and_the_nadir_one():
    ideal, nadir = np.array([1.0, -10.0, 3.0]), np.array([3.0, 10.0, 3.0])
    assert normalised(np.array([[1.0, -10.0, 3.0], [3.0, 10.0, 5.0], [2.0, 5.0, 2.0]]), ideal, nadir).tolist() == [
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 2.0],
        [0.5, 0.75, -1.0],
    ]


def test_of_points_that_differ_by_rounding_only_the_first_is_kept():
    F = np.array([[0.0, 10.0], [1e-9, 10.0 - 1e-8], [0.5, 5.0], [1.0, 0.0], [0.6, 5.5]])
    assert distinct(F, np.array([1.0, 10.0])).tolist() == [True, False, True, True, False]
    assert distinct(F, np.array([1e-3, 1e-2])).tolist() == [True, True, True, True, False]
