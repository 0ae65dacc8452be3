"""Paths that are no ordinary files, where the command line reads or writes: one line, at once."""

import os
from pathlib import Path

import pytest

from problems import load
from runs.measures.references import read

KINDS = ("pipe", "device", "folder", "circle of links")
SOLVE = ("solve", "four_bar_truss", "--seed", "1", "--evaluations", "40")


pytestmark = pytest.mark.usefixtures("here")


def odd(name, kind):
    """Make a path that is no ordinary file; its name."""
    if kind == "pipe":
        os.mkfifo(name)
    elif kind == "device":
        Path(name).symlink_to("/dev/zero")
    elif kind == "folder":
        Path(name).mkdir()
    else:
        Path(name).symlink_to(name)
    return name


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_read_is_an_ordinary_file(refused, kind):
    for suffix, call in (
        (".py", ("solve", "odd.py:build")),
        (".json", (*SOLVE, "--prefer", "odd.json", "--out", "front.nc")),
        (".toml", ("study", "run", "odd.toml")),
        (".nc", ("show", "odd.nc")),
        (".nc", ("verify", "odd.nc")),
        (".json", ("decide", "odd.json")),
    ):
        name = f"odd{suffix}"
        if not os.path.lexists(name):
            odd(name, kind)
        line = refused(*call)
        assert name in line and any(why in line for why in ("no ordinary file", "Is a directory", "symbolic links"))
    assert not Path("front.nc").exists()


@pytest.mark.parametrize("kind", KINDS)
def test_the_record_of_a_study_is_an_ordinary_file(refused, kind):
    Path("study").mkdir()
    Path("study/study.json").symlink_to(Path.cwd() / odd("odd", kind))
    for action in ("status", "report"):
        assert "'study' cannot be read" in refused("study", action, "study")


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_is_an_ordinary_file(refused, kind):
    odd("odd.png", kind)
    for option in ("--out", "--plot", "--checkpoint"):
        given = {"--out": "front.nc"} | {option: "odd.png"}
        line = refused(*SOLVE, *(word for pair in given.items() for word in pair))
        assert "cannot write 'odd.png'" in line and not Path("front.nc").exists()


def test_the_folder_of_a_study_is_no_circle_of_links(refused):
    odd("study", "circle of links")
    assert "'study' is not a folder" in refused("study", "run", "aerocapture-front", "--quick", "--out", "study")


@pytest.mark.parametrize("kind", KINDS)
def test_a_table_is_an_ordinary_file(kind):
    with pytest.raises(ValueError, match=r"'odd\.csv' cannot be read"):
        read(odd("odd.csv", kind), load("four_bar_truss").compile().goals)


def test_a_file_with_a_problem_has_a_size(refused):
    with Path("large.py").open("wb") as file:
        file.truncate(2**30)
    assert "'large.py' has 1073741824 bytes" in refused("solve", "large.py:build")
