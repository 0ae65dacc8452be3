"""Histories of runs as median and quartiles."""

from __future__ import annotations

import numpy as np
import pytest

from runs.measures.attainment import band


def test_a_band_by_hand():
    runs = [(np.array([1.0, 3.0]), np.array([10.0, 4.0])), (np.array([2.0]), np.array([6.0])), (np.array([1.0, 2.0]), np.array([8.0, 1.0]))]
    found = band(runs)
    assert found.x.tolist() == [1, 2, 3] and found.runs == 3
    # Before its first sample the second run has failed; after its last each keeps its value.
    assert found.median.tolist() == [10.0, 6.0, 4.0]
    assert found.lower.tolist() == [9.0, 3.5, 2.5] and found.upper.tolist() == [np.inf, 8.0, 5.0]
    mirrored = band([(x, -y) for x, y in runs], larger=True)
    assert mirrored.median.tolist() == (-found.median).tolist() and mirrored.lower.tolist() == (-found.upper).tolist()


def test_the_same_moments_are_quantiles_of_columns():
    rng = np.random.default_rng(0)
    x, values = np.arange(50.0), rng.random((9, 50))
    found = band([(x, row) for row in values])
    assert found.median == pytest.approx(np.median(values, axis=0)) and found.upper == pytest.approx(np.quantile(values, 0.75, axis=0))
    few = band([(x, row) for row in values], moments=7)
    assert len(few.x) == 7 and few.x[[0, -1]].tolist() == [0, 49]


def test_empty_fronts_are_worst():
    x = np.array([0.0, 1.0])
    found = band([(x, np.array([np.nan, 2.0])), (x, np.array([np.inf, 3.0])), (x, np.array([1.0, 1.0]))])
    assert found.median.tolist() == [np.inf, 2.0] and found.lower.tolist() == [np.inf, 1.5]


def test_what_is_no_history():
    with pytest.raises(ValueError, match="no run"):
        band([])
    for x, y in (([2.0, 1.0], [1.0, 1.0]), ([1.0], [1.0, 2.0]), ([], [])):
        with pytest.raises(ValueError, match="run 0: moments"):
            band([(np.array(x), np.array(y))])
