"""Studies of choices: their tables and pictures, and published degrees beside ours."""

import csv
from pathlib import Path

import numpy as np
import pytest
from misbehaving import glide
from test_study import Inline

from macs.decisions import FuzzyGoal, Ranges, decide
from runs import Study
from runs.batch.store import Store
from runs.report.choices import RunChoice
from runs.report.comparison import comparisons
from runs.report.published import papers

GOALS = {"method": "FuzzySatisfactory", "settings": {"targets": {}, "priorities": ["distance", "time"]}}
WIDE = {"method": "PhysicalProgramming", "settings": {"classes": {"time": {"class": "Smaller", "boundaries": [1, 2, 3, 4, 5]}}}}
CHOICES = {
    "solver": "decide",
    "choices": {
        "goals": {**GOALS, "vary": {"regulating": [0.0, 0.1, 0.2]}},
        "even": {"method": "FuzzyGoal", "settings": {"targets": {"time": 1.0, "distance": 15.0}}},
    },
}
ROW = {"problem": "glide", "by": "the paper"}
ROWS = [
    {**ROW, "statistic": "0.1", "terminal mass": 0.2695, "terminal speed": 0.3791},
    {**ROW, "statistic": "0.2", "terminal mass": 1.0, "terminal speed": 0.3011},
    {**ROW, "statistic": "0.3", "terminal mass": 1.0, "terminal speed": 0.2956},
]
"""Table 5 of Bae and others."""
PAPER = {"of": "degrees", "by": WIDE, "rows": [{**ROW, "statistic": "theirs", "time": 2.5}]}
SATISFIED = {"of": "degrees", "regulating": [0.1], "rows": [{**ROW, "statistic": "theirs", "distance": 0.5, "time": 0.5}]}


def study(**more) -> Study:
    given = {
        "problems": glide(),
        "solvers": {"choices": CHOICES},
        "evaluations": 60,
        "runs": 1,
        "seed": 1,
        "paper": [PAPER, SATISFIED],
        "flights": False,
    }
    return Study("chosen", **given | more)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("chosen") / "out"
    assert study().run(out, executor=Inline()).finished == 1
    return out


@pytest.fixture(scope="module")
def told(folder) -> str:
    return str(study().report(folder, figures=False))


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_every_choice_has_a_row_and_stands_beside_published_degrees_and_eq_53(folder, told):
    rows = rows_of(folder / "report" / "glide-dfet-2x2-choices.csv")
    assert [row["choice"] for row in rows] == ["goals, regulating 0", "goals, regulating 0.1", "goals, regulating 0.2", "even"]
    # The front is the line distance = 3 time, from 1 to 5 s: in the middle, both memberships are a half.
    assert [float(rows[3][name]) for name in ("time [s]", "degree of distance")] == pytest.approx([3.0, 0.5], abs=1e-4)
    # With lambda > 0, every point but the end of the first objective is worse.
    assert [float(row["distance [km]"]) for row in rows[1:3]] == pytest.approx([15.0, 15.0], rel=1e-4)
    assert all(row["verified"] == "yes" for row in rows)
    rows = rows_of(folder / "report" / "published-1.csv")
    assert rows[0]["by"] == "the paper" and float(rows[0]["time [degree]"]) == 2.5
    even = next(row for row in rows if row["choice"] == "even")
    assert float(even["time [degree]"]) == pytest.approx(3.0, abs=1e-4)
    rows = rows_of(folder / "report" / "published-2.csv")
    assert [row["choice"] for row in rows[:2]] == ["theirs", "goals, regulating 0"]
    # At the middle of the line both memberships are a half; the end of the first objective has 1 and 0.
    assert [float(row["(53) at 0.1"]) for row in rows if row["choice"] in ("theirs", "even")] == pytest.approx([0.5, 0.5], abs=1e-4)
    end = next(row for row in rows if row["choice"] == "goals, regulating 0.2")
    assert float(end["kappa"]) == pytest.approx(-1.0, abs=1e-4) and float(end["(53) at 0.1"]) == pytest.approx(0.4, abs=1e-4)


