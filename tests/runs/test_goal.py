"""StatedGoal attainment: the formula, its history over runs, and what reports show of it."""

import csv
from pathlib import Path

import numpy as np
import pytest
from misbehaving import Plain, glide

from macs import Front
from problems.compiled import Objective
from runs import Study
from runs.batch.cells import Cell
from runs.batch.store import StoredRun
from runs.report.comparison import Comparison
from runs.report.goal import GoalAttainment, StatedGoal, goal_attainments

GOALS = (Objective("cost", unit="kg"), Objective("range", unit="km", sense="maximize"))
COST = {"objective": "cost", "best": 2.0, "worst": 10.0}
RANGE = {"objective": "range", "best": 50.0, "worst": 0.0, "shares": [0.5, 1.0]}
COUNTS = [10, 20, 30]


def run(number: int, *F, transcription: str = "coarse", seconds: float = 1.0) -> StoredRun:
    """One whose archive was F at `COUNTS`."""
    cell = Cell("p", transcription, "s", 30, {})
    history = {"evaluations": COUNTS[: len(F)], "F": [list(map(list, rows)) for rows in F]}
    return StoredRun(
        cell, number, 0, "finished", message="", traceback="", wall_time=seconds, history=history, simulated={}, path=Path(f"{number}.nc")
    )


def comparison(*runs: StoredRun, failed: int = 0, transcription: str = "coarse") -> Comparison:
    front = Front(F=[], decision=[], violation=[], status=[], goals=GOALS)
    return Comparison("p", transcription, {"s": runs}, {"s": [front] * len(runs)}, {}, {"s": failed}, {"s": 0})


RUNS = (
    run(1, [(10, -10)], [(6, -10), (8, -30)], [(3, -50)], seconds=1.0),
    run(2, [], [(4, -20)], [(4, -20), (2, 0)], seconds=2.0),
    run(3, [(4, -5)], [(6, -40)], [], seconds=9.0),
)
"""Of costs, best so far: 10, 6, 3; nothing, 4, 2; 4, 4, 4."""


def rows(found: GoalAttainment) -> list[dict[str, str]]:
    (one,) = found.tables().values()
    return list(csv.DictReader(one.csv().splitlines()))


def test_of_the_best_so_far_from_the_first_feasible_point_on():
    found = [StatedGoal(**COST).history(one, GOALS) for one in RUNS]
    for x, _ in found:
        np.testing.assert_array_equal(x, COUNTS)
    np.testing.assert_allclose([y for _, y in found], [[0, 0.5, 0.875], [np.nan, 0.75, 1.0], [0.75, 0.75, 0.75]])
    _, y = StatedGoal(**RANGE).history(RUNS[0], GOALS)
    np.testing.assert_allclose(y, [0.2, 0.6, 1.0])


def test_the_table_says_what_the_median_run_attained_and_when_and_failed_runs_attain_nothing():
    (found,) = goal_attainments([comparison(*RUNS)], {"goal": COST})
    (row,) = rows(found)
    assert (row["transcription"], row["solver"], row["runs"]) == ("coarse", "s", "3")
    # In the end 0.75, 0.875 and 1; quartiles are linear between them. Medians are 0, 0.75 and 0.875.
    assert [float(row[key]) for key in ("median attained", "lower quartile", "upper quartile")] == [0.875, 0.8125, 0.9375]
    assert (row["evaluations to 0.9"], row["evaluations to 0.95"], row["time of a run [s]"]) == ("", "", "2.0")
    (found,) = goal_attainments([comparison(*RUNS)], {"goal": COST | {"shares": [0.0001, 0.75, 0.8]}})
    (row,) = rows(found)
    assert [row[f"evaluations to {share}"] for share in ("0.0001", "0.75", "0.8")] == ["20", "20", "30"]
    (found,) = goal_attainments([comparison(*RUNS, failed=3)], {"goal": COST})
    (row,) = rows(found)
    assert row["runs"] == "6" and row["median attained"] == "" and row["upper quartile"] != "" and row["lower quartile"] == ""
    (found,) = goal_attainments([comparison(*RUNS, failed=2)], {"goal": COST})
    assert float(rows(found)[0]["median attained"]) == 0.75
    beside = Comparison("p", "coarse", {"t": (), "s": RUNS}, {"t": [], "s": comparison(*RUNS).every}, {}, {"t": 2}, {})
    (found,) = goal_attainments([beside], {"goal": COST})
    assert [(row["runs"], row["median attained"], row["time of a run [s]"]) for row in rows(found)] == [
        ("2", "", ""),
        ("3", "0.875", "2.0"),
    ]
    other = Comparison("q", "coarse", {"s": RUNS[:1]}, {"s": [comparison(*RUNS).known]}, {}, {}, {"s": 0})
    found = goal_attainments([comparison(*RUNS), other], {"goal": COST})
    assert [one.problem for one in found] == ["p", "q"]
    assert goal_attainments([comparison(*RUNS)], {}) == []
    assert goal_attainments([comparison(run(1))], {"goal": COST}) == []


