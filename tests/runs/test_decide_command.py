"""`macs decide`: by options, by commands in a terminal, and what it refuses."""

import json
import os
import pty
import re
import select
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from macs import Front, sweep
from macs.decisions import Dialogue, Larger, PhysicalProgramming, ReferencePoint, Smaller, WeightedSum, to_dict
from problems import load
from problems.compiled import Objective
from runs import Study
from runs.cli import main
from transcription import DFET

MACS = [sys.executable, "-m", "runs.cli"]
SCRIPT = "from problems import load\n\ndef build():\n    return load('goddard')\n"


@pytest.fixture(scope="module")
def fronts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A front of a problem of the catalogue."""
    folder = tmp_path_factory.mktemp("fronts")
    sweep(load("goddard"), DFET(4, 6), points=8, starts=1).save(folder / "goddard.nc")
    return folder


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_by_options(fronts: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = ["decide", str(fronts / "goddard.nc"), "--reference", "flight time=150", "--improve", "horizontal speed", "--to", "0.7 km/s"]
    files = ["--out", "choice.nc", "--json", "choice.json", "--plot", "choice.png"]
    assert main([*call, *files]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    point = Front.load("choice.nc")[0]
    assert point.objectives["horizontal speed"] == pytest.approx(0.7, abs=1e-5) and point.verified
    data = json.loads((here / "choice.json").read_text())
    assert data["choice"]["objectives"] == point.objectives
    assert [t["asked"] for t in data["history"]] == ["near flight time 150 s, others at their best", "better horizontal speed: 0.7 km/s"]
    assert data["history"][0]["preference"] == to_dict(ReferencePoint({"flight time": 150.0}))
    assert (here / "choice.png").read_bytes().startswith(b"\x89PNG")
    first, second = said.out.split("Turn 2: better horizontal speed: 0.7 km/s (converged, verified)")
    assert first.startswith("Turn 1: near flight time 150 s, others") and re.search(r"flight time +min \[s\] +19\d", first)
    # The slope of the front, seen from either side.
    rows = [line.split() for line in second.splitlines() if re.match(r"(flight time|horizontal speed) +[-+]", line)]
    assert float(rows[0][-1]) * float(rows[1][-2]) == pytest.approx(-1.0, rel=1e-2)
    # The dialogue goes on.
    assert main(["decide", "choice.json", "--improve", "flight time", "--giving", "horizontal speed=0.6", "--json", "choice.json"]) == 0
    again = Dialogue.load("choice.json")
    assert len(again.history) == 3 and again.choose().objectives["horizontal speed"] == pytest.approx(0.6, abs=1e-5)


def test_a_preference_from_a_file_and_alternatives(fronts: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wanted = PhysicalProgramming({"flight time": Smaller.even(120, 220), "horizontal speed": Larger.even(0.8, 0.1)})
    (here / "wanted.json").write_text(json.dumps(to_dict(wanted)))
    call = ["decide", str(fronts / "goddard.nc"), "--rank-only", "--prefer"]
    assert main([*call, "wanted.json", "--alternatives", "2", "--json", "c.json"]) == 0
    said = capsys.readouterr().out
    assert "were ranked" in said and "not at hand" not in said and len(re.findall(r"^ +[12]  ", said, re.MULTILINE)) == 2
    assert Dialogue.load("c.json").preference == wanted
    # No point meets these limits.
    hard = PhysicalProgramming({"flight time": Smaller.even(100, 112), "horizontal speed": Larger.even(0.95, 0.9)})
    (here / "hard.json").write_text(json.dumps(to_dict(hard)))
    assert main([*call, "hard.json"]) == 1
    assert "No point meets all hard limits" in capsys.readouterr().out


@pytest.mark.slow
def test_a_problem_that_is_not_at_hand(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "mine.py").write_text(SCRIPT, encoding="utf-8")
    sweep(load("mine.py:build"), DFET(4, 6), points=8, starts=1).save("mine.nc")
    call = ["decide", "mine.nc", "--improve", "flight time", "--to", "160"]
    assert main(call) == 0
    said = capsys.readouterr().out
    assert "The problem 'goddard' is not at hand: give it by --problem, or --trust" in said and "were ranked" in said
    for more in (["--trust"], ["--problem", "mine.py:build"], ["--problem", "goddard"]):
        assert main([*call, *more, "--out", "c.nc"]) == 0
        assert "ranked" not in capsys.readouterr().out
        assert Front.load("c.nc")[0].objectives["flight time"] == pytest.approx(160.0, rel=1e-5)


def wrong(capsys: pytest.CaptureFixture[str], *call: str) -> str:
    """The one line that a wrong call is answered with."""
    before = {path.name for path in Path.cwd().iterdir()}
    try:
        code = main(["decide", *call])
    except SystemExit as end:
        code = int(end.code or 0)
    said = capsys.readouterr()
    assert (code, said.out) == (2, "") and said.err.count("\n") == 1 and said.err.startswith("macs decide: ")
    assert {path.name for path in Path.cwd().iterdir()} == before
    return said.err


def test_wrong_calls_are_one_line(fronts: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    front = str(fronts / "goddard.nc")
    outs = ["--out", "c.nc", "--json", "c.json", "--plot", "c.png"]
    (here / "list.json").write_text("[1]")
    (here / "broken.json").write_text("{")
    (here / "text.nc").write_text("mine")
    for call, words in [
        (["none.nc"], "there is no file 'none.nc'"),
        (["broken.json"], "broken.json does not hold a dialogue that can be read: it is not JSON"),
        ([front, "--reference", "speed=1"], "unknown objective 'speed'"),
        ([front, "--reference", "flight time"], "write NAME=VALUE"),
        ([front, "--reference", "flight time=150 km"], "'150 km' is no value of 'flight time' in s"),
        ([front, "--reference", "flight time=150", "--reference", "flight time=160"], "'flight time' is given twice"),
        ([front, "--reference", "flight time=nan"], "must be finite"),
        ([front, "--reference", "flight time=1e6"], "lies beyond its range"),
        ([front, "--improve", "speed"], "unknown objective 'speed'"),
        ([front, "--improve", "flight time", "--to", "soon"], "'soon' is no value of 'flight time' in s"),
        ([front, "--improve", "flight time", "--giving", "flight time=200"], "cannot both improve and give way"),
        ([front, "--to", "150"], "--to and --giving say more about --improve NAME"),
        ([front, "--prefer", "none.json"], "there is no file 'none.json'"),
        ([front, "--prefer", "broken.json"], "broken.json is not JSON"),
        ([front, "--prefer", "list.json"], "list.json: a preference must be a table"),
        ([front, "--prefer", "list.json", "--reference", "flight time=150"], "give --prefer or --reference, not both"),
        ([front, "--rank-only", "--problem", "goddard"], "--rank-only solves nothing"),
        ([front, "--problem", "betts"], "belongs to problem 'goddard'"),
        ([front, "--problem", "nothing.py:build"], "nothing.py"),
        ([front, "--transcription", "dfet"], "unknown transcription"),
        ([front, "--alternatives", "0"], "is not a whole number above 0"),
        ([front, "--out", front], "would overwrite what the choice is made from"),
        ([front, "--json", front], "would overwrite what the choice is made from"),
        ([front, "--out", "text.nc"], "would overwrite a file that is no front"),
        ([front, "--json", "list.json"], "would overwrite a file that is no dialogue"),
        ([front, "--out", "a/b.nc"], "there is no folder"),
        ([front, "--plot", "c.doc"], "a picture is one of"),
        ([front, "--out", "c", "--json", "c"], "--out and --json name the same file"),
        ([front, "--refrence", "a=1"], "unknown option --refrence; did you mean --reference?"),
    ]:
        more = outs if not {"--out", "--json", "--plot"} & {*call} else []
        assert words in wrong(capsys, *call, *more), call


def test_names_with_commas(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    goals = (Objective("load, largest", unit="kN"), Objective("mass, dry"), Objective("time"))
    F = np.array([[1.0, 5.0, 9.0], [2.0, 3.0, 4.0], [5.0, 1.0, 2.0]])
    Front(F=F, decision=np.zeros((3, 0)), violation=np.zeros(3), status=["converged"] * 3, goals=goals).save("box.nc")
    wanted = ReferencePoint({"load, largest": 2.0, "mass, dry": 3.0, "time": 4.0})
    one, other = "load, largest=2 kN, mass, dry=3, time=4", ["time=4", "mass, dry=3", "load, largest=2"]
    for call in (["--reference", one], [word for each in other for word in ("--reference", each)]):
        assert main(["decide", "box.nc", *call, "--json", "c.json"]) == 0
        assert Dialogue.load("c.json").history[-1].preference == wanted
    assert main(["decide", "box.nc", "--improve", "mass, dry", "--giving", "load, largest=5, time=9"]) == 0
    capsys.readouterr()
    for text, words in (
        ("load, largest", "'load, largest': write NAME=VALUE"),
        ("load=2", "unknown objective 'load'"),
        ("time, load, largest=2", "unknown objective 'time, load, largest'"),
        ("time=4,", "'': write NAME=VALUE"),
    ):
        assert words in wrong(capsys, "box.nc", "--reference", text), text


@pytest.mark.slow
def test_commands_in_a_terminal(fronts: Path, here: Path) -> None:
    parent, child = pty.openpty()
    work = subprocess.Popen([*MACS, "decide", str(fronts / "goddard.nc")], stdin=child, stdout=child, stderr=child, close_fds=True)
    os.close(child)
    seen = ""

    def answer() -> str:
        """What is written until the next prompt, or the end."""
        nonlocal seen
        seen, end = "", time.monotonic() + 60
        while not seen.endswith("decide> ") and time.monotonic() < end:
            if select.select([parent], [], [], 0.2)[0]:
                try:
                    seen += os.read(parent, 65536).decode()
                except OSError:
                    break
        return seen

    def say(line: str) -> str:
        os.write(parent, f"{line}\n".encode())
        return answer()

    try:
        assert "`help` shows the commands" in answer()
        assert "improve NAME" in say("help")
        assert "near flight time 150 s, others at their best (converged, verified)" in say("reference flight time=150 s")
        assert re.search(r"horizontal speed  max \[km/s\] +0\.7000 ", say("improve horizontal speed to 0.7 giving flight time=240"))
        assert re.search(r"^ +2  ", say("alternatives 2"), re.MULTILINE)
        assert "Turn 4: alternative 1" in say("take 1")
        for line, words in (
            ("take 7", "there is no alternative 7"),
            ("improve speed", "unknown objective 'speed'"),
            ("imrpove flight time", "unknown command 'imrpove', did you mean improve?"),
            ("prefer", "write: prefer NAME=VALUE"),
            ("save", "write: save FILE.json"),
            (f"save {fronts / 'goddard.nc'}", "would overwrite what the choice is made from"),
            ("alternatives some", "'some' is no number of alternatives"),
        ):
            assert words in say(line)
        assert "Turn 3: better horizontal speed: 0.7 km/s, giving flight time until 240 s" in say("undo")
        assert "near the best of all" in say("show")
        assert "dialogue in c.json" in say("save c.json") and "chosen point in c.nc" in say("save c.nc")
        os.write(parent, b"quit\n")
        assert work.wait(20) == 0
    finally:
        work.kill()
        os.close(parent)
    assert len(Dialogue.load("c.json").history) == 3
    assert Front.load("c.nc")[0].objectives == Dialogue.load("c.json").choose().objectives


# Preferences that guide searches, in studies and on the command line


WANTED = WeightedSum({"flight time": 1.0, "horizontal speed": 2.0})


@pytest.mark.slow
def test_a_preference_in_a_study(tmp_path):
    plain = {"solver": "macs", "mesh": "fixed", "prefer": to_dict(WANTED)}
    study = Study("wishes", problems=["goddard"], transcriptions=["dfet:2x3"], solvers={"here": plain}, evaluations=20, runs=1, seed=1)
    study.run(tmp_path)
    (file,) = tmp_path.rglob("*.nc")
    assert Front.load(file).solver["settings"]["prefer"] == to_dict(WANTED)
    with pytest.raises(ValueError, match=r"solvers: MACS: prefer: .*'Wishes'"):
        Study("wishes", problems=["goddard"], solvers={"here": {"solver": "macs", "prefer": {"method": "Wishes"}}}, runs=1, seed=1)


@pytest.mark.slow
def test_a_preference_on_the_command_line(tmp_path, capsys):
    wish, out = tmp_path / "wish.json", tmp_path / "front.nc"
    wish.write_text(json.dumps(to_dict(WANTED)))
    call = ["solve", "goddard", "--transcription", "dfet:2x3", "--evaluations", "60", "--seed", "1", "--mesh", "fixed", "--out", str(out)]
    assert main([*call, "--prefer", str(wish)]) == 0
    assert Front.load(out).solver["settings"]["prefer"] == to_dict(WANTED)


@pytest.mark.parametrize(
    ("text", "solver", "words"),
    [
        (None, "macs", "there is no file|No such file"),
        ("{", "macs", "is not JSON"),
        ("[1]", "macs", "must have a preference"),
        ('{"method": "Wishes"}', "macs", "'Wishes'"),
        (json.dumps(to_dict(WeightedSum({"f1": 1.0}))), "macs", "'f1'"),
        (json.dumps(to_dict(WANTED)), "nsga2", "--prefer .* does not apply"),
    ],
)
def test_wrong_preferences(tmp_path, capsys, text, solver, words):
    wish, out = tmp_path / "wish.json", tmp_path / "front.nc"
    if text is not None:
        wish.write_text(text)
    assert main(["solve", "goddard", "--solver", solver, "--evaluations", "20", "--prefer", str(wish), "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1 and re.search(words, said.err), said.err
    assert not out.exists()
