import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from terminals import Terminal

from runs import Study
from runs.batch import file as studyfile
from runs.batch.running import StudyDisplay
from runs.batch.store import Store
from runs.cli import main
from runs.execution.task import RunOutcome

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
def gliders(here):
    Path("glide.py").write_text(GLIDE, encoding="utf-8")
    Path("gliders.toml").write_text(TOML, encoding="utf-8")


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
    assert study.name == "gliders" and study.runs == 2
    assert [run.status for run in study.status("out/gliders").runs] == ["finished", "missing"]


def test_status_says_what_is_wrong(capsys):
    study = Study.load("gliders.toml", trust=True)
    with Store.claim("out", study.definition()) as store:
        store.keep(store.run(study.cells[0], 1), RunOutcome("killed", "its process was killed by SIGKILL"), {})
    assert main(["study", "status", "out"]) == 1
    said = capsys.readouterr().out
    assert "0 of 2 runs finished" in said and "killed by SIGKILL" in said


@pytest.mark.parametrize(
    ("toml", "words"),
    [
        (TOML.replace("runs = 2", "run = 2"), "unknown key 'run', did you mean runs?"),
        (TOML.replace("runs = 2", 'runs = "two"'), "runs must be a whole number"),
        (TOML.replace("runs = 2", ""), "runs is missing"),
        (TOML.replace("problems", "# problems"), "problems is missing"),
        (f"problems = {'[' * 5000}", "it is not TOML"),
        (TOML.replace("refine", "refined"), "'refined', did you mean refine?"),
        (TOML.replace("glide.py:glide", "glide.py:glider"), "has no function 'glider'"),
        (TOML.replace("glide.py:glide", "glides.py:glide"), "there is no file 'glides.py'"),
        ("runs = ", "it is not TOML"),
        (TOML + VOLUME, "[[paper]] 1, of hypervolume: problem 'glide.py:glide': point: 1 numbers, but 2 objectives: time, distance"),
        (TOML + VOLUME.replace("[1.0]", "[9, 0]").replace("py:glide", "py:dive"), "[[paper]] 1, of hypervolume: row 1: unknown problem"),
    ],
)
def test_a_wrong_file_is_one_line_before_any_work(refused, toml, words):
    Path("gliders.toml").write_text(toml, encoding="utf-8")
    line = refused("study", "run", "gliders.toml", "--trust")
    assert words in line and "gliders.toml: " in line


@pytest.mark.slow
def test_a_kill_says_how_to_go_on(here):
    (here / "gliders.toml").write_text(TOML.replace("60", "2_000_000"), encoding="utf-8")
    call = [sys.executable, "-m", "runs.cli", "study", "run", "gliders.toml", "--trust"]
    # A background job may have been told to ignore it, and its children with it.
    heeding = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
    process = subprocess.Popen(call, stderr=subprocess.PIPE, text=True, preexec_fn=heeding)
    while not (here / "out/gliders/study.json").exists():
        time.sleep(0.05)
    time.sleep(0.5)
    process.send_signal(signal.SIGTERM)
    said = process.communicate(timeout=20)[1]
    assert process.returncode == 130 and "the same command goes on" in said and "Traceback" not in said


@pytest.mark.parametrize("name", studyfile.names())
def test_each_study_there_is_makes_sense(name):
    study = Study.load(name)
    assert study.name == name and study.description == studyfile.describe(name)
    assert not study.terms or study.quick().name == f"{name}-quick"


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
