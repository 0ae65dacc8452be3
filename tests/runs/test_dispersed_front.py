"""Fronts under dispersions in studies: tables and figures against the case itself, and what is refused."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from test_study import Inline

from problems import load
from problems.cases.aerocapture import coupled
from runs import Study
from runs.batch.store import Store
from runs.report import sensitivity
from runs.report.comparison import comparisons
from runs.report.report import report
from runs.report.sensitivity import DispersedFront, dispersed_fronts

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
def folder(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("dispersed") / "out"
    study().run(out, executor=Inline())
    return out


@pytest.fixture(scope="module")
def found(folder) -> DispersedFront:
    (one,) = dispersed_fronts(comparisons(Store.open(folder), {}), {"dispersions": GIVEN})
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
def test_tables_and_figures_of_the_report(folder, found):
    made = report(folder)
    table = next(path for path in made.files if path.name.endswith("dispersed-bank-as-it-is.csv"))
    rows = list(csv.reader(table.open(encoding="utf-8")))
    assert len(rows) == 1 + len(found.points) == 4
    column = next(i for i, name in enumerate(rows[0]) if name.startswith("captured"))
    assert [float(row[column]) for row in rows[1:]] == [one["captured", "%"] for one in found.measures["bank as it is"]]
    shield = next(i for i, name in enumerate(rows[0]) if name.startswith("nominal TPS"))
    np.testing.assert_allclose([float(row[shield]) for row in rows[1:]], found.points.objectives[:, 1])
    assert any(path.name.endswith("search-dispersed.png") for path in made.files)
    assert "under dispersions, bank solved anew" in made.text and "seed=4" in made.text
    assert dispersed_fronts(comparisons(Store.open(folder), {}), {}) == []


@pytest.mark.slow
def test_every_measure_has_a_panel(found):
    (figure,) = found.figures().values()
    assert [ax.get_title(loc="left").partition(" [")[0] for ax in figure.axes] == [name for name, _ in found.measures["nominal"][0]]
    for ax, (name, unit) in zip(figure.axes, found.measures["nominal"][0], strict=True):
        nominal, _, anew = (line.get_ydata() for line in ax.lines)
        assert nominal.tolist() == [one[name, unit] for one in found.measures["nominal"]]
        assert anew.tolist() == [one[name, unit] for one in found.measures["bank solved anew"]]


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


def test_the_study_that_comes_with_the_project():
    own = Study.load("aerocapture-dispersed")
    assert own.dispersions == {"cases": 1000, "seed": 2008, "entry_angle": 0.1, "density": 0.1, "ballistic": 0.02}
    assert {cell.problem for cell in own.cells} == {"front", "solution 2"}
    assert load("aerocapture").default_evaluations < own.cells[0].evaluations
