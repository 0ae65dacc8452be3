"""satisfy: kappa is not positive at the end, every step is in the history, and the order is imposed where lambda does not do."""

from __future__ import annotations

import numpy as np
import pytest
from test_decide import DIAGONAL, MESH, RANGES, WIDE_E, WIDE_T, balanced, both, cart, ends

from macs.decisions import FuzzySatisfactory, satisfy
from problems import Problem, load
from transcription import DFET


def test_lambda_is_raised_until_the_order_is_kept() -> None:
    choice = satisfy(cart(), MESH, FuzzySatisfactory({}, ["time", "effort"], 0.02), ranges=RANGES, start=ends())
    assert [step.about["lambda"] for step in choice.history] == pytest.approx([0.02, 0.04, 0.08, 0.16][: len(choice.history)])
    for step in choice.history:
        # For two goals: (1/2 + lambda) d_1 + (1/2 - lambda) d_2.
        weight = step.about["lambda"]
        T = balanced((0.5 - weight) / WIDE_E, (0.5 + weight) / WIDE_T)
        assert step.objectives["time"] == pytest.approx(T, rel=1e-6)
        assert step.about["kappa"] == pytest.approx(both(T)[1] - both(T)[0], abs=1e-6)
    assert all(step.about["kappa"] > 0 for step in choice.history[:-1]) and choice.history[-1].about["kappa"] <= 0
    assert choice.message == "" and choice.preference == FuzzySatisfactory({}, ["time", "effort"], choice.history[-1].about["lambda"])


def test_nothing_is_raised_where_the_order_is_kept_at_once() -> None:
    choice = satisfy(cart(), FuzzySatisfactory({}, ["effort", "time"]), ranges=RANGES, start=ends())
    assert len(choice.history) == 1 and choice.history[0].about["kappa"] < 0
    assert "kappa" in choice.table() and "lambda" in choice.table()


def hollow() -> Problem:
    """A front that bows inward, f_1^4 + f_2^4 = 1: its weighted sums are least at its ends."""
    problem = Problem("hollow")
    phase = problem.phase("wait", t0=0, tf=1)
    phase.state("x", bounds=(-1, 1), initial=0)
    phase.dynamics(x=0)
    p = problem.parameter("p", bounds=(0.0, 1.0))
    q = problem.parameter("q", bounds=(0.0, 1.0))
    problem.constraint("outside", p**4 + q**4, lower=1.0)
    problem.minimize("first", p)
    problem.minimize("second", q)
    return problem


@pytest.mark.parametrize("order", [("first", "second"), ("second", "first")])
def test_the_order_is_imposed_where_lambda_jumps_past_it(order: tuple[str, str]) -> None:
    # Equal memberships are at 2^(-1/4) each; below lambda = 1/2 the sum is least at an end, if not at the wrong one.
    start = satisfy(hollow(), MESH, FuzzySatisfactory({}, order), seed=3)
    assert start.history[-1].about["kappa"] <= 0.0
    imposed = satisfy(hollow(), MESH, FuzzySatisfactory({order[0]: 0.9}, order, 0.0), seed=3)
    assert imposed.history[-1].about["kappa"] <= 0.0


def test_an_order_that_is_a_limit_from_the_first() -> None:
    choice = satisfy(cart(), MESH, FuzzySatisfactory({}, ["time", "effort"], 0.0, ordered=True), ranges=RANGES, start=ends())
    assert len(choice.history) == 1 and choice.objectives["time"] == pytest.approx(DIAGONAL, rel=1e-6)


def test_goddard_keeps_both_orders() -> None:
    for order in (["flight time", "horizontal speed"], ["horizontal speed", "flight time"]):
        choice = satisfy(load("goddard"), DFET(4, 6), FuzzySatisfactory({}, order, 0.01))
        first, second = (choice.degrees[name] for name in order)
        assert choice.history[-1].about["kappa"] <= 0 and first >= second - 1e-9
        assert np.all(np.diff([step.about["lambda"] for step in choice.history]) > 0)
