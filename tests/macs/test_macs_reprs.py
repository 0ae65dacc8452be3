"""What is printed is one line: settings as far as they differ from the defaults, data by their counts."""

from __future__ import annotations

import numpy as np
import pytest
from boxes import boxed

from macs import MACS, MOPSO, NSGA2
from macs.evaluation.evaluator import Counts
from macs.fronts.points import Points


def schaffer(X: np.ndarray) -> np.ndarray:
    return np.column_stack([X[:, 0] ** 2, (X[:, 0] - 2) ** 2])


def test_settings_are_shown_as_far_as_they_are_no_defaults() -> None:
    assert repr(MACS()) == "MACS()" and repr(MACS(agents=20)) == "MACS(agents=20)"
    assert repr(NSGA2(population=40, degree="sum")) == "NSGA2(population=40, degree='sum')"
    assert repr(MOPSO.paper()) == "MOPSO(particles=20, inertia=1.4, final_inertia=0.4, one_leader=True, settled=0.01)"


def test_a_search_shows_its_counts() -> None:
    box = boxed(schaffer, [(-4, 4)])
    state = MACS(agents=4).begin(box, 50, np.random.default_rng(0))
    counts = "0 iterations, 4 evaluations, 0 gradient solves"
    assert repr(state) == f"<SearchState: {counts}; {state.agents}, {state.archive}>"
    assert repr(state.agents) == "<Agents: 4, 4 with a direction>"
    assert repr(state.archive) == "<Archive: 2 points, 2 objectives>"
    assert repr(box.evaluate(np.array([[0.0], [np.nan]]))) == "<Evaluation: 2 points; 1 converged, 1 failed>"
    assert repr(box.counts) == "Counts(evaluations=6, failures=Counter({'failed': 1}))" and repr(Counts()) == "Counts()"


@pytest.mark.parametrize("solver", [NSGA2(population=10), MOPSO(particles=10)])
def test_a_population_shows_its_generation(solver) -> None:
    state = solver.begin(boxed(schaffer, [(-4, 4)]), 50, np.random.default_rng(0))
    assert repr(state).endswith(f"State: generation 1; <Members: 10 points, 2 objectives>, {state.archive}>")


def test_a_running_search_and_its_points_are_one_line() -> None:
    shown: list[str] = []
    front = MACS(agents=4).minimize(schaffer, [(-4, 4)], evaluations=60, seed=1, callback=lambda progress: shown.append(repr(progress)))
    assert shown[-1].startswith("<Progress: 60 / 60 evaluations, ") and "f1 " in shown[-1]
    assert repr(front).startswith(f"<Front: black box: {len(front)} points, MACS, 60 evaluations, seed 1, ")
    assert repr(Points.concatenate([front])) == f"<Points: black box: {len(front)} points, 2 objectives>"
    assert repr(front[1]).startswith("<Point 1: f1 ") and repr(front[1]).endswith("; violation 0.0e+00, converged>")
    assert all("\n" not in text for text in (*shown, repr(front), repr(front[1])))
