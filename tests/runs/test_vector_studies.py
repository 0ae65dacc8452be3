import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pymoo.core.problem import Problem
from pymoo.problems import get_problem
from test_study import Inline
from vector_problems import parabolas

from macs import MACS, Front
from problems import load
from runs import Study
from runs.cli import main

MINE = """
import numpy as np
from problems import VectorProblem

def build(far: float = 2.0):
    problem = VectorProblem("mine")
    problem.variable("x", bounds=(-4, 4), unit="m")
    problem.minimize("near", unit="m2")
    problem.minimize("far", unit="m2")
    problem.constraint("wall", upper=1.5, unit="m")

    @problem.function
    def evaluate(X):
        (x,) = X.T
        return {"near": x**2, "far": (x - far) ** 2, "wall": x}

    problem.default_evaluations = 150
    return problem
"""


@pytest.fixture
def mine(here) -> str:
    (here / "mine.py").write_text(MINE)
    return "mine.py:build"


@pytest.mark.slow
def test_a_study_runs_resumes_and_reports_vector_problems_beside_others(tmp_path, mine):
    (tmp_path / "many.toml").write_text(
        f"""
        problems = {{own = {{problem = "{mine}", far = 3.0}}, truss = "four_bar_truss", ascent = "goddard"}}
        transcriptions = {{ascent = "dfet:2x2"}}
        evaluations = {{own = 120, truss = 200, ascent = 20}}
        solvers = ["macs", "nsga2"]
        runs = 1
        seed = 1
        """
    )
    study = Study.load(tmp_path / "many.toml", trust=True)
    assert [cell.transcription for cell in study.cells] == ["no transcription"] * 4 + ["dfet:2x2"] * 2
    assert study.cells[0].details["transcription"] is None and study.cells[0].details["problem"]["data"] == {"far": 3.0}
    summary = study.run(tmp_path / "out", executor=Inline())
    assert all(run.finished for run in summary.runs), summary
    files = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.nc")}
    again = study.run(tmp_path / "out")
    assert {path: path.stat().st_mtime_ns for path in files} == files and str(again) == str(summary)
    front = summary.runs[2].front
    own = Front.load(tmp_path / "out" / study.cells[0].folder / "0001.nc")
    assert np.array_equal(own.F, MACS().solve(load(mine, far=3.0), evaluations=120, seed=own.stats["seed"]).F)
    alone = MACS().solve(load("four_bar_truss"), evaluations=200, seed=front.stats["seed"])
    assert np.array_equal(front.F, alone.F) and front.verified.all()
    report = study.report(tmp_path / "out")
    names = {path.name for path in report.files}
    assert {"truss-no-transcription-variables.png", "truss-no-transcription-fronts.pdf", "own-no-transcription-variables.pdf"} <= names
    assert "against the true front" in report.text and "area 3 [cm2]" in report.text
    with (tmp_path / "out/report/truss-no-transcription-representatives.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head[1:] == ["volume [cm3]", "displacement [cm]", *(f"area {i} [cm2]" for i in range(1, 5))] and rows


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"transcriptions": "dfet:4x6"}, "transcriptions: 'welded_beam' is a vector problem, .*state none for it"),
        ({"transcriptions": {"welded_beam": "dfet:4x6"}}, "transcriptions: 'welded_beam' is a vector problem"),
        ({"terms": {"macs": {"transcription": "dfet:4x6"}}}, "terms of 'macs': transcription: 'welded_beam' is a vector problem"),
        ({"solvers": ["sweep"]}, "Sweep needs derivatives, but 'welded beam' is a vector problem"),
        ({"solvers": {"macs": {"solver": "macs", "mesh": "adaptive"}}}, "mesh='adaptive' does not apply"),
        ({"start": "smooth"}, "start: 'welded beam' is a vector problem.*no smooth profiles"),
    ],
)
def test_a_study_that_cannot_be_made_says_so_before_any_work(changes, message):
    stated = {"problems": ["welded_beam"], "solvers": ["macs"], "runs": 1, "seed": 1}
    with pytest.raises(ValueError, match=message):
        Study("beams", **{**stated, **changes})


