"""What is installed: all data files of the packages, and other packages that suit every Python we promise. `make package` builds the wheel
and tries it."""

import os
import subprocess
import sys
import tomllib
from fnmatch import fnmatch
from importlib.metadata import distributions
from pathlib import Path

from package import FLOORS, LEFT_OUT, missing
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

import runs

ROOT = Path(__file__).parents[1]


def test_every_data_file_of_the_packages_is_in_the_wheel():
    """Of a package, a folder with __init__.py, `[tool.setuptools.package-data]` takes what its patterns fit."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        patterns = tomllib.load(file)["tool"]["setuptools"]["package-data"]["*"]
    files = [
        path for floor in FLOORS for path in (ROOT / floor).rglob("*") if path.is_file() and path.suffix not in (".py", ".pyc", *LEFT_OUT)
    ]
    assert any(path.suffix == ".csv" for path in files) and any(path.suffix == ".toml" for path in files)

    def taken(path: Path) -> bool:
        package = next(folder for folder in path.parents if (folder / "__init__.py").is_file())
        # Folders of data without code, as runs/studies, are packages of their own to setuptools.
        return any(fnmatch(path.name, pattern) or fnmatch(path.relative_to(package).as_posix(), pattern) for pattern in patterns)

    assert [str(path.relative_to(ROOT)) for path in files if not taken(path)] == []


def test_what_a_wheel_lacks_is_named():
    source = ["tests/test_front.py", "macs/front.py", "problems/cases/front.csv", "runs/pictures/goddard.png", "README.md"]
    assert missing(source, ["macs/front.py"]) == ["problems/cases/front.csv"]
    assert missing(source, ["macs/front.py", "problems/cases/front.csv"]) == []


def test_what_is_pinned_suits_the_least_python():
    """A pin for a later Python than the README asks for ends `make run` on older ones, which this machine may not be."""
    pins = [Requirement(line) for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines() if "==" in line]
    # With `get`, also where another test has imported importlib_metadata: what it then finds raises KeyError for a key that is not there.
    needs = {canonicalize_name(one.metadata["Name"]): one.metadata.get("Requires-Python", "") for one in distributions()}
    pinned = {canonicalize_name(one.name) for one in pins} & needs.keys()
    assert len(pinned) > 50 and [name for name in sorted(pinned) if "3.11.0" not in SpecifierSet(needs[name])] == []


def test_the_floors_find_each_other_whatever_lies_beside_the_script(tmp_path):
    (tmp_path / "problems.py").write_text("mine = 1")
    (tmp_path / "transcription.py").write_text("mine = 1")

    def said(text: str) -> str:
        (tmp_path / "script.py").write_text(text)
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        return subprocess.run([sys.executable, "script.py"], cwd=tmp_path, env=environment, capture_output=True, text=True).stderr

    assert not said("from macs import MACS\nfrom problems import Problem\nfrom transcription import DFET")
    line = said("from problems import mine\nimport macs").splitlines()[-1]
    assert line.startswith("ImportError: ") and f"{tmp_path / 'problems.py'} hides" in line and "rename" in line


def test_what_runs_has_is_listed():
    assert {"Study", "hypervolume"} <= {*dir(runs)}
