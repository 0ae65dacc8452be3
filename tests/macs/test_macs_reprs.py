"""What is printed is one line: settings as far as they differ from the defaults, data by their counts."""

from __future__ import annotations

import numpy as np
from boxes import boxed

from macs import MACS, MOPSO, NSGA2
from macs.evaluation.evaluator import Counts
from macs.fronts.points import Points


def schaffer(X: np.ndarray) -> np.ndarray:
    return np.column_stack([X[:, 0] ** 2, (X[:, 0] - 2) ** 2])


def test_settings_data_and_counts_are_one_line() -> None:
    box, rng = boxed(schaffer, [(-4, 4)]), np.random.default_rng(0)
    state, population = MACS(agents=4).begin(box, 50, rng), NSGA2(population=10).begin(boxed(schaffer, [(-4, 4)]), 50, rng)
    shown: list[str] = []
    front = MACS(agents=4).minimize(schaffer, [(-4, 4)], evaluations=60, seed=1, callback=lambda progress: shown.append(repr(progress)))
    expected = {
        "MACS()": MACS(),
        "NSGA2(population=40, degree='sum')": NSGA2(population=40, degree="sum"),
        "MOPSO(particles=20, inertia=1.4, final_inertia=0.4, one_leader=True, settled=0.01)": MOPSO.paper(),
        f"<SearchState: 0 iterations, 4 evaluations, 0 gradient solves; {state.agents}, {state.archive}>": state,
        "<Agents: 4, 4 with a direction>": state.agents,
        "<Archive: 2 points, 2 objectives>": state.archive,
        f"State: generation 1; <Members: 10 points, 2 objectives>, {population.archive}>": population,
        "<Evaluation: 2 points; 1 converged, 1 failed>": box.evaluate(np.array([[0.0], [np.nan]])),
        "Counts(evaluations=6, failures=Counter({'failed': 1}))": box.counts,
        "Counts()": Counts(),
        f"<Points: black box: {len(front)} points, 2 objectives>": Points.concatenate([front]),
    }
    assert all(repr(what).endswith(text) for text, what in expected.items())
    assert shown[-1].startswith("<Progress: 60 / 60 evaluations, ") and repr(front[1]).endswith("; violation 0.0e+00, converged>")
    assert repr(front).startswith(f"<Front: black box: {len(front)} points, MACS, 60 evaluations, seed 1, ")
    assert all("\n" not in text for text in (*shown, repr(front), repr(front[1])))