def test_default_budgets_are_the_problems_own_and_what_studies_refuse(monkeypatch):
    assert Study("beams", problems="welded_beam", solvers="macs", runs=1, seed=1).cells[0].evaluations == 10_000
    with pytest.raises(ValueError, match=r"parabolas.*cannot be sent to another process"):
        Study("own", problems=parabolas(), solvers="macs", runs=1, seed=1)
    problem = parabolas(function=_of_a_script)
    with pytest.raises(ValueError, match="cannot import _of_a_script from a script"):
        Study("own", problems=problem, solvers="macs", runs=1, seed=1)

    def study(**settings):
        stated = {"problems": get_problem("zdt1"), "solvers": "macs", "evaluations": 100, "runs": 1, "seed": 1}
        return Study("functions", **(stated | settings))

    with pytest.raises(ValueError, match="problems: 'mine' must be a name, a Problem, one of pymoo"):
        study(problems={"mine": {"problem": get_problem("zdt1"), "n_var": 3}})
    with pytest.raises(ValueError, match="problem 'ZDT1' has none of its own"):
        study(evaluations=None)
    with pytest.raises(ValueError, match="problems: 'nk': bounds: pymoo problem"):
        study(problems={"nk": Problem(n_var=2, n_obj=2)})
    monkeypatch.setattr(Ours, "__module__", "__main__")
    with pytest.raises(ValueError, match="cannot import Ours from a script"):
        study(problems=Ours())


def _of_a_script(X: np.ndarray) -> dict[str, np.ndarray]:
    return {"near": X[:, 0], "nearness": X[:, 1], "wall": X[:, 0]}


_of_a_script.__module__ = "__main__"


@pytest.mark.slow
def test_the_command_line_solves_shows_verifies_and_chooses(here, capsys):
    assert main(["solve", "welded_beam", "--evaluations", "600", "--seed", "1", "--out", "beam.nc", "--plot", "beam.png"]) == 0
    assert "evaluated again, nothing differs by more than 1e-06" in capsys.readouterr().out
    front = Front.load("beam.nc")
    assert main(["show", "beam.nc", "--point", "2", "--plot", "point.png", "--csv", "point.csv"]) == 0
    out = capsys.readouterr().out
    assert f"weld length [in]     {front[2].parameters['weld length']:.10g}" in out and "buckling load" in out
    assert Path("point.png").stat().st_size > 10_000 and Path("point.csv").read_text().startswith("point,cost [$],deflection [in],verified")
    assert main(["verify", "beam.nc"]) == 0
    assert f"All {len(front)} points verify: evaluated again" in capsys.readouterr().out
    front.replace(F=front.F * 1.001).save("wrong.nc")
    assert main(["verify", "wrong.nc"]) == 1
    assert "evaluated again, its 'cost' differs by" in capsys.readouterr().out
    assert main(["decide", "beam.nc", "--reference", "cost=8", "--json", "choice.json"]) == 0
    out = capsys.readouterr().out
    assert "Only points that are known were ranked" in out and "not at hand" not in out
    assert json.loads(Path("choice.json").read_text())
    assert main(["decide", "beam.nc", "--reference", "cost=8", "--problem", "welded_beam"]) == 2
    assert "'welded beam' is a vector problem" in capsys.readouterr().err


def test_a_study_of_problems_of_pymoo(tmp_path):
    given = [get_problem("zdt1", n_var=3), get_problem("bnh")]
    study = Study("functions", problems=given, solvers=["macs", "nsga2"], evaluations=120, runs=1, seed=1)
    assert [cell.problem for cell in study.cells] == ["ZDT1", "ZDT1", "BNH", "BNH"]
    summary = study.run(tmp_path / "out", executor=Inline())
    front = summary.runs[0].front
    alone = MACS().minimize(given[0], evaluations=120, seed=front.stats["seed"])
    assert summary.finished == 4 and np.array_equal(front.F, alone.F) and front.source.name == "ZDT1" and front.verified.all()
    (constrained,) = (run.front for run in summary.runs if run.cell.labels == ("BNH", "no transcription", "macs"))
    assert constrained.verified.all() and {"g1", "g2"} <= set(constrained.violations[0])
    assert "hypervolume" in study.report(tmp_path / "out", figures=False).text
    with pytest.raises(ValueError, match="contains another study"):
        replace(study, problems=[get_problem("zdt1", n_var=3), get_problem("g4")]).run(tmp_path / "out")


class Ours(Problem):
    def __init__(self):
        super().__init__(n_var=2, n_obj=2, xl=0.0, xu=1.0)

    def _evaluate(self, X, out, *args, **kwargs):
        out["F"] = X
