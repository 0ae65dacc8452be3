"""Fronts under changed data and dispersions: what reports say and draw where everything is known, and what is refused."""

import csv
from pathlib import Path

import numpy as np
import pytest
from misbehaving import Plain, glide
from test_study import Inline

from macs import Front
from problems import Problem
from problems.cases.aerocapture import coupled
from runs import Study
from runs.batch.store import Store
from runs.report import sensitivity
from runs.report.comparison import comparisons
from runs.report.report import report
from runs.report.sensitivity import SIMULATED_POINTS, ChangedData, DispersedFront, changed_data, dispersed_fronts

CART = '''
from problems import Problem


def cart(mass=2.0, limit=50.0):
    """v' = u / mass from rest: with the same thrust, distance and speed go as 1 / mass."""
    problem = Problem("cart")
    phase = problem.phase("run", t0=0.0, tf=4.0)
    x = phase.state("x", bounds=(0, 100), initial=0, unit="m")
    v = phase.state("v", bounds=(0, 50), initial=0, unit="m/s")
    u = phase.control("u", bounds=(0, 2), unit="N")
    phase.dynamics(x=v, v=u / mass)
    phase.path("speed limit", v, upper=limit, scale=1.0)
    problem.maximize("distance", phase.final(x), unit="m")
    problem.minimize("effort", phase.integral(u), unit="N s")
    return problem
'''
STUDY = """
transcriptions = ["shooting:5"]
evaluations = 120
runs = 2
seed = 1
inner = "propagate"
nominal = "light"
verify = false

[problems]
heavy = {problem = "cart.py:cart", mass = 4.0}
light = "cart.py:cart"
limited = {problem = "cart.py:cart", limit = 1.5}

[solvers.nsga2]
solver = "nsga2"
population = 12
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Two runs under each of three data."""
    place = tmp_path_factory.mktemp("carts")
    (place / "cart.py").write_text(CART, encoding="utf-8")
    (place / "carts.toml").write_text(STUDY, encoding="utf-8")
    Study.load(place / "carts.toml", trust=True).run(place / "out", executor=Inline())
    return place / "out"


@pytest.fixture(scope="module")
def changed(folder) -> ChangedData:
    (found,) = changed_data(comparisons(Store.open(folder, trust=True), {}), {"nominal": "light"})
    return found


def union(folder: Path, problem: str) -> Front:
    return Front.merge([run.front for run in Store.open(folder, trust=True).runs() if run.cell.problem == problem])


def rows(changed: ChangedData, name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(changed.tables()[name].csv().splitlines()))


@pytest.mark.slow
def test_shifts_of_the_same_flights_and_the_best_of_each_front(folder, changed):
    light = union(folder, "light")
    assert 5 < len(light) <= SIMULATED_POINTS
    speeds = np.array([point.trajectory["run"]["v"][-1] for point in light])
    distances = light.objectives[:, 0]
    told = {row["data"]: row for row in rows(changed, "changed-data")}
    assert [*told] == ["light", "heavy", "limited"]
    assert {row["points"] for row in told.values()} == {str(len(light))}
    assert told["light"]["feasible"] == told["heavy"]["feasible"] == str(len(light))
    # The limit's scale is 1 m/s, of which 1 % is allowed.
    assert told["limited"]["feasible"] == str(np.sum(speeds <= 1.51)) and 0 < np.sum(speeds <= 1.51) < len(light)
    assert told["light"]["distance: mean shift [m]"] == ""
    assert float(told["heavy"]["distance: mean shift [m]"]) == pytest.approx(-0.5 * distances.mean(), rel=1e-5)
    assert float(told["heavy"]["distance: largest [m]"]) == pytest.approx(-0.5 * distances.max(), rel=1e-5)
    assert float(told["heavy"]["effort: mean shift [N s]"]) == pytest.approx(0, abs=1e-6)
    assert float(told["limited"]["distance: mean shift [m]"]) == 0
    assert "The front of light under changed data." in str(report(folder, trust=True, figures=False))
    best = {row["optimised under"]: row for row in rows(changed, "changed-data-best")}
    for problem in ("light", "heavy", "limited"):
        front = union(folder, problem)
        assert int(best[problem]["points"]) == len(front)
        assert float(best[problem]["distance [m]"]) == front.objectives[:, 0].max()
        assert float(best[problem]["effort [N s]"]) == front.objectives[:, 1].min()


def test_a_panel_for_each_data(folder, changed):
    light = union(folder, "light")
    ((name, figure),) = changed.figures().items()
    assert name == "changed-data-shooting:5-nsga2" and [ax.get_title("left") for ax in figure.axes] == ["heavy", "limited"]
    for ax, share in zip(figure.axes, (0.5, 1.0), strict=True):
        lines = {line.get_label(): line.get_xydata() for line in ax.lines}
        np.testing.assert_allclose(lines["nominal front"], light.objectives, rtol=1e-5)
        there = np.vstack([lines["simulated under these data"], lines["those not feasible"]])
        np.testing.assert_allclose(np.sort(there[:, 0]), np.sort(share * light.objectives[:, 0]), rtol=1e-5)
        problem = ax.get_title("left")
        np.testing.assert_allclose(np.sort(lines["found under these data"], axis=0), np.sort(union(folder, problem).objectives, axis=0))


