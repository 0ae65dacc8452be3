"""Whole numbers and choices among the variables of a design: what is searched, counted, kept, shown and refused."""

import csv
import itertools

import numpy as np
import pytest

from macs import MACS, MOPSO, NSGA2, NSGA3, Front
from macs.evaluation.evaluator import UnitBox
from macs.pareto.dominance import nondominated
from problems import VectorProblem

MATERIALS = ["steel", "aluminium", "carbon"]


def spokes(X):
    n, k = X.T
    return np.column_stack([n * k, (n / k - 2.7) ** 2 + 1.0 / n])


def springs(function=None) -> VectorProblem:
    problem = VectorProblem("springs")
    problem.variable("d", bounds=(0.01, 0.06), unit="m")
    problem.variable("n", bounds=(3, 10), integer=True)
    problem.variable("material", choices=MATERIALS)
    problem.minimize("mass", unit="kg")
    problem.maximize("stiffness")

    def evaluate(X):
        d, n, material = X.T
        assert (n == n.round()).all() and np.isin(material, [0, 1, 2]).all()
        which = material.astype(int)
        return {
            "mass": np.array([7850.0, 2700.0, 1600.0])[which] * d**2 * n,
            "stiffness": np.array([210.0, 70.0, 135.0])[which] * d * n**0.5,
        }

    problem.function(function or evaluate)
    return problem


def test_of_1600_designs_the_whole_front_each_evaluated_once():
    rows = []

    def counted(X):
        rows.extend(map(tuple, X.tolist()))
        return spokes(X)

    bounds = {"n": (1, 40), "k": (1, 40)}
    every = np.array([*itertools.product(range(1, 41), repeat=2)], dtype=float)
    front = {tuple(row) for row in every[nondominated(spokes(every))]}
    assert len(front) == 18
    found = MACS(archive=50).minimize(counted, bounds, integer=True, evaluations=400, seed=5)
    assert set(map(tuple, found.decision)) == front and len(rows) == len(set(rows)) == found.stats["evaluations"] == 400
    rows.clear()
    small = MACS().minimize(counted, {"n": (1, 9), "k": (1, 9)}, integer=True, evaluations=400, seed=1)
    assert small.stats["evaluations"] == len(rows) == 81 and small.stats["stopped"] == "done"


@pytest.mark.parametrize("solver", [NSGA2(population=10), NSGA3(population=10), MOPSO(particles=10)])
def test_other_searches_too_propose_what_is_meant_and_count_no_design_twice(solver):
    rows = []

    def counted(X):
        rows.extend(map(tuple, X.tolist()))
        return spokes(X)

    solver.minimize(counted, {"n": (1, 40), "k": (1, 40)}, integer=["n", "k"], evaluations=95, seed=1)
    assert len(rows) == len(set(rows)) == 95 and all(value == round(value) for row in rows for value in row)
    assert len(solver.solve(springs(), evaluations=100, seed=1)) > 3


def test_files_tables_and_pictures_show_what_was_chosen(tmp_path):
    front = MACS().solve(springs(), evaluations=300, seed=1)
    chosen = [point.parameters["material"] for point in front]
    assert set(chosen) == {"steel", "carbon"} and all(isinstance(point.parameters["n"], int) for point in front)
    assert "carbon" in front.table()
    front.to_csv(tmp_path / "front.csv")
    with (tmp_path / "front.csv").open() as file:
        rows = [*csv.DictReader(file)]
    assert [row["material"] for row in rows] == chosen and rows[0]["n"] == str(front[0].parameters["n"])
    front.save(tmp_path / "front.nc")
    again = Front.load(tmp_path / "front.nc", problem=springs())
    assert [point.parameters for point in again] == [point.parameters for point in front] and again.verified.all()
    assert again.variables == front.variables
    ticks = [label.get_text() for label in front.plot_variables()[2].get_yticklabels()]
    assert ticks == MATERIALS


def test_a_search_goes_on_from_its_checkpoint_with_the_designs_that_it_knows(tmp_path):
    def call(**more):
        return MACS(archive=50).minimize(spokes, [(1, 40), (1, 40)], integer=True, evaluations=150, seed=2, **more)

    whole, path = call(), tmp_path / "run"
    call(checkpoint=path, callback=lambda progress: progress.evaluations > 60)
    resumed = call(checkpoint=path)
    assert np.array_equal(resumed.F, whole.F) and np.array_equal(resumed.decision, whole.decision)


def test_other_kinds_of_variables_make_another_problem():
    real, whole = VectorProblem("one"), VectorProblem("one")
    for problem, integer in ((real, False), (whole, True)):
        problem.variable("x", bounds=(0, 3), integer=integer)
        problem.minimize("f")
        problem.function(lambda X: {"f": 0.0 * X[:, 0]})
    assert real.compile().fingerprint != whole.compile().fingerprint


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ({"bounds": (0.5, 3), "integer": True}, "variable 'x' of problem 'p', a whole number, must be whole numbers"),
        ({"choices": ["a"]}, "choices of variable 'x' of problem 'p' must be two or more"),
        ({"choices": "ab"}, "must be two or more .*, not 'ab'"),
        ({"choices": ["a", "a"]}, r"'x' of problem 'p' must be two or more different .*'a', 'a'"),
        ({"choices": ["a", None]}, "'x' of problem 'p' must be two or more different texts, numbers or truth values"),
        ({"choices": ["a", "b"], "bounds": (0, 1)}, "'x' of problem 'p' has choices, and so neither bounds"),
        ({}, "'x' of problem 'p' has neither bounds nor choices"),
        ({"bounds": (0, 3), "integer": True, "period": 3}, "'x' of problem 'p' is a whole number, and so has no period"),
    ],
)
def test_mistakes_are_named(statement, message):
    with pytest.raises(ValueError, match=message):
        VectorProblem("p").variable("x", **statement)
    with pytest.raises(ValueError, match=r"integer: .*'m'"):
        MACS().minimize(spokes, {"n": (1, 4), "k": (1, 4)}, integer=["m"], evaluations=20)


def test_short_steps_lead_to_neighbours_and_choices_have_none():
    box, rng = (
        UnitBox(np.zeros(2), np.array([10.0, 4.0]), np.zeros(2, bool), np.array([True, True]), np.array([False, True])),
        np.random.default_rng(1),
    )
    places = box.settle(np.tile([0.52, 0.3], (4000, 1)), rng) * box.span
    assert set(places[:, 0]) == {5.0, 6.0} and places[:, 0].mean() == pytest.approx(5.2, abs=0.03)
    assert np.bincount(places[:, 1].astype(int)) == pytest.approx([800] * 5, rel=0.15)
    exact = np.array([[0.3, 0.75]])
    assert np.array_equal(box.settle(exact, rng), exact)
