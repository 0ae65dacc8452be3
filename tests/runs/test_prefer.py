"""Preferences that guide searches, in studies and on the command line."""

import json
import re

import pytest

from macs import Front
from macs.decisions import WeightedSum, to_dict
from runs import Study
from runs.cli.parser import main

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
