"""decide: hard limits that cannot be met, and arguments that make no sense, each in one line."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rest_to_rest import MESH, RANGES, cart, ends
from smooth_problems import two_wells

from macs import MACS
from macs.decisions import (
    FuzzySatisfactory,
    Nimbus,
    PhysicalProgramming,
    Ranges,
    ReferencePoint,
    Smaller,
    WeightedSum,
    decide,
    satisfy,
)
from macs.decisions.solver import NO_OPTIMUM
from transcription.nlp import scalarized

TIME = WeightedSum({"time": 1.0})


def test_limits_that_cannot_be_met_together_are_named() -> None:
    # An effort of 11 takes (12 / 11)^(1/3) = 1.029.
    choice = decide(
        cart(), MESH, Nimbus({"effort": 10.0, "time": 1.0}, improve=["time"], until={"effort": 11.0}), ranges=RANGES, start=ends()
    )
    assert np.isinf(choice.value) and "\n" not in choice.message
    assert "time at most 1" in choice.message and "effort at most 11" in choice.message
    # The nearest exceeds both by the same part of their ranges.
    over = [(choice.objectives["time"] - 1.0) / 3.5, (choice.objectives["effort"] - 11.0) / (96 - 12 / 64)]
    assert over[0] == pytest.approx(over[1], rel=1e-4) and over[0] > 1e-3
    assert choice.history[0].value == pytest.approx(over[0], rel=1e-6)


def test_limits_that_no_known_point_meets_can_be_met() -> None:
    # Neither end of the front is within them.
    choice = decide(
        cart(), MESH, Nimbus({"effort": 10.0, "time": 1.1}, improve=["time"], until={"effort": 11.0}), ranges=RANGES, start=ends()
    )
    assert choice.message == "" and choice.objectives["effort"] == pytest.approx(11.0, rel=1e-6)
    assert [step.name for step in choice.history] == ["largest excess over hard limits", "achievement"]


BAD: list[tuple[Any, dict[str, Any], str]] = [
    ((lambda x: x, TIME), {}, "needs derivatives.*preference.rank"),
    ((cart(), MESH), {}, "preference must be a Preference"),
    ((cart(), 3, TIME), {}, "transcription must be a Transcription"),
    ((cart(), "dfet:4x6", TIME), {}, "transcription must be a Transcription.*parse makes one from a word"),
    ((cart(), MESH, TIME), {"start": 3}, "start must be a Front or a Point"),
    ((cart(), MESH, TIME), {"starts": 0}, "starts"),
    ((cart(), MESH, TIME), {"seed": -1}, "seed"),
    ((cart(), MESH, TIME), {"ranges": Ranges({"effort": 1.0}, {"effort": 2.0})}, "the ranges have no 'time'"),
    ((cart(), MESH, ReferencePoint({"time": 9.0})), {"ranges": RANGES}, "beyond its range"),
]


@pytest.mark.parametrize(("arguments", "more", "words"), BAD, ids=[one[2] for one in BAD])
def test_bad_arguments_are_one_line_before_any_work(arguments: Any, more: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        decide(*arguments, **more)
    assert "\n" not in str(caught.value)


def test_black_boxes_and_other_problems_are_refused() -> None:
    box = MACS().minimize(lambda X: np.stack([X[:, 0], 1 - X[:, 0]], axis=1), [(0.0, 1.0)] * 2, evaluations=60, seed=1)
    with pytest.raises(ValueError, match="black box"):
        decide(cart(), MESH, TIME, start=box)
    with pytest.raises(ValueError, match="needs derivatives"):
        decide(box, TIME)
    with pytest.raises(ValueError, match="another problem, 'cart'"):
        decide(two_wells(), MESH, WeightedSum({"from left": 1.0}), start=ends())
    with pytest.raises(ValueError, match="satisfy takes a FuzzySatisfactory"):
        satisfy(cart(), MESH, TIME)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_problem_without_a_feasible_point_says_what_is_violated() -> None:
    problem = two_wells()
    problem.constraint("beyond", problem.parameters["p"], lower=3.0)
    with pytest.raises(ValueError, match="no ranges; the nearest violates constraint 'beyond'"):
        decide(problem, MESH, WeightedSum({"from left": 1.0}))
    both = {"from left": 0.0, "from right": 0.0}, {"from left": 1.0, "from right": 1.0}
    choice = decide(problem, MESH, WeightedSum({"from left": 1.0}), ranges=Ranges(*both))
    assert choice.point.status != "converged" and choice.history[0].status != "converged"
    assert "the nearest violates constraint 'beyond'" in choice.message


@pytest.mark.slow
@pytest.mark.parametrize(("method", "words"), [(MESH, ""), (None, "no solve converged: ")], ids=["given", "found"])
def test_where_all_solves_fail_the_message_says_why(monkeypatch: pytest.MonkeyPatch, method: Any, words: str) -> None:
    """From the ends of the front, with boxes of a tenth of the bounds, solves do not reach what is asked for."""
    preference, known = ReferencePoint({"effort": 10.0, "time": 0.7}), ends()
    monkeypatch.setattr(scalarized, "_strategies", lambda *_: (scalarized.NEAR,))
    monkeypatch.setattr(scalarized, "SOLVE", replace(scalarized.SOLVE, restarts=0))
    choice = decide(cart(), method, preference, ranges=RANGES, start=known)
    assert choice.message == f"achievement: {words}{scalarized.IN_BOX}; {NO_OPTIMUM}"
    assert choice.history[0].status == "failed" and choice.history[0].message == f"{words}{scalarized.IN_BOX}"
    # Where they ended is feasible, and better than what was known.
    assert choice.point.status == "converged" and choice.point.verified and choice.point.optimality > 1e-6
    best = preference.rank(known, RANGES)
    assert choice.value < best.values[best.order[0]] - 1e-3 and NO_OPTIMUM in choice.point.note


@pytest.mark.parametrize(
    ("call", "preference"),
    [
        (decide, WeightedSum({"tyme": 1.0})),
        (decide, PhysicalProgramming({"tyme": Smaller(1, 2, 3, 4, 5)})),
        (decide, Nimbus({"effort": 10.0, "time": 1.0}, improve=["tyme"], free=["effort"])),
        (decide, ReferencePoint({"time": 1.0}, {"tyme": 2.0})),
        (satisfy, FuzzySatisfactory({}, ["effort", "tyme"])),
    ],
    ids=lambda one: type(one).__name__,
)
def test_names_are_checked_before_any_work(call, preference) -> None:
    # A payoff table, which would be first, ends at once.
    with pytest.raises(ValueError, match="unknown objective 'tyme'"):
        call(cart(), MESH, preference, time_limit=1e-9)
