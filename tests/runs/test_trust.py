"""Files that name code, and files that are damaged: nothing of them is run, and none is read as other numbers."""

import random
import shutil
from pathlib import Path
from zlib import crc32

import pytest
from misbehaving import Plain
from test_study import Inline

from macs import Front
from macs.fronts.provenance import ProblemSource
from problems.catalogue import CASES, is_catalogued
from runs import Study
from runs.batch.store import Store
from runs.cli import main
from runs.files import from_record, to_record

MARK = "from pathlib import Path\nPath({mark!r}).touch()\ndef build(**data): Path({mark!r}).touch()\nreference = build\n"
TOML = 'solvers = ["macs"]\nruns = 1\nseed = 1\nevaluations = 50\n'


@pytest.fixture
def mark(here, monkeypatch) -> Path:
    """A file that exists as soon as code that only a file names has run; that code can be imported, and lies here."""
    monkeypatch.syspath_prepend(here)
    found = here / "it_ran"
    (here / "evil.py").write_text(MARK.format(mark=str(found)), encoding="utf-8")
    return found


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A finished study of two runs of a case of the catalogue."""
    out = tmp_path_factory.mktemp("made") / "out"
    solvers = {"plain": Plain(), "few": Plain(agents=4)}
    study = Study("made", problems="goddard", transcriptions="dfet:2x2", solvers=solvers, evaluations=50, runs=1, seed=1, verify=0.01)
    study.run(out, executor=Inline())
    return out


@pytest.fixture
def out(made, tmp_path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "out"))


ADDRESSES = ("evil.py:build", "evil:build", "os:system", "problems.cases.goddard:load", "problems.catalogue:load")


@pytest.mark.parametrize("address", ADDRESSES)
@pytest.mark.parametrize(
    "key",
    [
        'problems = "{}"',
        'problems = ["goddard", "{}"]',
        'problems = {{a = "{}"}}',
        'problems = {{a = {{problem = "{}", data = "touch it_ran"}}}}',
        'problems = "goddard"\nreference = "{}"',
        'problems = "goddard"\nreference = {{goddard = "{}"}}',
    ],
)
def test_a_study_file_runs_no_code_of_its_own(mark, refused, address, key):
    Path("study.toml").write_text(f"{key.format(address)}\n{TOML}", encoding="utf-8")
    said = refused("study", "run", "study.toml")
    assert f"study.toml: it names '{address}'" in said and "--trust" in said
    with pytest.raises(ValueError, match="trust=True"):
        Study.load("study.toml")
    assert not mark.exists() and not Path("out").exists()


def test_with_trust_it_does(mark):
    Path("study.toml").write_text(f'problems = "evil.py:build"\n{TOML}', encoding="utf-8")
    with pytest.raises(ValueError, match="must return a Problem"):
        Study.load("study.toml", trust=True)
    assert mark.exists()


def test_the_catalogue_needs_no_trust():
    assert all(is_catalogued(name) and is_catalogued(address) for name, (address, _) in CASES.items())
    assert not any(map(is_catalogued, ADDRESSES))


@pytest.mark.slow
@pytest.mark.parametrize("address", ADDRESSES)
def test_a_run_file_runs_no_code_of_its_own(mark, out, refused, address):
    path = next(out.rglob("*.nc"))
    front = Front.load(path)
    front.source = ProblemSource(front.source.name, front.source.fingerprint, address, {"command": "touch it_ran"})
    front.save(path)
    record = path.with_suffix(".json")
    forged = {**from_record(record.read_bytes()), "front": crc32(path.read_bytes()), "simulated": {}}
    record.write_bytes(to_record(forged))
    assert main(["study", "status", str(out)]) == 0
    said = refused("study", "report", str(out), "--no-figures")
    assert f"names '{address}'" in said and "--trust" in said and not mark.exists()


@pytest.mark.parametrize("reference", [*ADDRESSES, {"goddard": "evil:reference"}])
def test_a_definition_runs_no_code_of_its_own(mark, out, refused, reference):
    path = out / "study.json"
    content = from_record(path.read_bytes())
    content["study"]["reference"] = reference
    path.write_bytes(to_record(content))
    assert main(["study", "status", str(out)]) == 0
    assert "--trust" in refused("study", "report", str(out), "--no-figures") and not mark.exists()


@pytest.mark.parametrize(
    ("name", "path", "value"),
    [
        ("study.json", ("study", "cells"), [None]),
        ("study.json", ("study", "cells"), {"a": 1}),
        ("study.json", ("study", "verify"), "much"),
        ("study.json", ("study", "reference"), 7),
        ("study.json", ("study", "paper"), [{"of": "objectives", "rows": [{}]}]),
        ("study.json", ("study", "goal"), {"objective": 3}),
        ("study.json", ("study", "nominal"), ["x"]),
        ("study.json", ("version",), 1),
        ("0001.json", ("history", "F"), [[["touch it_ran"]]]),
        ("0001.json", ("simulated", "ends"), {"ascent": {"x": ["y"]}}),
        ("0001.json", ("status",), "well"),
        ("0001.json", ("front",), None),
    ],
)
def test_a_forged_record_is_one_line_or_an_unreadable_run(mark, out, refused, name, path, value):
    for file in out.rglob(name):
        content = from_record(file.read_bytes())
        inner = content
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = value
        file.write_bytes(to_record(content))
    said = refused("study", "report", str(out), "--no-figures")
    assert "Traceback" not in said and ("study.json" in said or "goal" in said or "0 of 2 runs finished" in said)


def corrupted(content: bytes, rng: random.Random) -> bytes:
    """Content with a byte flipped, its end cut off, or a block zeroed or written over another one."""
    data, kind = bytearray(content), rng.randrange(4)
    at, length = rng.randrange(len(data)), rng.randrange(1, 200)
    if kind == 0:
        data[at] ^= 1 << rng.randrange(8)
    elif kind == 1:
        del data[at:]
    elif kind == 2:
        data[at : at + length] = bytes(len(data[at : at + length]))
    else:
        start = rng.randrange(len(data))
        data[at : at + length] = data[start : start + length]
    return bytes(data)


def numbers(store: Store) -> list:
    runs = list(store.runs())
    return [store.definition, *((run.status, run.message, run.wall_time, run.history, run.simulated) for run in runs)]


def test_damaged_records_are_refused_or_the_same(made, tmp_path):
    out = Path(shutil.copytree(made, tmp_path / "out"))
    expected, rng = numbers(Store.open(out)), random.Random(1)
    files = [out / "study.json", *sorted(out.glob("*/*.json"))]
    refusals = 0
    for _ in range(300):
        file = rng.choice(files)
        content = file.read_bytes()
        file.write_bytes(corrupted(content, rng))
        try:
            found = numbers(Store.open(out))
        except ValueError as error:
            assert "\n" not in str(error)
            refusals += 1
        else:
            for ours, theirs in zip(found, expected, strict=True):
                assert ours == theirs or (ours[0] == "unreadable" and "is damaged" in ours[1])
            refusals += found != expected
        file.write_bytes(content)
    assert numbers(Store.open(out)) == expected and refusals > 270


def test_a_front_without_a_record_counts_whatever_it_names(mark, out):
    path = next(out.rglob("*.nc"))
    front = Front.load(path)
    front.source = ProblemSource(front.source.name, front.source.fingerprint, "evil:build", {})
    front.save(path)
    path.with_suffix(".json").unlink()
    assert [run.status for run in Store.open(out).runs()] == ["finished", "finished"] and not mark.exists()
    with pytest.raises(ValueError, match="names 'evil:build'"):
        _ = next(run for run in Store.open(out).runs() if run.path == path).front
