"""Constraints as presented to algorithms, against the definition of constrained dominance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from macs.baselines.constraints import by_objectives, degree, excess, feasible_first, objective, penalty, presented
from macs.pareto.dominance import constrained_dominates, dominates

VALUES = st.floats(-1e9, 1e9).map(lambda value: round(value, 3))
VIOLATIONS = st.sampled_from([0.0, 1e-9, 1e-6, 2e-6, 0.5, 0.5000001, 3.0, 1e9, np.inf])


@given(arrays(float, (6, 2), elements=VALUES), arrays(float, 6, elements=VIOLATIONS))
def test_objectives_that_include_the_violation_dominate_as_feasible_first_does(F, violation):
    F[np.isinf(violation)] = np.nan
    G = by_objectives(*presented("feasible-first", 0.0, F, violation, 1e-6))
    assert np.isfinite(G).all()
    wanted = constrained_dominates(F[:, None], violation[:, None], F, violation, 1e-6)
    assert np.array_equal(dominates(G[:, None], G), wanted)


def test_the_three_ways_by_hand():
    F, violation = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [np.nan, 0.0]]), np.array([0.0, 1e-7, 0.5, np.inf])
    cv = excess(F, violation, 1e-6)
    assert cv.tolist() == [0, 0, 0.5, np.inf]
    for presented_F, presented_cv in (feasible_first(F, cv), penalty(F, cv, 10.0), objective(F, cv)):
        assert np.isfinite(presented_F).all()
        assert presented_cv[3] == np.inf
    assert feasible_first(F, cv)[0][:3].tolist() == [[1, 2], [3, 4], [5, 6]]
    assert feasible_first(F, cv)[1][:3].tolist() == [0, 0, 0.5]
    assert penalty(F, cv, 10.0)[0][:3].tolist() == [[1, 2], [3, 4], [10, 11]]
    assert penalty(F, cv, 10.0)[1][:3].tolist() == [0, 0, 0]
    assert objective(F, cv)[0][:3].tolist() == [[1, 2, 0], [3, 4, 0], [5, 6, 0.5]]
    assert objective(F, cv)[1][:3].tolist() == [0, 0, 0]


def test_what_failed_is_violated_infinitely_whichever_of_its_numbers_is_missing():
    F = np.array([[1.0, 2.0], [np.nan, 2.0], [1.0, 2.0], [1.0, 2.0], [np.inf, 2.0]])
    violation = np.array([0.5, 0.5, np.nan, np.inf, 0.0])
    assert excess(F, violation, 1e-6).tolist() == [0.5, np.inf, np.inf, np.inf, np.inf]
    assert excess(F, violation, 1e-6, np.full(5, 3.0)).tolist() == [3.0, np.inf, np.inf, np.inf, np.inf]


def test_a_constraint_that_is_no_number_is_violated_infinitely():
    violation = np.array([1.0, 1.0, 1.0, np.inf])
    for name in ("sum", "log"):
        found = degree(name, violation, lambda: np.array([[np.nan, 0.0], [np.inf, 0.0], [1.0, 1.0], [1.0, 1.0]]), 1e-6)
        assert found[[0, 1, 3]].tolist() == [np.inf] * 3 and found[2] == pytest.approx(2.0 if name == "sum" else 2.0 * np.log(2.0))
    assert degree("sum", violation[:1], lambda: np.array([[1e-6, 2e-6]]), 1e-6).tolist() == [2e-6]
