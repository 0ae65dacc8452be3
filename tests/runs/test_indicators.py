"""Indicators against closed forms and against moocore."""

from __future__ import annotations

import moocore
import numpy as np
import pytest

import runs
from macs import MACS
from problems import goddard, load, orbit_rise
from runs import additive_epsilon, gd, hypervolume, igd, igd_plus
from runs.indicators import distance_to_curve, inverted_distance
from transcription import DFET

LINE = np.column_stack([np.linspace(0, 1, 101), np.linspace(1, 0, 101)])
CORNERS = np.array([[0.0, 1.0], [1.0, 0.0]])


def fronts(m: int, n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random((n, m)) * np.arange(1, m + 1)


def reference(m: int) -> np.ndarray:
    """Sparse points of a sphere, none dominated."""
    points = np.abs(np.random.default_rng(5).standard_normal((12, m)))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


@pytest.mark.parametrize("m", [2, 3, 4])
def test_as_moocore_has_them(m):
    F, R = fronts(m, 7, 1), reference(m)
    F_, R_ = (np.ascontiguousarray((A - R.min(axis=0)) / np.ptp(R, axis=0)) for A in (F, R))
    for ours, theirs in ((igd, moocore.igd), (igd_plus, moocore.igd_plus), (additive_epsilon, moocore.epsilon_additive)):
        assert ours(F, R, normalise=False) == pytest.approx(theirs(F, ref=R), rel=1e-12)
        assert ours(F, R) == pytest.approx(theirs(F_, ref=R_), rel=1e-12)
    assert gd(F, R, normalise=False) == pytest.approx(moocore.igd(R, ref=F), rel=1e-12)
    assert hypervolume(F, R) == pytest.approx(moocore.hypervolume(F_, ref=[1.1] * m), rel=1e-12)
    assert hypervolume(F, R, normalise=False) == pytest.approx(hypervolume(F, R) * np.ptp(R, axis=0).prod(), rel=1e-9)


def test_a_dense_reference_is_a_curve():
    between = np.array([[0.005, 0.995], [0.305, 0.695]])
    assert gd(between, LINE) == pytest.approx(0.0, abs=1e-14)
    assert gd(between + 0.01, LINE) == pytest.approx(0.01 * np.sqrt(2), rel=1e-9)
    assert gd(between, CORNERS) > 0.1, "two points are no curve"
    # From the middle of a straight front: mean distance of a segment's points from its middle is a quarter of its length.
    assert igd(np.array([[0.5, 0.5]]), LINE) == pytest.approx(np.sqrt(2) / 4, rel=1e-3)
    uneven = np.vstack([LINE[:50], np.column_stack([np.linspace(0.5, 1, 5000), np.linspace(0.5, 0, 5000)])])
    assert igd(np.array([[0.5, 0.5]]), uneven) == pytest.approx(np.sqrt(2) / 4, rel=1e-3)


def test_a_front_in_pieces_has_no_line_between_them():
    pieces = np.vstack([LINE[:31], LINE[70:]])
    assert gd(np.array([[0.5, 0.5]]), pieces) == pytest.approx(0.2 * np.sqrt(2), rel=1e-9)
    assert gd(np.array([[0.105, 0.895]]), pieces) == pytest.approx(0.0, abs=1e-14)
    assert igd(pieces, pieces) < 0.01


def test_volumes_and_distances_in_closed_form():
    assert hypervolume(CORNERS, CORNERS) == pytest.approx(0.1 * 1.1 * 2 - 0.1**2)
    assert hypervolume(LINE, LINE) == pytest.approx(0.5 + 2 * 0.1 + 0.01, abs=0.006)
    assert hypervolume(np.array([[2.0, 2.0]]), LINE) == 0.0
    assert hypervolume(CORNERS, CORNERS, point=2.0) == pytest.approx(2 * 2 - 1)
    assert additive_epsilon(LINE + 0.25, LINE) == pytest.approx(0.25)
    assert igd_plus(LINE - 0.1, LINE) == 0.0 < igd(LINE - 0.1, LINE)
    scaled = LINE * [1e-3, 1e5] + [7.0, -3.0]
    for indicator in (gd, igd, igd_plus, additive_epsilon, hypervolume):
        assert indicator(scaled + np.array([1e-4, 2e4]), scaled) == pytest.approx(indicator(LINE + np.array([0.1, 0.2]), LINE), rel=1e-6)


def test_empty_fronts_and_nonsense():
    empty = np.empty((0, 2))
    assert np.isnan(gd(empty, LINE)) and hypervolume(empty, LINE) == 0.0
    assert igd(empty, LINE) == igd_plus(empty, LINE) == additive_epsilon(empty, LINE) == np.inf
    with pytest.raises(ValueError, match="no points"):
        gd(LINE, empty)
    with pytest.raises(ValueError, match="2 objectives, the reference 3"):
        gd(LINE, np.zeros((1, 3)))
    with pytest.raises(ValueError, match="shape"):
        igd(np.zeros(2), LINE)
    with pytest.raises(AttributeError, match="hypervolum"):
        runs.hypervolum  # noqa: B018


def test_dominated_points_of_a_reference_do_not_count():
    cloud = np.vstack([LINE, LINE + 3.0])
    assert gd(LINE, cloud) == 0.0 and igd(LINE, cloud) == igd(LINE, LINE)


@pytest.mark.parametrize("case", [goddard, orbit_rise])
def test_fronts_against_what_the_user_sees(case):
    """A Front knows its senses: the speed and the energy are maximised, and a reference beside it is as the user has it."""
    truth = case.reference()
    front = MACS().solve(load(case.__name__.rpartition(".")[2]), DFET(3, 1), evaluations=100, seed=1)
    assert gd(front, truth) == pytest.approx(distance_to_curve(front.objectives, truth).mean(), rel=1e-6)
    assert igd(front, truth) == pytest.approx(inverted_distance(front.objectives, truth), rel=1e-3)
    signs = np.sign(front.F[-1]) * np.sign(front.objectives[-1])
    assert hypervolume(front, truth) == hypervolume(front.F, truth * signs)
    assert hypervolume(truth, front) == hypervolume(truth * signs, front.F)
    assert igd(front, front) < 1e-12 and additive_epsilon(front, front) == 0.0
