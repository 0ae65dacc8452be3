"""`macs solve` when the front cannot be saved where it was to be, by the time it is there."""

import errno
import re
import tempfile
from pathlib import Path

import pytest

from macs import Front
from runs.cli import main

SOLVE = ("solve", "four_bar_truss", "--seed", "1", "--evaluations", "40", "--out", "disk/front.nc")


@pytest.fixture(autouse=True)
def disk(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("disk", "temporary"):
        Path(name).mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path / "disk"


def full(monkeypatch, *folders):
    """Let the disk of some folders be full."""
    replace = Path.replace

    def fails(self, target):
        if any(Path(target).is_relative_to(folder) for folder in folders):
            raise OSError(errno.ENOSPC, "No space left on device")
        return replace(self, target)

    monkeypatch.setattr("pathlib.Path.replace", fails)


def test_a_front_goes_to_the_temporary_folder_if_the_disk_is_full(disk, monkeypatch, capsys):
    full(monkeypatch, disk)
    assert main(SOLVE) == 1
    said = capsys.readouterr()
    line = said.err.splitlines()[-1]
    assert line.startswith("macs solve: cannot write 'disk/front.nc': No space left on device; the front is saved in '")
    place = Path(re.search(r"saved in '(.*)' instead", line)[1])
    assert place.is_relative_to(disk.parent / "temporary") and place.name == "front.nc" and len(Front.load(place)) > 1
    assert "four-bar truss" in said.out and "front saved in" not in said.out and not any(disk.iterdir())


def test_a_front_that_can_be_saved_nowhere_is_a_table(disk, monkeypatch, capsys):
    full(monkeypatch, disk.parent)
    assert main(SOLVE) == 1
    said = capsys.readouterr()
    assert said.err.splitlines()[-1].endswith(": only its table is left") and "four-bar truss" in said.out


def test_a_picture_that_cannot_be_written_costs_nothing_else(disk, monkeypatch, capsys):
    full(monkeypatch, disk)
    assert main([*SOLVE[:-1], "front.nc", "--plot", "disk/front.png"]) == 1
    said = capsys.readouterr()
    assert said.err.splitlines()[-1] == "macs solve: cannot write 'disk/front.png': No space left on device"
    assert "front saved in front.nc" in said.out and len(Front.load("front.nc")) > 1
