"""SECURITY.md names tests and limits that are there."""

import re
from pathlib import Path

from macs.decisions import dialogue_file
from macs.fronts import files
from macs.solvers import checkpoint
from problems import catalogue
from runs.cli import inputs
from runs.files import DATA_BYTES

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "SECURITY.md").read_text(encoding="utf-8")


def test_the_tests_that_it_names_exist():
    named = set(re.findall(r"\btest_\w+(?!\w|\.py)", PAGE)) - {path.stem for path in ROOT.joinpath("tests").rglob("test_*.py")}
    there = {name for path in ROOT.joinpath("tests").rglob("test_*.py") for name in re.findall(r"^def (test_\w+)", path.read_text(), re.M)}
    assert len(named) > 8 and named <= there
    paths = re.findall(r"`((?:tests|runs)/[\w/]+\.py)`", PAGE)
    assert len(paths) > 8 and all((ROOT / path).is_file() for path in paths)


def test_the_limits_that_it_names_are_those_of_the_code():
    (line,) = re.findall(r"Most bytes that are read: (.*?)\.\n", PAGE, re.S)
    found = {name: int(number) * 2 ** {"G": 30, "M": 20}[unit] for name, number, unit in re.findall(r"(\w+)\s+(\d+) ([GM])iB", line)}
    assert found == {
        "fronts": files.LARGEST_FRONT,
        "dialogues": dialogue_file.MOST_BYTES,
        "checkpoints": checkpoint.LARGEST_CHECKPOINT,
        "tables": DATA_BYTES,
        "files": catalogue.PROBLEM_FILE_BYTES,
        "preferences": inputs.PREFERENCE_BYTES,
    }
