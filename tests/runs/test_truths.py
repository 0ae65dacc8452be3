"""How the reference fronts of the re-entry are made: what is said when gradients do not find where they lie. Making them takes long."""

from __future__ import annotations

import io
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from macs.evaluation.evaluator import CONVERGED, INFEASIBLE
from macs.io.console import Steps
from runs.truths import reentry as truths
from runs.truths.reentry import Truth, Unsolved
from transcription.nlp.scalarized import Solved

NAMES = ("cross-range", "heat load", "oscillation", "peak heating rate")


def solved(F, status: str = CONVERGED) -> Solved:
    return Solved(np.zeros(3), np.array(F, dtype=float), 0.0 if status == CONVERGED else 0.25, status, 7)


def truth(*outcomes: Solved) -> Truth:
    """One that knows two flights, and whose solves end so."""
    made = Truth.__new__(Truth)
    left = list(outcomes)
    made.case = SimpleNamespace(goals=[SimpleNamespace(name=name) for name in NAMES])
    made.descents = SimpleNamespace(from_vector=lambda *_: left.pop(0))
    made.found = [solved([-30, 100, 1, 150]), solved([-20, 60, 0.5, 120])]
    return made


def ends(one: Truth, ceiling=(np.inf,) * 4) -> np.ndarray:
    return one.ends(Steps("ends", 4, io.StringIO()), np.array(ceiling))


def test_ends_are_the_best_of_each_objective():
    best = [[-34, 140, 1.4, 150], [-10, 40, 0.9, 140], [-8, 70, 0.1, 130], [-9, 80, 0.6, 80]]
    # What comes second improves the others, or fails, and then the first counts.
    second = [solved([-34, 130, 1.3, 149]), *(solved([0, 0, 0, 0], INFEASIBLE) for _ in best[1:])]
    found = ends(truth(*(one for pair in zip(map(solved, best), second, strict=True) for one in pair)))
    assert found.tolist() == [[-34, 130, 1.3, 149], *best[1:]]


@pytest.mark.parametrize(
    ("ceiling", "words"), [((np.inf,) * 4, "'heat load' was"), ((-28.5, 150, 1.5, 200), "'heat load' within [-28.5, 150")]
)
def test_an_end_that_is_not_found_is_told(ceiling, words):
    good = solved([-34, 140, 1.4, 150])
    with pytest.raises(Unsolved) as told:
        ends(truth(good, good, solved([-5, 20, 0.9, 140], INFEASIBLE)), ceiling)
    message = str(told.value)
    assert words in message and "ended as 'infeasible', with a violation of 2.5e-01" in message and "the 4 flights known" in message


def test_nothing_to_begin_with_is_told():
    one = truth()
    one.found.clear()
    with pytest.raises(Unsolved, match="there is nothing to begin with"):
        ends(one)


def test_the_command_writes_no_table_then(tmp_path, monkeypatch):
    def unsolved(case: str, points: int) -> np.ndarray:
        raise Unsolved("the best 'oscillation' was not found")

    monkeypatch.setattr(truths, "made", unsolved)
    monkeypatch.setattr(sys, "argv", ["truths", "reentry_case2", "--out", str(tmp_path / "table.csv")])
    with pytest.raises(SystemExit, match=r"^reentry_case2: the best 'oscillation' was not found; no table was written$"):
        truths.main()
    assert not list(tmp_path.iterdir())
