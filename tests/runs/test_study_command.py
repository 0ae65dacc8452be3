from __future__ import annotations

import io
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from problems.cases.reentry.cases import case1_reference
from problems.cases.reentry.statement import MASS
from runs import Study
from runs.batch import file as studyfile
from runs.batch.running import StudyDisplay
from runs.batch.store import Store
from runs.cli import main
from runs.execution.task import RunOutcome
from transcription import DFET, Collocation, SingleShooting, parse

GLIDE = (Path(__file__).parent / "misbehaving.py").read_text(encoding="utf-8")
TOML = """
description = "gliders"
problems = ["glide.py:glide"]
evaluations = 60
runs = 2
seed = 1

[solvers.plain]
solver = "macs"
refine = false
"""
VOLUME = """
[[paper]]
of = "hypervolume"
point = [1.0]
rows = [{problem = "glide.py:glide", by = "a paper", best = 3}]
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "glide.py").write_text(GLIDE, encoding="utf-8")
    (tmp_path / "gliders.toml").write_text(TOML, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_run_resume_and_status(capsys):
    assert main(["study", "run", "gliders.toml", "--trust", "--runs", "1"]) == 0
    said = capsys.readouterr()
    assert "1 of 1 runs finished" in said.out and "in out/gliders" in said.out and "gliders: 0 of 1 finished, 1 left" in said.err
    path = next(Path("out/gliders").rglob("*.nc"))
    stamp = path.stat().st_mtime_ns
    assert main(["study", "status", "out/gliders"]) == 0
    assert main(["study", "run", "gliders.toml", "--trust", "--runs", "1"]) == 0
    assert path.stat().st_mtime_ns == stamp
    study = Study.load("gliders.toml", trust=True)
    assert (
        study.name == "gliders" and study.runs == 2 and [run.status for run in study.status("out/gliders").runs] == ["finished", "missing"]
    )
    assert main(["study", "run", "gliders.toml", "--trust", "--runs", "1", "--out", "."]) == 2
    assert "contains no study but other things" in capsys.readouterr().err


@pytest.mark.parametrize(("call", "words"), [(["--solvers", "MACS", "goddard-table3"], "write them before --solvers"), ([], "STUDY\n")])
def test_a_study_that_is_missing(call, words, capsys):
    """An option that takes several labels takes the study after them, too."""
    with pytest.raises(SystemExit):
        main(["study", "run", *call])
    said = capsys.readouterr().err
    assert "required: STUDY" in said and words in said


@pytest.mark.slow
def test_the_runs_of_some_solvers(capsys):
    Path("two.toml").write_text(TOML + '[solvers.other]\nsolver = "macs"\nrefine = false\n')
    command = ["study", "run", "two.toml", "--trust", "--runs", "1", "--solvers"]
    assert main([*command, "others"]) == 2
    assert "unknown solver 'others', did you mean other" in capsys.readouterr().err
    assert main([*command, "other"]) == 0
    assert "1 of 2 runs finished" in capsys.readouterr().out


def test_status_says_what_is_wrong(capsys):
    study = Study.load("gliders.toml", trust=True)
    with Store.claim("out", study.definition()) as store:
        store.keep(store.run(study.cells[0], 1), RunOutcome("killed", "its process was killed by SIGKILL"))
    assert main(["study", "status", "out"]) == 1
    said = capsys.readouterr().out
    assert "0 of 2 runs finished" in said and "killed by SIGKILL" in said
    assert main(["study", "status", "nowhere"]) == 2
    assert capsys.readouterr().err == "macs study status: there is no folder 'nowhere'\n"


@pytest.mark.parametrize(
    ("toml", "words"),
    [
        (TOML.replace("runs = 2", "run = 2"), "unknown key 'run', did you mean runs?"),
        (TOML.replace("runs = 2", "runs = 0"), "runs must be a whole number of at least 1, not 0"),
        (TOML.replace("runs = 2", 'runs = "two"'), "runs must be a whole number"),
        (TOML.replace("runs = 2", ""), "runs is missing"),
        (TOML.replace("problems", "# problems"), "problems is missing"),
        (f"problems = {'[' * 5000}", "it is not TOML"),
        (TOML.replace('"macs"', '"mcas"'), "unknown solver 'mcas', did you mean macs?"),
        (TOML.replace("refine", "refined"), "'refined', did you mean refine?"),
        (TOML.replace("glide.py:glide", "glide.py:glider"), "has no function 'glider'"),
        (TOML.replace("glide.py:glide", "glides.py:glide"), "there is no file 'glides.py'"),
        ("runs = ", "it is not TOML"),
        (TOML + VOLUME, "[[paper]] 1, of hypervolume: problem 'glide.py:glide': point: 1 numbers, but 2 objectives: time, distance"),
        (TOML + VOLUME.replace("[1.0]", "[9, 0]").replace("py:glide", "py:dive"), "[[paper]] 1, of hypervolume: row 1: unknown problem"),
    ],
)
@pytest.mark.parametrize("how", [[], ["--quick"]])
def test_a_wrong_file_is_one_line_before_any_work(here, capsys, toml, words, how):
    (here / "gliders.toml").write_text(toml, encoding="utf-8")
    assert main(["study", "run", "gliders.toml", "--trust", *how]) == 2
    said = capsys.readouterr()
    assert words in said.err and "gliders.toml: " in said.err and said.err.count("\n") == 1 and not (here / "out").exists()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (["gliderz"], "unknown study 'gliderz'"),
        (["goddard-table-3"], "did you mean goddard-table3?"),
        (["nothing.toml"], "there is no file 'nothing.toml'"),
        (["gliders.toml", "--jobs", "2", "--dask", "tcp://localhost:1"], "give one of them"),
        (["gliders.toml", "--trust", "--runs", "0"], "not a whole number above 0"),
        (["gliders.toml", "--job", "2"], "did you mean --jobs?"),
    ],
)
def test_a_wrong_call_is_one_line(here, capsys, call, words):
    try:
        code = main(["study", "run", *call])
    except SystemExit as end:
        code = end.code
    said = capsys.readouterr()
    assert code == 2 and words in said.err and said.err.count("\n") == 1 and not (here / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_ctrl_c_and_kill_say_how_to_go_on(here, number):
    (here / "gliders.toml").write_text(TOML.replace("60", "2_000_000"), encoding="utf-8")
    call = [sys.executable, "-m", "runs.cli", "study", "run", "gliders.toml", "--trust"]
    # A background job may have been told to ignore it, and its children with it.
    heeding = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
    process = subprocess.Popen(call, stderr=subprocess.PIPE, text=True, preexec_fn=heeding)
    while not (here / "out/gliders/study.json").exists():
        time.sleep(0.05)
    time.sleep(0.5)
    process.send_signal(getattr(signal, number))
    said = process.communicate(timeout=20)[1]
    assert process.returncode == 130 and "the same command goes on" in said and "Traceback" not in said


def test_studies_are_listed_and_reproduce_the_published_table(capsys):
    assert main(["list"]) == 0
    said = capsys.readouterr().out
    for name in ("goddard-table3", "orbit-table3", "orbit-full-table3"):
        study = Study.load(name)
        assert name in said and study.name == name and study.runs == 10 and len(study.cells) == 6
        (paper,) = study.paper[0]["rows"]
        assert paper["problem"] == study.cells[0].problem
        # Table III.
        published = (5.701e-3, 1.107e-5, 2.588e-2, 1.909e-5, 2456) if "goddard" in name else (7.384e-4, 4.217e-7, 5.179e-3, 5.052e-6, 41113)
        assert tuple(paper[key] for key in ("gd_mean", "gd_variance", "igd_mean", "igd_variance", "seconds")) == published
        assert study.cells[0].evaluations == (10_000 if "goddard" in name else 50_000)
    quick = Study.load("orbit-table3").quick()
    assert quick.name == "orbit-table3-quick" and quick.runs == 2 and quick.cells[0].evaluations == 500
    assert set(studyfile.names()) >= {"goddard-table3", "orbit-table3", "orbit-full-table3"}


@pytest.mark.parametrize("name", studyfile.names())
def test_each_study_there_is_makes_sense_whole_and_quick(name):
    study = Study.load(name)
    assert (study.name, study.quick().name) == (name, f"{name}-quick") and study.description == studyfile.describe(name)


@pytest.mark.slow
def test_studies_of_the_parameters_of_the_reentry(capsys):
    assert main(["list"]) == 0
    said = capsys.readouterr().out
    studies = {name: Study.load(f"reentry-{name}") for name in ("nodes", "discretisations", "uncertainty")}
    for name, study in studies.items():
        assert f"reentry-{name}" in said and (study.inner, study.start, study.verify) == ("propagate", "smooth", 0.01)
        collocated = {(f"NSGA-III, {method}", 60_000) for method in ("DC", "GP", "MCP")}
        beside = {"uncertainty": {("MACS", 10_000)}, "discretisations": collocated}.get(name, set())
        assert {(cell.solver, cell.evaluations) for cell in study.cells} == {("NSGA-III", 60_000)} | beside
        assert Study.load(f"reentry-{name}").quick().cells[0].evaluations <= 500
    assert [cell.transcription for cell in studies["nodes"].cells] == [f"shooting:{nodes}" for nodes in (100, 150, 200, 250)]
    loads = case1_reference()[:, 1]
    for name in ("nodes", "discretisations"):
        goal = studies[name].goal
        assert goal["objective"] == "heat load" and [goal["best"], goal["worst"]] == pytest.approx([loads.min(), loads.max()], abs=1e-3)
    # As many values of each control on all transcriptions of a node count.
    for cell in studies["discretisations"].cells:
        method = parse(cell.transcription)
        assert isinstance(method, SingleShooting | DFET | Collocation)
        if isinstance(method, SingleShooting):
            values = method.nodes
        else:
            values = method.elements * (
                1 + (method.most_control_order(method.order) if method.control_order is None else method.control_order)
            )
        assert cell.problem == f"{values} nodes"
        # On collocation the states are searched, too, and the dynamics are constraints; elsewhere they are propagated.
        searched = isinstance(method, Collocation)
        assert (
            studies["discretisations"].inner_of(cell) == ("none" if searched else "propagate") and (cell.solver != "NSGA-III") is searched
        )
    uncertain = studies["uncertainty"]
    assert uncertain.nominal == uncertain.cells[0].problem == "nominal"
    data = [cell.details["problem"]["data"] for cell in uncertain.cells if cell.solver == "NSGA-III"]
    assert [one.get("mass", MASS) / MASS for one in data] == pytest.approx([1.0, 1.05, 1.1, 1.0])
    assert [one.get("gravity") for one in data] == [None, None, None, "constant"]
    assert all(figure in uncertain.note for figure in ("32.05", "118.37", "32.13", "121.61"))


def test_problems_transcriptions_and_budgets_may_be_given_each_by_name(here):
    toml = """
    problems = {fast = {problem = "glide.py:glide", speed = 4.0}, slow = {problem = "glide.py:glide", speed = 2.0}}
    transcriptions = {fast = ["dfet:2x2", "dfet:3x2"], slow = "dfet:1x4"}
    evaluations = {fast = 50, slow = 60}
    solvers = ["macs"]
    runs = 2
    seed = 0
    """
    (here / "two.toml").write_text(toml, encoding="utf-8")
    cells = Study.load("two.toml", trust=True).cells
    assert [(*cell.labels, cell.evaluations) for cell in cells] == [
        ("fast", "dfet:2x2", "macs", 50),
        ("fast", "dfet:3x2", "macs", 50),
        ("slow", "dfet:1x4", "macs", 60),
    ]
    assert cells[0].details["problem"]["fingerprint"] != cells[2].details["problem"]["fingerprint"]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_sees_the_runs_that_are_going_on(here):
    study = Study.load("gliders.toml", trust=True)
    with Store.claim("out", study.definition()) as store:
        runs = list(store.runs())
    stream = Terminal()
    with StudyDisplay("gliders", runs, runs, shown=True, stream=stream) as display:
        display.reporter(runs[1])(40, 1.0)
        display.ended(runs[0], RunOutcome("crashed", "ValueError: no [such] thing"))
    said = stream.getvalue()
    assert "run 2" in said and "40 / 60 evaluations" in said and "1 failed, 1 left" in said
    assert "run 1 of glide.py:glide, dfet:2x2, plain crashed: ValueError: no [such] thing" in " ".join(said.split())
