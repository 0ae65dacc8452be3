import os
import subprocess
import sys

import pytest
from statements import refused

from problems import Problem, describe, is_catalogued, load, names
from transcription import stated

CASE = """
from __future__ import annotations

from dataclasses import dataclass

from problems import Problem

@dataclass
class Data:
    mass: float = 2.0

def problem(mass: float = 2.0, name: str = "mine"):
    data = Data(mass)
    problem = Problem(name)
    phase = problem.phase("hop", t0=0, tf=(1, 2))
    x = phase.state("x", bounds=(0, 10), initial=0)
    phase.dynamics(x=1 / data.mass)
    problem.minimize("time", phase.tf)
    problem.maximize("distance", phase.final(x))
    return problem

def broken():
    raise TypeError("inside")

number = 3

def nothing():
    return None
"""


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "my case.py"
    path.write_text(CASE)
    return path


@pytest.mark.parametrize("name", [name for name in names() if isinstance(load(name), Problem)])
def test_every_case_loads_compiles_and_names_its_defaults(name):
    problem = load(name)
    assert isinstance(problem, Problem)
    assert problem.name == name.removeprefix("standard/") and problem.address == name
    assert len(problem.compile().goals) >= (1 if name.startswith(("betts", "standard/")) else 2)
    assert describe(name) and "\n" not in describe(name)
    stated(problem.default_transcription or "dfet:8x3:bernstein").transcribe(problem)
    assert problem.default_evaluations > 0 and problem.default_verify > 0
    assert load(name).compile().fingerprint == problem.compile().fingerprint


def test_unknown_names_are_told_what_there_is():
    refused(lambda: load("godard"), "godard", "goddard")
    refused(lambda: load(""), "goddard")
    refused(lambda: load("problems.cases.goddard"), "problems.cases.goddard")
    refused(lambda: load("no.such.module:f"), "no.such.module")
    refused(lambda: load(".relative:f"), ".relative")
    refused(lambda: load("problems.cases.goddard:nothing"), "problems.cases.goddard", "nothing")
    refused(lambda: load("problems.cases.goddard:"), "problems.cases.goddard")
    refused(lambda: load("missing.py:problem"), "missing.py")


def test_a_case_from_a_file(case, monkeypatch):
    problem = load(f"{case}:problem", mass=4.0)
    assert problem.name == "mine" and problem.data == {"mass": 4.0}
    assert load(problem.address, **problem.data).compile().fingerprint == problem.compile().fingerprint
    monkeypatch.chdir(case.parent)
    relative = load(f"{case.name}:problem")
    monkeypatch.chdir("/")
    assert load(relative.address).name == "mine", "the address is found from another folder"
    first = load(f"{case}:problem").compile().fingerprint
    case.write_text(CASE.replace("bounds=(0, 10)", "bounds=(0, 123456)"))
    os.utime(case, (1, 1))
    assert load(f"{case}:problem").compile().fingerprint != first


def test_files_of_the_same_name_do_not_disturb_each_other(case, tmp_path):
    other = tmp_path / "other" / case.name
    other.parent.mkdir()
    other.write_text(CASE.replace('"mine"', '"other"'))
    assert load(f"{case}:problem").name == "mine" and load(f"{other}:problem").name == "other"
    assert load(f"{case}:problem").name == "mine"
    (case.parent / "beside_the_case.py").write_text("from problems import Problem\n")
    case.write_text("from beside_the_case import Problem\n" + CASE.replace("from __future__ import annotations", ""))
    assert load(f"{case}:problem").name == "mine" and str(case.parent) not in sys.path


def test_what_is_no_case_is_refused(case):
    refused(lambda: load(f"{case}:nothing"), "nothing", "NoneType")
    refused(lambda: load(f"{case}:number"), "number")
    refused(lambda: load(f"{case}:absent"), "absent")
    refused(lambda: load(f"{case}:problem", weight=1), "weight")
    refused(lambda: load("goddard", mass=1), "goddard", "mass")
    with pytest.raises(TypeError, match="inside"):
        load(f"{case}:broken")
    case.write_text("def problem(:\n")
    refused(lambda: load(f"{case}:problem"), "my case.py", "Python")
    assert not [name for name in sys.modules if "my case" in name and sys.modules[name].__file__ == str(case)]


@pytest.mark.parametrize(
    ("address", "data", "word"),
    [
        ("os:system", {"command": "touch {}"}, "'os' is of Python's own library"),
        ("subprocess:run", {"args": ["touch", "{}"]}, "Python's own library"),
        ("shutil:rmtree", {"path": "{}"}, "Python's own library"),
        ("numpy:savetxt", {"fname": "{}", "X": [1]}, "has no function 'savetxt' of its own"),
        ("numpy.ma.core:array", {"data": [1]}, "'array' is not known to return a Problem; annotate it with '-> Problem'"),
        ("problems.problem:Problem", {}, "has no function 'Problem' of its own"),
        ("problems.cases.goddard:Problem", {}, "has no function 'Problem' of its own"),
        ("problems.cases.goddard:reference", {}, "'reference' is not known to return a Problem"),
    ],
)
def test_nothing_is_called_that_makes_no_problem(address, data, word, tmp_path):
    there, trace = tmp_path / "there", tmp_path / "trace"
    there.mkdir()
    target = str(there if address == "shutil:rmtree" else trace)
    data = {key: value.format(target) if isinstance(value, str) else value for key, value in data.items()}
    refused(lambda: load(address, **data), word)
    assert there.is_dir() and not trace.exists()


def test_a_function_of_a_file_is_called_only_if_it_is_defined_there_and_says_nothing_else(case):
    imports = "from os import system\nfrom problems.cases.goddard import problem as other\n"
    case.write_text(CASE + imports + "def count() -> int:\n    return 1\ndef mine() -> 'Problem':\n    return problem()\n")
    refused(lambda: load(f"{case}:system", command="true"), "has no function 'system' of its own")
    refused(lambda: load(f"{case}:other"), "has no function 'other' of its own")
    refused(lambda: load(f"{case}:count"), "'count' is not known to return a Problem")
    refused(lambda: load(f"{case}:Data"), "has no function 'Data'")
    assert load(f"{case}:mine").name == "mine"


@pytest.mark.parametrize(
    ("former", "case"),
    [
        ("problems.cases.standard.curves.brachistochrone:problem", "standard/brachistochrone"),
        ("problems.cases.reentry.case2:problem", "reentry_case2"),
        ("problems.cases.reentry.cases:case3", "reentry_case3"),
        ("problems.cases.skip_entry.smv:problem", "smv"),
        ("problems.cases.aerocapture.codesign.case:problem", "aerocapture_codesign"),
        ("problems.cases.betts_heating:problem", "betts_heating"),
        ("problems.cases.welded_beam:problem", "welded_beam"),
    ],
)
def test_addresses_of_former_releases_load(former, case):
    """Saved fronts may carry them."""
    assert load(former).compile().fingerprint == load(case).compile().fingerprint and is_catalogued(former)


def test_addresses_whose_code_is_our_own():
    assert all(is_catalogued(name) for name in names()) and is_catalogued("problems.cases.goddard:problem")
    assert not any(
        is_catalogued(word)
        for word in ("", "problems.cases.goddard:reference", "case.py:problem", "os:system", "problems.cases.standard.a.b:problem")
    )


def test_naming_the_cases_is_quick_and_quiet():
    code = "import sys, problems; assert problems.names(); print(*(m for m in ('matplotlib', 'xarray', 'scipy.stats') if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "" and done.stderr == ""
