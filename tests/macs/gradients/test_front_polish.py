"""A front of whichever solver and transcription, brought down by gradients on another."""

import signal

import numpy as np
import pytest
from fronts import distance_to_curve
from smooth_problems import with_peak
from synthetic_fronts import black_box

from macs import NSGA2, Front
from macs.evaluation.bilevel import Bilevel
from macs.io.workers import TOGETHER
from problems import load
from problems.cases.goddard import reference
from transcription import DFET, SingleShooting
from transcription.stopping import stopping

FINE = DFET(8, 4)


@pytest.fixture(scope="module")
def rough() -> Front:
    """Goddard, by a search that knows no gradients."""
    return NSGA2(population=12).solve(load("goddard"), SingleShooting(40), evaluations=600, seed=1)


@pytest.fixture(scope="module")
def smooth(rough) -> Front:
    return rough.polished(FINE, solves=50)


@pytest.mark.slow
def test_the_front_comes_down_to_the_truth(rough, smooth):
    truth = reference(20001)
    assert distance_to_curve(rough.objectives, truth).max() > 1e-2, "there is something to do"
    assert len(smooth) == len(rough) and set(smooth.status) == {"converged"}
    assert distance_to_curve(smooth.objectives, truth).max() < 1e-3
    assert all(point.transcription == FINE.to_dict() and point.optimality < 1e-6 for point in smooth)
    assert smooth.F.min(axis=0) == pytest.approx(truth.min(axis=0) * [1, 0] + (-truth).min(axis=0) * [0, 1], abs=2e-2), "both ends"


def test_costs_are_those_of_both_and_there_are_no_more_points_than_asked(rough):
    few = rough.polished(FINE, solves=20, limit=5)
    assert len(few) == 5 and few.stats["gradient_solves"] == rough.stats["gradient_solves"] + 20
    assert few.stats["evaluations"] == rough.stats["evaluations"] == 600
    assert few.stats["wall_time"] > rough.stats["wall_time"] and few.stats["reproducible"]
    assert few.solver == rough.solver and few.stats["seed"] == 1


@pytest.mark.slow
def test_what_no_solve_came_to_stays_what_it_is(rough, tmp_path):
    few = rough.polished(FINE, solves=5)
    methods = {point.transcription["method"] for point in few}
    assert methods == {"DFET", "SingleShooting"}
    kept = [point for point in few if point.transcription["method"] == "SingleShooting"]
    assert all(any(np.array_equal(point.decision, one.decision) for one in rough) for point in kept)
    assert all(len(point.alone()) == 1 for point in few)
    few.save(tmp_path / "few.nc")
    again = Front.load(tmp_path / "few.nc")
    assert np.array_equal(again.F, few.F) and [p.transcription for p in again] == [p.transcription for p in few]
    assert np.array_equal(rough.polished(FINE, solves=0).F, rough.F)


@pytest.mark.slow
def test_it_begins_from_what_is_nearest_to_feasible_where_nothing_is(rough):
    lost = NSGA2(population=12).solve(load("goddard"), SingleShooting(40), evaluations=12, seed=1, inner="propagate")
    assert not len(lost) and lost.closest is not None
    found = lost.polished(FINE, solves=60, limit=12)
    assert len(found) >= 6 and distance_to_curve(found.objectives, reference(20001)).max() < 1e-3
    assert found.stats["evaluations"] == 12 and 1 < found.stats["gradient_solves"] <= 60
    none = lost.polished(FINE, solves=0)
    assert not len(none) and none.message == lost.message and none.closest is not None and none.stats["gradient_solves"] == 0


def test_an_interruption_leaves_what_was_found(rough, monkeypatch):
    solve, solved = Bilevel._descend, []

    def refine(self, *arguments):
        solved.append(solve(self, *arguments))
        if len(solved) == 2:
            signal.raise_signal(signal.SIGINT)
            assert stopping()
        return solved[-1]

    monkeypatch.setattr(Bilevel, "_descend", refine)
    found = rough.polished(FINE, solves=50)
    assert (
        2 <= found.stats["gradient_solves"] <= 2 * TOGETHER and found.stats["stopped"] == "interrupted" and not found.stats["reproducible"]
    )
    assert any(point.transcription == FINE.to_dict() for point in found) and len(found) == len(rough)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"solves": -1}, "solves"),
        ({"solves": 2.5}, "solves"),
        ({"limit": 0}, "limit"),
        ({"limit": True}, "limit"),
        ({"verify": 0}, "verify"),
    ],
)
def test_what_makes_no_sense_is_refused(rough, wrong, words):
    with pytest.raises(ValueError, match=words):
        rough.polished(FINE, **wrong)


def test_fronts_without_gradients_are_refused_and_without_time_nothing_is_solved(rough):
    with pytest.raises(ValueError, match="Transcription such as DFET"):
        rough.polished("dfet:8x4")
    with pytest.raises(ValueError, match="black box"):
        black_box(3).polished(FINE)
    with pytest.raises(ValueError, match="peak"):
        NSGA2(population=4).solve(with_peak("maximised"), SingleShooting(5), evaluations=8, inner="propagate", seed=1).polished(DFET(2, 2))
    found = rough.polished(FINE, time_limit=1e-9)
    assert found.stats["stopped"] == "time limit" and found.stats["gradient_solves"] == 0
    assert np.array_equal(found.F, rough.F)
