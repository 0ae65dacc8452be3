"""Fronts under changed data: what reports say and draw of a problem in which everything is known, and what is refused."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from misbehaving import Plain, glide
from test_study import Inline

from macs import NSGA2, Front
from problems import Problem
from runs import Study
from runs.batch.store import Store
from runs.report.comparison import comparisons
from runs.report.report import report
from runs.report.sensitivity import LOOKS, SIMULATED_POINTS, ChangedData, changed_data, changed_figure

CART = '''
from problems import Problem


def cart(mass=2.0, limit=50.0, weighed=False):
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
    if weighed:
        problem.minimize("speed", phase.final(v), unit="m/s")
        problem.minimize("square", phase.integral(u * u))
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
def test_shifts_are_those_of_the_same_flights(folder, changed):
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


@pytest.mark.slow
def test_points_one_by_one_and_the_best_of_each_front(folder, changed):
    points = rows(changed, "changed-data-points")
    assert len(points) == 4 * 3 and {row["point"] for row in points} == {f"point {k}" for k in (1, 2, 3, 4)}
    for light, heavy, limited in zip(points[::3], points[1::3], points[2::3], strict=True):
        assert [row["data"] for row in (light, heavy, limited)] == ["light", "heavy", "limited"]
        assert float(heavy["distance [m]"]) == pytest.approx(0.5 * float(light["distance [m]"]), rel=1e-5, abs=1e-9)
        assert float(limited["effort [N s]"]) == pytest.approx(float(light["effort [N s]"]))
        assert light["feasible"] == "yes"
    assert {row["feasible"] for row in points[2::3]} == {"yes", "no"}
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
def test_of_many_objectives_a_row_for_each_data(tmp_path):
    (tmp_path / "cart.py").write_text(CART, encoding="utf-8")
    address = f"{tmp_path / 'cart.py'}:cart"
    problems = {mass: {"problem": address, "weighed": True, "mass": float(mass)} for mass in ("2", "4", "5")}
    study = Study(
        "carts",
        problems=problems,
        transcriptions="shooting:5",
        solvers=NSGA2(population=8),
        evaluations=16,
        runs=1,
        seed=1,
        inner="propagate",
        nominal="2",
    )
    study.run(tmp_path / "out", executor=Inline())
    (found,) = changed_data(comparisons(Store.open(tmp_path / "out", trust=True), {}), {"nominal": "2"})
    figure = changed_figure(found.changes[0])
    assert [ax.get_title("left") for ax in figure.axes] == ["4"] * 3 + ["5"] * 3
    alone = [comparison for comparison in comparisons(Store.open(tmp_path / "out", trust=True), {}) if comparison.problem == "2"]
    assert [one.figures() for one in changed_data(alone, {"nominal": "2"})] == [{}], "only the nominal front: nothing to draw"
    marks = [line for line in figure.axes[0].lines if line.get_markerfacecolor() == LOOKS["simulated under these data"]["mfc"]]
    assert len(marks) == 1 and len(marks[0].get_xdata()) == len(found.changes[0].nominal)
    assert [ax.get_xlabel() for ax in figure.axes[:3]] == [""] * 3 and "distance" in figure.axes[5].get_xlabel()


@pytest.mark.slow
def test_the_report_has_all_of_it(folder):
    said = str(report(folder, trust=True, figures=False))
    assert "The front of light under changed data." in said and "Points of the front of light" in said
    names = {path.name for path in (folder / "report").iterdir()}
    assert {f"changed-data{part}.{suffix}" for part in ("", "-points", "-best") for suffix in ("txt", "csv", "tex")} <= names
    assert "representative solutions of the front" in said


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
        assert found.figures() == {} and "changed-data-points" not in found.tables()
        return found.tables()["changed-data"].text()

    assert "nothing feasible was found under the nominal data" in told(one=stated(19.0), two=stated(1.0))
    assert "nothing was simulated: problem 'glide' was stated in a script" in told(one=stated(1.0), three=stated(2.0))


def test_nothing_without_a_nominal_problem(folder):
    assert changed_data(comparisons(Store.open(folder, trust=True), {}), {"nominal": None}) == []


@pytest.mark.parametrize(
    ("problems", "nominal", "words"),
    [
        ({"slow": glide(), "fast": glide(4.0)}, "fats", "nominal: unknown problem 'fats', did you mean fast?"),
        ({"slow": glide(), "fast": glide(4.0)}, ["fast"], "nominal: unknown problem ['fast']"),
        ({"slow": glide()}, "slow", "nominal: 'slow' is the only problem"),
    ],
)
def test_wrong_nominal_problems_are_one_line_when_the_study_is_made(problems, nominal, words):
    with pytest.raises(ValueError) as error:
        Study("gliders", problems=problems, solvers=Plain(), evaluations=40, runs=1, seed=1, nominal=nominal)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_other_variables_are_told_when_the_study_is_made():
    other = Problem("glide")
    phase = other.phase("leg", t0=0.0, tf=(1.0, 5.0))
    x = phase.state("y", bounds=(0, 20), initial=0, unit="km")
    phase.dynamics(y=phase.control("u", bounds=(0, 3), unit="km/s"))
    other.minimize("time", phase.tf, unit="s")
    other.maximize("distance", phase.final(x), unit="km")
    problems = {"slow": glide(), "other": other}
    with pytest.raises(ValueError, match=r"nominal: problem 'other': .* states of phase 'leg' are y, not x") as error:
        Study("gliders", problems=problems, transcriptions="dfet:2x2", solvers=Plain(), evaluations=40, runs=1, seed=1, nominal="slow")
    assert "\n" not in str(error.value)