@pytest.mark.slow
def test_what_compares_fronts_is_left_out_and_pictures_are_drawn(folder):
    study().report(folder)
    names = {path.name for path in (folder / "report").iterdir()}
    assert not any("indicators" in name or "attainment" in name for name in names)
    for figure in ("degrees-choices", "flights-choices", "lambda-choices-1"):
        assert (folder / "report" / f"glide-dfet-2x2-{figure}.png").read_bytes().startswith(b"\x89PNG")


def test_trade_offs_beside_published_ones_are_in_ranges_and_positive_where_both_get_better(folder):
    row = {**ROW, "statistic": "time", "time": 1.0, "distance": -0.5}
    (paper,) = papers([{"of": "trade-offs", "choice": "even", "rows": [row]}])
    goal = FuzzyGoal({"time": 1.0, "distance": 15.0})
    choice = decide(glide(), goal)
    ranges = Ranges({"time": 1.0, "distance": 15.0}, {"time": 5.0, "distance": 9.0})
    found = paper.gains(RunChoice("choices", "even", choice.point, np.array([3.0, 9.0]), goal, ranges, [], ""))
    # A second less costs 3 km: a quarter of the range of times, a half of that of distances.
    assert [one["statistic"] for one in found] == ["time", "distance"]
    assert [one[name] for one in found for name in ("time", "distance")] == pytest.approx([1.0, -2.0, -0.5, 1.0], rel=1e-3)
    (comparison,) = comparisons(Store.open(folder), {})
    assert paper.ours(comparison, "choices") == [], "the folder does not have the problem"
    assert "no trade-off matrix" in paper.remark(comparison).lower()


def test_eq_53_at_the_printed_memberships():
    (paper,) = papers([{"of": "degrees", "regulating": [0.1, 0.2], "rows": ROWS}])
    found = [paper.completed(row) for row in paper.rows]
    # By hand: (d_1 + d_2) / 2 + lambda (d_1 - d_2).
    assert found[0]["kappa"] == pytest.approx(0.7305 - 0.6209)
    assert found[0]["(53) at 0.1"] == pytest.approx(0.5 * (0.7305 + 0.6209) + 0.1 * (0.7305 - 0.6209))
    assert found[1]["(53) at 0.2"] == pytest.approx((0.5 - 0.2) * 0.6989)
    # The row of 0.2 is better than both others for each lambda below a half.
    for weight in np.linspace(0.0, 0.49, 8):
        (one,) = papers([{"of": "degrees", "regulating": [float(weight)], "rows": ROWS}])
        values = [one.completed(row)[f"(53) at {weight:g}"] for row in one.rows]
        assert np.argmin(values) == 1 and f"at '0.2': {values[1]:.4g}" in " ".join(one.optima())


@pytest.mark.parametrize(
    ("paper", "words"),
    [
        ({**PAPER, "by": {"method": "Wish"}}, "by: unknown preference 'Wish'"),
        ({**PAPER, "rows": [{**ROW, "statistic": "a", "speed": 1.0}]}, "unknown objective 'speed'"),
        ({**PAPER, "rows": [{**ROW, "time": 1.0}]}, "statistic must be a text"),
        ({**PAPER, "regulating": [0.1]}, "regulating: priorities must have at least two levels"),
        ({**SATISFIED, "regulating": [-0.1]}, "regulating: regulating must"),
        ({**PAPER, "by": {"method": "WeightedSum", "settings": {"weights": {"speed": 1.0}}}, "rows": PAPER["rows"]}, "speed"),
    ],
)
def test_published_degrees_that_make_no_sense_are_refused_at_once(paper, words):
    with pytest.raises(ValueError, match=r"\[\[paper\]\] 1, of degrees") as error:
        study(paper=[paper])
    assert words in str(error.value)