@pytest.mark.slow
def test_without_a_feasible_nominal_point_or_its_problem_the_table_says_so(tmp_path):
    def stated(least: float) -> Problem:
        problem = glide()
        problem.constraint("far", problem.phases["leg"].final(problem.phases["leg"]["x"]), lower=least)
        return problem

    def told(**problems: Problem) -> str:
        study = Study("gliders", problems=problems, solvers=Plain(), evaluations=20, runs=1, seed=1, nominal="one")
        out = tmp_path / "-".join(problems)
        study.run(out, executor=Inline())
        (found,) = changed_data(comparisons(Store.open(out, trust=True), {}), {"nominal": "one"})
        assert found.figures() == {}
        return found.tables()["changed-data"].text()

    assert "nothing feasible was found under the nominal data" in told(one=stated(19.0), two=stated(1.0))
    assert "nothing was simulated: problem 'glide' was stated in a script" in told(one=stated(1.0), three=stated(2.0))


@pytest.mark.parametrize(
    ("problems", "nominal", "words"),
    [
        ({"slow": glide(), "fast": glide(4.0)}, "fats", "nominal: unknown problem 'fats', did you mean fast?"),
        ({"slow": glide()}, "slow", "nominal: 'slow' is the only problem"),
    ],
)
def test_wrong_nominal_problems_are_one_line_when_the_study_is_made(problems, nominal, words):
    with pytest.raises(ValueError) as error:
        Study("gliders", problems=problems, solvers=Plain(), evaluations=40, runs=1, seed=1, nominal=nominal)
    assert words in str(error.value) and "\n" not in str(error.value)


GIVEN = {"cases": 25, "seed": 4, "density": 0.05}


def study(**changed) -> Study:
    stated = {
        "problems": ["aerocapture"],
        "solvers": {"search": {"solver": "nsga2", "population": 12}},
        "dispersions": GIVEN,
        "flights": False,
    }
    return Study("dispersed", evaluations=240, runs=2, seed=1, **(stated | changed))


@pytest.fixture(scope="module", autouse=True)
def few():
    """Three points of each front."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sensitivity, "DISPERSED_POINTS", 3)
        yield


@pytest.fixture(scope="module")
def flown_folder(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("dispersed") / "out"
    study().run(out, executor=Inline())
    return out


@pytest.fixture(scope="module")
def found(flown_folder) -> DispersedFront:
    (one,) = dispersed_fronts(comparisons(Store.open(flown_folder), {}), {"dispersions": GIVEN})
    return one


@pytest.mark.slow
def test_each_point_is_flown_as_the_case_says(found):
    settings = coupled.Dispersions(**GIVEN)
    assert found.settings == settings and settings.entry_angle == 0.1
    again = coupled.dispersed(found.points, settings)
    for way in ("nominal", "bank as it is", "bank solved anew"):
        assert [*found.measures[way]] == [one[way].measures() for one in again]
    nominal = [one["TPS mass fraction, P99", "%"] for one in found.measures["nominal"]]
    np.testing.assert_allclose(nominal, found.points.objectives[:, 1], rtol=1e-6)
    assert all(one["captured", "%"] > 90.0 for one in found.measures["bank solved anew"])
    assert all(0.0 < one["captured", "%"] < 60.0 for one in found.measures["bank as it is"])


@pytest.mark.slow
def test_tables_of_the_report(flown_folder, found):
    made = report(flown_folder, figures=False)
    table = next(path for path in made.files if path.name.endswith("dispersed-bank-as-it-is.csv"))
    rows = list(csv.reader(table.open(encoding="utf-8")))
    assert len(rows) == 1 + len(found.points) == 4
    column = next(i for i, name in enumerate(rows[0]) if name.startswith("captured"))
    assert [float(row[column]) for row in rows[1:]] == [one["captured", "%"] for one in found.measures["bank as it is"]]
    shield = next(i for i, name in enumerate(rows[0]) if name.startswith("nominal TPS"))
    np.testing.assert_allclose([float(row[shield]) for row in rows[1:]], found.points.objectives[:, 1])
    assert "under dispersions, bank solved anew" in made.text and "by seed 4" in made.text
    assert dispersed_fronts(comparisons(Store.open(flown_folder), {}), {}) == []


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"problems": ["aerocapture", "welded_beam"]}, "dispersions: problem 'welded_beam': its case does not say"),
        ({"dispersions": {"wind": 1.0}}, "dispersions: problem 'aerocapture': .*unexpected keyword argument 'wind'"),
        ({"dispersions": {"cases": 0}}, "cases must be a whole number of at least 1"),
        ({"dispersions": 3}, "must be a table of settings"),
    ],
)
def test_what_is_refused_before_any_run(changed, words):
    with pytest.raises(ValueError, match=words):
        study(**changed)
