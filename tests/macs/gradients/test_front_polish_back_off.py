"""Back-off of a front's points until they are feasible when simulated, by the problem of Bryson and Denham, whose front is known.

Bryson and Ho, "Applied Optimal Control", 1975, section 3.11: least effort is 4 / (9 l) where the height may not exceed l <= 1/6.
"""

import signal

import casadi as ca
import numpy as np
import pytest
from smooth_problems import bryson_denham

from macs import MACS, Front
from macs.evaluation.bilevel import Bilevel
from macs.gradients import front_polish
from macs.gradients.front_polish import back_off
from problems import Problem
from transcription import DFET, SingleShooting
from transcription.inner import Propagate

COARSE, SHOOTING = DFET(3, 3), SingleShooting(10, control="linear")
VERIFY = 1e-4


def gust() -> Problem:
    """A final value leaves no room to keep away from it, and two elements do not see what the wind does."""
    problem = Problem("gust")
    phase = problem.phase("flight", t0=0.0, tf=1.0)
    phase.state("x", bounds=(-2.0, 2.0), initial=0.0, final=0.5)
    u = phase.control("u", bounds=(-3.0, 3.0))
    phase.dynamics(x=u + ca.sin(20.0 * phase.time))
    problem.minimize("effort", phase.integral(u**2))
    return problem


@pytest.fixture(scope="module")
def rough() -> Front:
    return MACS(refine=False).solve(bryson_denham(), SHOOTING, evaluations=400, seed=1, inner="projection")


def share(front: Front) -> np.ndarray:
    """Simulated effort, relative to the least effort of any flight of this height."""
    simulated = front.simulate(tolerance=np.inf).objectives
    return simulated[:, 0] / (4 / (9 * simulated[:, 1]))


@pytest.mark.slow
def test_points_hold_at_a_price_that_is_small(rough, monkeypatch):
    solved = []
    monkeypatch.setattr(front_polish, "back_off", lambda *arguments: (solved.append(back_off(*arguments)), solved[-1])[1])
    unchecked, kept = (rough.polished(COARSE, solves=30, verify=verify) for verify in (None, VERIFY))
    before, after = (front.simulate(tolerance=VERIFY) for front in (unchecked, kept))
    assert before.violation.max() > 10 * VERIFY and share(unchecked).min() < 0.99, "better than there is: they exceed their limits"
    assert after.violation.max() <= VERIFY and share(kept).min() > 1 - 1e-3
    # A point of the search that no solve improved is left out where it exceeds its limits, and what it dominates comes back for it; each
    # point of a solve is kept.
    solutions = [point for point in unchecked if not np.isclose(rough.F, point.F, rtol=1e-9).all(axis=1).any()]
    assert 10 >= len(kept) >= len(solutions) >= 9 and np.median(share(kept)) < 1.03
    assert not any(np.isclose(rough.F, point.F, rtol=1e-9).all(axis=1).any() for point in kept)
    moved = [point for point in kept if "inside its limits" in point.note]
    assert moved and all(point.optimality is None for point in moved)
    again = int(solved[0][2].sum())
    assert kept.stats["gradient_solves"] == unchecked.stats["gradient_solves"] + again and again >= len(moved), "each at once"


def test_points_that_cannot_be_made_feasible_are_marked():
    evaluator = Bilevel(DFET(2, 1).transcribe(gust()), Propagate(), 1e-6)
    start = evaluator.nlp.propagate(evaluator.first_guess(np.zeros((1, len(evaluator.free)))))
    flat = evaluator.descend(start, np.full((1, 1), 0.0), np.ones((1, 1)))
    assert flat.status[0] == "converged"
    Z, feasible, _ = back_off(evaluator, flat.Z, np.ones(1), VERIFY)
    assert feasible.shape == (1,) and not feasible[0] and evaluator.nlp.evaluate(Z)[1][0] <= 1e-6
    none, feasible, moved = back_off(evaluator, flat.Z[:0], np.ones(1), VERIFY)
    assert len(none) == len(feasible) == len(moved) == 0


def test_an_interruption_leaves_what_feasible(rough, monkeypatch):
    refine = Bilevel._descend

    def interrupted(self, starts, references, weights, margins):
        found = refine(self, starts, references, weights, margins)
        if margins is not None:
            signal.raise_signal(signal.SIGINT)
        return found

    monkeypatch.setattr(Bilevel, "_descend", interrupted)
    found = rough.polished(COARSE, solves=30, verify=VERIFY)
    assert found.stats["stopped"] == "interrupted" and len(found)
    assert found.simulate(tolerance=VERIFY).violation.max() <= VERIFY


def test_the_message_of_a_front_without_feasible_points():
    front = MACS(archive=1, mesh="fixed").solve(gust(), DFET(2, 1), evaluations=40, seed=1)
    assert len(front)
    empty = front.polished(DFET(2, 1), solves=2, verify=VERIFY)
    assert not len(empty) and empty.message == "no point violates less than 0.0001 when simulated"
    assert "0.0001" in empty.table() and len(front.polished(DFET(2, 1), solves=2, verify=1.0))


class TestOfASearch:
    """MACS searches on one transcription and polishes on another."""

    @pytest.mark.slow
    def test_it_is_the_polished_front_of_the_search(self, rough):
        solver = MACS(polish_on="dfet:3x3", polish_every=20)
        found = solver.solve(bryson_denham(), SHOOTING, evaluations=400, seed=1, inner="projection", verify=VERIFY)
        expected = rough.polished(COARSE, solves=20, limit=10, verify=VERIFY)
        assert np.array_equal(found.F, expected.F) and found.stats["gradient_solves"] == expected.stats["gradient_solves"]
        assert np.array_equal(found.verified, expected.verified) and found.was_simulated.all()
        assert found.solver["settings"]["polish_on"] == "dfet:3x3" and found.stats["evaluations"] == 400

    @pytest.mark.slow
    def test_a_finished_checkpoint_is_polished_again(self, tmp_path):
        solver = MACS(polish_on="dfet:3x3", polish_every=40)
        problem, kept = bryson_denham(), tmp_path / "kept"
        first, again = (solver.solve(problem, SHOOTING, evaluations=400, seed=1, checkpoint=kept) for _ in range(2))
        assert np.array_equal(first.F, again.F) and any(point.transcription == COARSE.to_dict() for point in again)

    @pytest.mark.parametrize(
        ("settings", "words"),
        [
            ({"polish_on": "dfet"}, "polish_on: unknown transcription 'dfet'"),
            ({"polish_on": COARSE}, "polish_on must be a word"),
            ({"polish_on": "dfet:3x3", "refine": False}, "refine=False"),
            ({"polish_on": "dfet:3x3", "mesh": "adaptive"}, "mesh='adaptive'"),
        ],
    )
    def test_what_makes_no_sense_is_refused(self, settings, words):
        with pytest.raises(ValueError, match=words):
            MACS(**settings)

    def test_a_peak_that_gradients_refuse_is_an_error_before_any_work(self):
        problem = bryson_denham()
        problem.maximize("fastest", problem.phases["flight"].peak(problem.phases["flight"]["v"]))
        with pytest.raises(ValueError, match="peak"):
            MACS(polish_on="dfet:3x3").solve(problem, SHOOTING, evaluations=10**9, seed=1)