def test_studies_that_verify_also_have_the_attainment_as_simulated():
    def points(*costs: float) -> Front:
        n = len(costs)
        F = [[cost, 0.0] for cost in costs]
        return Front(F=F, decision=[np.empty(0)] * n, violation=[0.0] * n, status=["converged"] * n, goals=GOALS)

    for fronts, median in (([points(8.0, 6.0), points(), points(10.0)], "0.0"), ([points(8.0), points(), points()], "")):
        here = Comparison("p", "coarse", {"s": RUNS}, {"s": fronts}, {}, {"s": 0}, {"s": 0})
        (found,) = goal_attainments([here], {"goal": COST, "verify": 0.01})
        assert [row["median, simulated"] for row in rows(found)] == [median]
        assert "feasible when simulated" in str(found.tables())
    (found,) = goal_attainments([here], {"goal": COST})
    assert "median, simulated" not in rows(found)[0]


def test_a_line_for_each_transcription_from_where_the_median_run_has_something():
    late = [run(k, [], [(6, 0)], [(4, 0)], transcription="fine") for k in (1, 2, 3)]
    (found,) = goal_attainments([comparison(*RUNS), comparison(*late, transcription="fine")], {"goal": COST})
    ((name, figure),) = found.figures().items()
    (ax,) = figure.axes
    assert name == "p-goal-attainment" and ax.get_xlabel() == "evaluations" and "goal attainment of cost" in ax.get_ylabel()
    lines = {line.get_label(): line.get_xydata() for line in ax.lines}
    assert set(lines) == {"coarse, 3 runs", "fine, 3 runs"}
    np.testing.assert_allclose(lines["coarse, 3 runs"], [[10, 0], [20, 0.75], [30, 0.875], [30, 0.875]])
    np.testing.assert_allclose(lines["fine, 3 runs"], [[10, np.nan], [20, 0.5], [30, 0.75], [30, 0.75]])


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ({"objective": "distance", "best": 1.0}, "goal: worst is missing"),
        ({**RANGE, "objective": "distanse"}, "goal: problem 'glide': unknown objective 'distanse', did you mean distance?"),
        ({**RANGE, "objective": "distance", "best": 0.0}, "best and worst of 'distance' are both 0"),
        ({**RANGE, "objective": "distance", "best": -5.0}, "'distance' is to maximize, so best must be more than worst, not -5 beside 0"),
        ({**RANGE, "objective": "time"}, "'time' is to minimize, so best must be less than worst"),
        ({**RANGE, "objective": "distance", "shares": [0.5, 1.5]}, "goal: shares 2 must be a number above 0 and at most 1, not 1.5"),
    ],
)
def test_wrong_goals_are_one_line_when_the_study_is_made(goal, words):
    with pytest.raises(ValueError) as error:
        Study("gliders", problems=glide(), solvers=Plain(), evaluations=60, runs=1, seed=1, goal=goal)
    assert words in str(error.value) and "\n" not in str(error.value)
