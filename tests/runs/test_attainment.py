"""What many runs attain: surfaces by hand, against moocore and their definition; histories as median and quartiles."""

from __future__ import annotations

import moocore
import numpy as np
import pytest

from macs.pareto.dominance import nondominated
from problems.compiled import Objective
from runs.measures.attainment import attainment, band, staircase
from runs.measures.references import foreign

A = np.array([[1.0, 3.0], [3.0, 1.0]])
B = np.array([[2.0, 2.0]])
EMPTY = np.empty((0, 2))
GOALS = (Objective("cost"), Objective("gain", "m", "maximize"))


def test_two_runs_by_hand():
    for runs in ([A, B], [B, A]):
        found = attainment(runs)
        assert found.best.tolist() == [[1, 3], [2, 2], [3, 1]]
        assert found.worst.tolist() == [[2, 3], [3, 2]]
        assert found.median.tolist() == found.best.tolist()


def test_an_empty_front_attains_nothing():
    found = attainment([A, EMPTY, B])
    assert found.runs == 3 and found.corners[1].tolist() == [[2, 3], [3, 2]] and found.worst.shape == (0, 2)
    assert found.median.tolist() == [[2, 3], [3, 2]]
    nothing = attainment([foreign(EMPTY, GOALS)] * 2)
    assert nothing.best.shape == (0, 2) and nothing.worst.shape == (0, 2)


@pytest.mark.parametrize(("m", "runs"), [(2, 7), (3, 5)])
def test_as_moocore_and_the_definition_have_them(m, runs):
    rng = np.random.default_rng(m)
    fronts = [rng.random((rng.integers(1, 7), m)) for _ in range(runs)]
    found = attainment(fronts)
    sets = np.repeat(np.arange(runs), [len(front) for front in fronts])
    anywhere = rng.random((300, m))
    attained = sum((front[:, None] <= anywhere).all(axis=2).any(axis=0).astype(int) for front in fronts)
    for k in range(1, runs + 1):
        theirs = moocore.eaf(np.vstack(fronts), sets, percentiles=[100 * k / runs])[:, :m]
        assert sorted(found.corners[k - 1].tolist()) == sorted(theirs.tolist())
        assert nondominated(found.corners[k - 1]).all()
        assert ((found.corners[k - 1][:, None] <= anywhere).all(axis=2).any(axis=0) == (attained >= k)).all()


def test_senses_and_what_did_not_converge():
    runs = [foreign(front * [1, -1], GOALS) for front in (A, B)]
    found, plain = attainment(runs), attainment([A, B])
    for k in (1, 2):
        assert (found.corners[k - 1] * [1, -1]).tolist() == plain.corners[k - 1].tolist()
    mixed = attainment([runs[0], B * [1, -1]])
    assert mixed.worst.tolist() == found.worst.tolist()


def test_a_staircase_bounds_what_is_dominated():
    plain = staircase(A, np.ones(2), np.array([5.0, 6.0]))
    assert plain.tolist() == [[1, 6], [1, 3], [3, 3], [3, 1], [5, 1]]
    turned = staircase(A * [1, -1], np.array([1, -1]), np.array([5.0, -6.0]))
    assert (turned * [1, -1]).tolist() == plain.tolist()


def test_a_band_by_hand():
    runs = [(np.array([1.0, 3.0]), np.array([10.0, 4.0])), (np.array([2.0]), np.array([6.0])), (np.array([1.0, 2.0]), np.array([8.0, 1.0]))]
    found = band(runs)
    assert found.x.tolist() == [1, 2, 3] and found.runs == 3
    # Before its first sample the second run has failed; after its last each keeps its value.
    assert found.median.tolist() == [10.0, 6.0, 4.0]
    assert found.lower.tolist() == [9.0, 3.5, 2.5] and found.upper.tolist() == [np.inf, 8.0, 5.0]
    mirrored = band([(x, -y) for x, y in runs], larger=True)
    assert mirrored.median.tolist() == (-found.median).tolist() and mirrored.lower.tolist() == (-found.upper).tolist()


def test_empty_fronts_are_worst():
    x = np.array([0.0, 1.0])
    found = band([(x, np.array([np.nan, 2.0])), (x, np.array([np.inf, 3.0])), (x, np.array([1.0, 1.0]))])
    assert found.median.tolist() == [np.inf, 2.0] and found.lower.tolist() == [np.inf, 1.5]
