"""The folder of a study, with outcomes written by hand: what counts as finished, what is refused, and what the table says."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from synthetic_fronts import black_box

from macs import NSGA2
from macs.fronts.files import to_bytes
from runs import Study
from runs.batch.store import Store
from runs.execution.task import RunOutcome, samples_path
from runs.files import from_record, to_record

FRONT = black_box(4)


@cache
def content() -> bytes:
    """Of the file of the front."""
    return to_bytes(FRONT)


def study(**changes) -> Study:
    given = {"problems": "welded_beam", "solvers": {"small": NSGA2(population=4), "large": NSGA2(population=8)}, "runs": 2, "seed": 1}
    return Study("by hand", **given | {"evaluations": 60} | changes)


@pytest.fixture
def store(tmp_path: Path):
    with Store.claim(tmp_path / "out", study().definition()) as claimed:
        yield claimed


def finish(store: Store, number: int = 0, seconds: float = 2.0, **more) -> None:
    """Keep the outcome of one of all runs."""
    outcome = RunOutcome("finished", front=content(), wall_time=seconds, **more)
    store.keep(list(store.runs())[number], outcome, {"macs.search": "1"})


def test_what_is_kept_is_found_again_and_all_else_is_missing(store):
    runs = list(store.runs())
    assert [(run.cell.solver, run.number, run.status) for run in runs] == [
        (solver, number, "missing") for solver in ("small", "large") for number in (1, 2)
    ]
    assert len({run.seed for run in runs}) == 4 and all(run.seed == run.cell.seed(1, run.number) for run in runs)
    assert (runs[0].finished, runs[0].message, runs[0].wall_time, runs[0].history) == (False, "", 0.0, {}) and not runs[0].path.exists()
    history = {"evaluations": [30, 60], "elapsed": [1.0, 2.0], "F": [[[1.0, 2.0]], [[0.5, 1.0]]]}
    finish(store, 1, seconds=3.5, message="as few as that", history=history)
    run = list(Store.open(store.path).runs())[1]
    assert (run.status, run.finished, run.wall_time, run.message, run.history) == ("finished", True, 3.5, "as few as that", history)
    assert np.array_equal(run.front.F, FRONT.F) and run.path.read_bytes() == content()
    summary = store.summary()
    assert (summary.name, summary.finished, summary.failed, summary.missing) == ("by hand", 1, 0, 3)
    assert [len(runs) for runs in summary.cells.values()] == [2, 2] and len(store.summary(3).runs) == 6


@pytest.mark.parametrize("status", ["crashed", "timeout", "out of memory", "killed"])
def test_what_failed_has_its_reason_and_no_front(store, status):
    store.keep(list(store.runs())[2], RunOutcome(status, message="no air", traceback="line 1", wall_time=1.0), {})
    run = list(store.runs())[2]
    assert (run.status, run.finished, run.message, run.traceback, run.path.exists()) == (status, False, "no air", "line 1", False)
    assert from_record(run.path.with_suffix(".json").read_bytes())["front"] is None
    summary = store.summary()
    assert (summary.finished, summary.failed, summary.missing) == (0, 1, 3)
    lines = str(summary).split("\n")
    assert lines[0] == "by hand: 0 of 4 runs finished" and lines[-1] == f"run 1 of {run.cell.name}: {status}: no air"


def test_a_finished_run_leaves_neither_checkpoint_nor_samples_and_a_failed_one_both(store):
    run = next(store.runs())
    checkpoint = store.checkpoint_path(run, "0a1b")
    assert checkpoint == run.path.with_suffix(".0a1b.checkpoint").absolute() and checkpoint.parent.is_dir()
    for path in (checkpoint, samples_path(checkpoint)):
        path.write_bytes(b"half")
    store.keep(run, RunOutcome("timeout"), {})
    assert checkpoint.exists() and samples_path(checkpoint).exists()
    finish(store)
    assert not checkpoint.exists() and not samples_path(checkpoint).exists()


def test_a_front_that_is_not_what_was_written_is_unreadable_and_kept_beside_a_new_one(store):
    finish(store)
    run = next(store.runs())
    damaged = run.path.read_bytes()[:-1] + b"\0"
    run.path.write_bytes(damaged)
    found = next(store.runs())
    assert found.status == "unreadable" and found.message == f"'{run.path}' is damaged: its content is not what was written"
    assert (store.summary().finished, store.summary().failed, store.summary().missing) == (0, 1, 3)
    finish(store)
    assert next(store.runs()).finished and run.path.with_name("0001.nc.unreadable").read_bytes() == damaged


def test_a_front_without_a_record_counts_if_it_can_be_read_and_a_record_without_a_front_is_no_run(store):
    finish(store, message="few")
    run = next(store.runs())
    record = run.path.with_suffix(".json")
    content = record.read_bytes()
    record.unlink()
    assert next(store.runs()).finished and next(store.runs()).history == {}
    run.path.write_bytes(b"nothing of the kind")
    assert next(store.runs()).status == "unreadable"
    record.write_bytes(content)
    assert b"few" in content
    run.path.unlink()
    assert next(store.runs()).status == "missing" and next(store.runs()).message == ""
    record.write_bytes(content.replace(b"2.0", b"3.0"))
    found = next(store.runs())
    assert found.status == "unreadable" and found.message.startswith(f"its record '{record}' is damaged")


def test_the_same_study_may_come_again_with_more_runs_or_solvers_and_never_has_fewer(tmp_path):
    for runs, latest, cells, more in ((3, 3, 1, {"solvers": {"small": NSGA2(population=4)}}), (1, 3, 2, {}), (3, 3, 2, {}), (4, 4, 2, {})):
        with Store.claim(tmp_path, study(runs=runs, **more).definition()) as store:
            assert store.definition["runs"] == latest and store.path == tmp_path
        again = Store.open(tmp_path)
        assert again.definition["runs"] == latest and len(list(again.runs())) == cells * latest and len(list(again.runs(1))) == cells


def test_a_folder_that_is_written_is_refused_to_others(store):
    with pytest.raises(ValueError, match=r"is being written by another process, [0-9]+ on "), Store.claim(store.path, study().definition()):
        pass


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"seed": 2}, "seed is 1 there and 2 here"),
        ({"start": "uniform"}, 'start is null there and "uniform" here'),
        ({"evaluations": 61}, "evaluations is 60 there and 61 here"),
        ({"solvers": {"small": NSGA2(population=4)}}, "large' is there but not here"),
        ({"solvers": {"small": NSGA2(population=6), "large": NSGA2(population=8)}}, "solver.settings.population is 4 there and 6 here"),
    ],
)
def test_another_study_is_refused_with_the_first_difference(store, changes, words):
    other = study(**changes).definition()
    with pytest.raises(ValueError) as refused:
        store.check(other)
    said = str(refused.value)
    assert said.startswith(f"'{store.path}' contains another study: ") and words in said and said.endswith("; give another folder")
    store.check(study(runs=7, time_limit=5.0).definition())  # which decides no number


def message(call) -> str:
    with pytest.raises(ValueError) as refused:
        call()
    return str(refused.value)


def test_folders_of_something_else_are_refused(tmp_path):
    def claim(out: Path) -> None:
        with Store.claim(out, study().definition()):
            pass

    for name in (".hidden", "b.txt", "a.txt"):
        (tmp_path / name).write_text("dear", encoding="utf-8")
    assert message(lambda: claim(tmp_path)) == f"'{tmp_path}' contains no study but other things, 'a.txt' for one; give a folder of its own"
    assert message(lambda: claim(tmp_path / "a.txt")) == f"'{tmp_path / 'a.txt'}' is not a folder"
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / ".hidden").touch()
    claim(tmp_path / "new")


def test_what_is_no_study_of_this_version_says_so(store):
    record = store.path / "study.json"
    content = from_record(record.read_bytes())
    for changes, words in (
        ({"format": "a diary"}, "it is not the record of a study"),
        ({"version": 1}, "another version of MACS wrote it (format 1, not 2): use that version"),
    ):
        record.write_bytes(to_record({**content, **changes}))
        assert message(lambda: Store.open(store.path)) == f"'{record}' cannot be read: {words}"
    cell = content["study"]["cells"][0]
    for details in (
        {},
        cell["details"] | {"solver": "x"},
        cell["details"] | {"solver": {"name": 5}},
        cell["details"] | {"transcription": 5},
    ):
        forged = content["study"] | {"cells": [cell | {"details": details}]}
        record.write_bytes(to_record(content | {"study": forged}))
        assert f"'{record}' cannot be read" in message(lambda: Store.open(store.path))
    record.unlink()
    for path, words in (
        (store.path, "contains no study: there is no study.json in it"),
        (store.path / "nowhere", "there is no folder"),
        (store.path / ".lock", "is not a folder"),
    ):
        said = message(lambda path=path: Store.open(path))
        assert words in said and f"'{path}'" in said


def test_the_table_counts_each_cell_and_lists_the_first_twenty_reasons(tmp_path):
    with Store.claim(tmp_path, study(runs=11).definition()) as store:
        for count, last in ((20, "run 9 of"), (22, "and 2 more")):
            for run in list(store.runs())[:count]:
                store.keep(run, RunOutcome("crashed"), {})
            lines = str(store.summary()).split("\n")
            large = next(line for line in lines if " large" in line).split()
            assert large[-4:] == ["0", str(count - 11), str(22 - count), "-"]
            assert sum(line.endswith(": crashed") for line in lines) == 20 and lines[-1].startswith(last)
