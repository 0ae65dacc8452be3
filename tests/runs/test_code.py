"""The code that a result depends on: what changes its digest, what it is of, and runs by other code in a study's folder."""

from concurrent.futures import Executor, Future
from dataclasses import replace

import pytest
from synthetic_fronts import black_box

from macs import MACS, NSGA2
from macs.fronts.files import to_bytes
from runs import Study
from runs.batch import code
from runs.execution.task import RunOutcome

FILES = {
    "macs/__init__.py": "from .search import find\n",
    "macs/search.py": """
from problems import Problem
if TYPE_CHECKING:
    from macs.far import far
def find():
    return 1
""",
    "macs/far.py": "",
    "macs/inner/level.py": "from macs import find\nimport numpy\n",
    "problems/__init__.py": "from .problem import Problem\nfrom .more import other\n",
    "problems/problem.py": "class Problem: ...\n",
    "problems/more.py": "",
}


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """Packages of a few modules, in a folder of their own each time."""

    def write(**changed: str) -> dict[str, str]:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        for name, text in (FILES | changed).items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)
        monkeypatch.setattr(code, "FLOORS", folder)
        return code.code_of(["macs.inner.level", "builtins"])

    return write


def test_code_is_of_the_modules_that_define_what_is_imported(tree):
    found = tree()
    assert list(found) == ["macs.inner.level", "macs.search", "problems.problem"], "neither types nor what packages only pass on"
    assert list(code.code_of(["macs.inner.level"], without=["macs.search"])) == ["macs.inner.level"]
    assert list(code.rooms(found)) == ["macs", "macs.inner", "problems"]
    same = tree(
        **{"macs/search.py": '"""Words."""\n' + FILES["macs/search.py"].replace("    return 1", '    """More."""  # why\n    return (1)')}
    )
    assert same == found
    other = tree(**{"macs/search.py": FILES["macs/search.py"].replace("return 1", "return 2")})
    assert code.changed(found, other) == ["macs.search"] and code.changed(code.rooms(found), code.rooms(other)) == ["macs"]
    assert code.digest_of_code(found) != code.digest_of_code(other)
    several = code.merged([found, other, {}])
    assert code.SEVERAL in several["macs.search"] and several["macs.inner.level"] == found["macs.inner.level"]
    assert several[code.UNKNOWN] == code.UNKNOWN


def test_what_runs_depend_on():
    study = Study("of three", problems="goddard", solvers={"MACS": MACS(), "NSGA-II": NSGA2(), "sweep": "sweep"}, runs=1, seed=1)
    with_gradients, without, sweep = (study.code(cell).keys() for cell in study.cells)
    assert {"macs.search.macs", "macs.gradients.polish", "problems.cases.goddard"} <= with_gradients
    assert {"macs.baselines.algorithms", "transcription.elements.dfet", "transcription.inner.newton", "problems.cases.goddard"} <= without
    assert not any(one.startswith(("macs.gradients", "macs.refinement", "macs.search", "problems.cases.reentry")) for one in without)
    assert "macs.gradients.scalarised" in sweep and "macs.search.macs" not in sweep
    beams = Study("without", problems="welded_beam", solvers="macs", evaluations=60, runs=1, seed=1)
    assert not any(one.startswith(("transcription", "macs.gradients")) for one in beams.code(beams.cells[0]))


class Written(Executor):
    """Ends every run with the same front, or a failure."""

    def __init__(self, status: str = "finished") -> None:
        self.status, self.made = status, 0

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        self.made += 1
        future.set_result(RunOutcome(self.status, front=to_bytes(black_box(4)) if self.status == "finished" else b""))
        return future


def test_runs_by_other_code_stay_unless_they_are_to_be_fresh(tmp_path, monkeypatch, caplog):
    study = Study("by hand", problems="welded_beam", solvers=NSGA2(population=4), evaluations=60, runs=2, seed=1)
    monkeypatch.setattr(Study, "code", lambda self, cell: {"macs.search": "1"})
    assert study.run(tmp_path / "out", executor=Written()).finished == 2 and not caplog.text
    more, now = replace(study, runs=3), Written()
    monkeypatch.setattr(Study, "code", lambda self, cell: {"macs.search": "2"})
    runs = more.run(tmp_path / "out", executor=now).runs
    assert now.made == 1 and [run.code["macs.search"] for run in runs] == ["1", "1", "2"]
    assert "2 of 3 runs are by other code (macs.search, ...); they stay" in caplog.text and "--fresh" in caplog.text
    fresh = Written()
    runs = more.run(tmp_path / "out", executor=fresh, fresh=True).runs
    assert fresh.made == 2 and [run.code["macs.search"] for run in runs] == ["2", "2", "2"] and all(run.finished for run in runs)
    monkeypatch.setattr(Study, "code", lambda self, cell: {"macs.search": "3"})
    failed = more.run(tmp_path / "out", executor=Written("crashed"), fresh=True)
    assert failed.count("crashed") == 3 and not list((tmp_path / "out").rglob("*.nc")), "no old front stands for a run that failed"
