"""satisfy: kappa is not positive at the end, every step is in the history, and the order is imposed where lambda does not do."""

import numpy as np
import pytest
from rest_to_rest import DIAGONAL, MESH, RANGES, WIDE_E, WIDE_T, balanced, both, cart, ends
from scipy.optimize import brentq

from macs.decisions import FuzzySatisfactory, Ranges, satisfy
from problems import load
from transcription import DFET


@pytest.mark.slow
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


def test_nothing_is_raised_where_the_order_is_kept_at_once_or_a_limit_from_the_first() -> None:
    choice = satisfy(cart(), FuzzySatisfactory({}, ["effort", "time"]), ranges=RANGES, start=ends())
    assert len(choice.history) == 1 and choice.history[0].about["kappa"] < 0
    assert "kappa" in choice.table() and "lambda" in choice.table()
    choice = satisfy(cart(), MESH, FuzzySatisfactory({}, ["time", "effort"], 0.0, ordered=True), ranges=RANGES, start=ends())
    assert len(choice.history) == 1 and choice.objectives["time"] == pytest.approx(DIAGONAL, rel=1e-6)


STEEP = Ranges({"effort": -1e4, "time": 0.5}, {"effort": 96.0, "time": 4.03})
"""Ranges in which a whole second is worth next to no effort: lambda would have to be within 1e-4 of 1/2 until the effort comes first."""


@pytest.mark.slow
def test_the_order_is_imposed_where_lambda_does_not_do() -> None:
    choice = satisfy(cart(), MESH, FuzzySatisfactory({}, ["effort", "time"]), ranges=STEEP, start=ends())
    T = brentq(lambda T: (12 / T**3 + 1e4) / 10_096 - (T - 0.5) / 3.53, 0.5, 4.0, xtol=1e-12)
    assert choice.objectives["time"] == pytest.approx(T, abs=1e-5)
    *raised, imposed = choice.history
    assert all(step.about["kappa"] > 0 for step in raised) and imposed.about["kappa"] <= 0.0
    assert [step.about["lambda"] for step in raised] == sorted({step.about["lambda"] for step in raised})
    assert imposed.about["lambda"] == raised[-1].about["lambda"] < 0.5
    assert "imposed" in choice.message and choice.preference.ordered  # type: ignore[attr-defined]
    # On the front still, which a limit on the order need not leave.
    assert choice.point.optimality < 1e-6


@pytest.mark.slow
def test_an_order_that_no_point_keeps_is_named() -> None:
    # All efforts are in the worse half of their range, all times in the better tenth.
    ranges = Ranges({"effort": -100.0, "time": 0.5}, {"effort": 96.0, "time": 40.0})
    choice = satisfy(cart(), MESH, FuzzySatisfactory({}, ["effort", "time"]), ranges=ranges, start=ends())
    assert "no point was found that meets" in choice.message and "effort satisfied at least as time" in choice.message
    assert choice.history[-1].about["kappa"] > 0 and choice.objectives["time"] == pytest.approx(4.0, rel=1e-6)


@pytest.mark.slow
def test_goddard_keeps_both_orders() -> None:
    for order in (["flight time", "horizontal speed"], ["horizontal speed", "flight time"]):
        choice = satisfy(load("goddard"), DFET(4, 6), FuzzySatisfactory({}, order, 0.01))
        first, second = (choice.degrees[name] for name in order)
        assert choice.history[-1].about["kappa"] <= 0 and first >= second - 1e-9
        assert np.all(np.diff([step.about["lambda"] for step in choice.history]) > 0)
