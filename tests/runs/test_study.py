import errno
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from kills import children
from misbehaving import Crashing, Dying, Faltering, Hanging, Hungry, Plain, Slow, glide

from runs import Study
from runs.batch.store import Store
from runs.execution.task import RunOutcome, perform
from runs.report.report import Report
from transcription import DFET

HERE = Path(__file__).parent
KEEP = {"problems": {"glide": glide()}, "solvers": {"plain": Plain()}, "runs": 3, "seed": 1, "evaluations": 60}


def study(**changes) -> Study:
    return Study("glides", **(KEEP | changes))


def numbers(summary) -> dict:
    """All that must not depend on who made a run, or when."""
    return {
        (run.cell.folder, run.number): (
            run.front.F.tolist(),
            [point.decision.tolist() for point in run.front],
            run.front.stats["seed"],
            run.front.stats["evaluations"],
            run.history.get("F"),
        )
        for run in summary.runs
        if run.finished
    }


class Inline(Executor):
    """Makes runs here and now: no process has to start."""

    def submit(self, function, task):
        future = Future()
        future.set_result(perform(task))
        return future


def stamps(folder: Path) -> dict[Path, tuple[int, int]]:
    return {path: (path.stat().st_mtime_ns, path.stat().st_ino) for path in folder.rglob("*.nc")}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A finished study of three runs."""
    folder = tmp_path_factory.mktemp("made") / "out"
    return folder, study().run(folder, jobs=2)


def test_every_run_leaves_its_front_its_seed_and_how_it_converged(made):
    folder, summary = made
    assert summary.finished == 3 and summary.failed == summary.missing == 0
    assert len({run.seed for run in summary.runs}) == 3
    for run in summary.runs:
        assert run.front.stats["seed"] == run.seed and run.front.stats["evaluations"] <= 60
        counts = run.history["evaluations"]
        assert counts == sorted(counts) and counts[-1] == run.front.stats["evaluations"] and len(counts) <= 32
        assert np.array_equal(run.history["F"][-1], run.front.F)
        assert {len(column) for column in run.history.values()} == {len(counts)}
        assert run.wall_time > 0 and run.history["elapsed"][-1] <= run.wall_time
    assert not list(folder.rglob("*.part"))
    run = made[1].runs[1]
    front = Plain().solve(glide(), DFET(2, 2), evaluations=60, seed=run.seed)
    assert np.array_equal(front.F, run.front.F)
    assert all(np.array_equal(a.decision, b.decision) for a, b in zip(front, run.front, strict=True))


def test_finished_runs_are_neither_made_again_nor_touched_and_more_may_be_added(made):
    folder, summary = made
    before, known = stamps(folder), numbers(summary)
    again = study().run(folder)
    assert stamps(folder) == before and numbers(again) == known
    more = study(runs=4).run(folder, executor=Inline())
    assert more.finished == 4 and {path: stamps(folder)[path] for path in before} == before
    assert known.items() <= numbers(more).items()
    # Fewer are no other study either.
    assert len(study().run(folder).runs) == 3 and len(list(Store.open(folder).runs())) == 4


@pytest.mark.slow
def test_the_runs_of_some_solvers_first(tmp_path):
    batch = study(solvers={"plain": Plain(), "other": Plain()}, runs=1)
    some = batch.run(tmp_path / "out", executor=Inline(), solvers=["other"])
    assert [(run.cell.solver, run.status) for run in some.runs] == [("plain", "missing"), ("other", "finished")]
    both = batch.run(tmp_path / "out", executor=Inline())
    assert both.finished == 2 and numbers(some).items() <= numbers(both).items()
    for wrong, words in ((["plane"], "unknown solver 'plane', did you mean plain"), ("plain", "must be a sequence of labels, not 'plain'")):
        with pytest.raises(ValueError, match=words):
            batch.run(tmp_path / "new", solvers=wrong)
    assert not (tmp_path / "new").exists()


def test_numbers_do_not_depend_on_who_makes_the_runs(made, tmp_path):
    here = study().run(tmp_path / "here", executor=Inline())
    with ThreadPoolExecutor(1) as threads:
        apart = study(runs=1).run(tmp_path / "threads", executor=threads)
    expected = numbers(made[1])
    assert here.finished == 3 and numbers(here).items() <= expected.items() and numbers(apart).items() <= expected.items()


def test_seeds_depend_on_labels_and_number_alone():
    one = study().cells[0]
    several = study(solvers={"other": Plain(agents=5), "plain": Plain()}, transcriptions=["dfet:2x2", "dfet:3x2"], runs=9)
    same = [cell for cell in several.cells if cell.labels == one.labels]
    assert [cell.seed(1, 2) for cell in same] == [one.seed(1, 2)]
    seeds = {cell.seed(1, run) for cell in several.cells for run in range(1, 10)}
    assert len(seeds) == 4 * 9 and all(0 <= seed < 2**63 for seed in seeds)
    assert one.seed(1, 1) != one.seed(2, 1) and one.seed(1, 1) == 9144903288234304347
    for given in (None, "dfet:2x2", DFET(2, 2), [DFET(2, 2)], {"glide": DFET(2, 2)}):
        assert study(transcriptions=given).cells[0].labels == ("glide", "dfet:2x2", "plain")


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    """Seconds after which a run is late: several times what one takes here and now, so that none is that does not hang."""
    (run,) = study(runs=1).run(tmp_path_factory.mktemp("timely") / "out").runs
    assert run.finished
    return max(4.0, 10.0 * run.wall_time)


@pytest.mark.slow
def test_failures_are_recorded_with_their_traceback_and_stop_no_other_run(late, tmp_path):
    solvers = {"crash": Crashing(), "hang": Hanging(), "hungry": Hungry(), "dead": Dying(), "once": Dying(once=str(tmp_path / "died"))}
    summary = study(solvers={**solvers, "plain": Plain()}, runs=1, time_limit=late).run(tmp_path / "out")
    status = {cell.solver: [run.status for run in runs] for cell, runs in summary.cells.items()}
    assert status == {
        "crash": ["crashed"],
        "hang": ["timeout"],
        "hungry": ["out of memory"],
        "dead": ["killed"],
        "once": ["finished"],  # one whose process is killed is begun once more
        "plain": ["finished"],
    }
    run = {run.cell.solver: run for run in summary.runs}
    assert run["crash"].message == "ArithmeticError: the root of all evil" and "misbehaving.py" in run["crash"].traceback
    assert f"more than {late:g} s" in run["hang"].message and "misbehaving.py" in run["hang"].traceback
    assert run["hang"].wall_time >= late
    assert "SIGKILL" in run["dead"].message and "memory" in run["dead"].message
    with pytest.raises(FileNotFoundError):
        _ = run["dead"].front
    text = str(summary)
    assert "2 of 6 runs finished" in text and "run 1 of glide, dfet:2x2, crash: crashed: ArithmeticError: the root of all evil" in text


def test_what_was_killed_or_late_is_made_again_and_what_crashed_if_asked(tmp_path):
    batch, statuses, asked = study(runs=6), ("crashed", "timeout", "out of memory", "killed", "missing"), []
    with Store.claim(tmp_path, batch.definition()) as store:
        runs = list(store.runs())
        for run, status in zip(runs, statuses[:-1], strict=False):
            store.keep(run, RunOutcome(status), {})
        runs[5].path.write_bytes(b"damaged")

    class Asked(Executor):
        def submit(self, function, task):
            asked.append(next(run.number for run in runs if run.seed == task.seed))
            future = Future()
            future.set_result(RunOutcome("crashed"))
            return future

    batch.run(tmp_path, executor=Asked())
    assert asked == [2, 3, 4, 5, 6]
    batch.run(tmp_path, executor=Asked(), retry=True)
    assert asked[5:] == [1, 2, 3, 4, 5, 6]


@pytest.mark.slow
def test_a_full_disk_is_told_and_costs_nothing_that_is_finished(tmp_path, monkeypatch):
    import runs.batch.store as store

    real = store.write_whole
    written = []

    def full(path, content):
        if str(path).endswith(".nc"):
            if written:
                raise OSError(errno.ENOSPC, f"cannot write '{path}': No space left on device")
            written.append(path)
        real(path, content)

    monkeypatch.setattr(store, "write_whole", full)
    with pytest.raises(OSError, match=r"cannot write '.*0002\.nc': No space left"):
        study().run(tmp_path / "out", executor=Inline())
    before = stamps(tmp_path)
    assert len(before) == 1
    monkeypatch.setattr(store, "write_whole", real)
    assert study().run(tmp_path / "out", executor=Inline()).finished == 3 and before.items() <= stamps(tmp_path).items()


@pytest.mark.parametrize("damaged", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_run_goes_on_where_it_was(tmp_path, damaged):
    batch = study(solvers={"faltering": Faltering(folder=str(tmp_path))}, runs=1, evaluations=200)
    spent = tmp_path / "spent"
    whole = batch.run(tmp_path / "whole", executor=Inline())
    assert not list((tmp_path / "whole").rglob("*.checkpoint")) and not list((tmp_path / "whole").rglob("*.samples"))
    (tmp_path / "obstacle").touch()
    assert batch.run(tmp_path / "halved", executor=Inline()).count("crashed") == 1
    (kept,) = (tmp_path / "halved").rglob("*.checkpoint")
    if damaged:
        kept.write_bytes(kept.read_bytes()[:-100])
    spent.unlink()
    halved = batch.run(tmp_path / "halved", executor=Inline(), retry=True)
    counts = [int(word) for word in spent.read_text().split()]
    assert counts[0] < 100 if damaged else counts[0] >= 100
    assert numbers(halved) == numbers(whole)
    histories = [{**summary.runs[0].history, "elapsed": None, "cpu": None} for summary in (halved, whole)]
    assert histories[0] == histories[1]
    assert not list((tmp_path / "halved").rglob("*.checkpoint")) and not list((tmp_path / "halved").rglob("*.samples"))


SCRIPT = """
import signal, sys
# A shell that starts the tests in the background makes all its children ignore SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.path.insert(0, {here!r})
from test_study import slow
slow().run("out", jobs=2)
"""


def slow(runs: int = 60) -> Study:
    """More runs than anyone waits for."""
    return study(solvers={"slow": Slow()}, runs=runs, evaluations=60)


def started(folder: Path) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-c", SCRIPT.format(here=str(HERE))], cwd=folder, stderr=subprocess.PIPE, text=True)


def wait_for(condition, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.02)


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.slow
@pytest.mark.parametrize("number", ["SIGINT", "SIGKILL"])
def test_a_study_that_is_ended_takes_its_workers_along_and_keeps_what_is_finished(tmp_path, number):
    """That it goes on with the same numbers: see `test_kills`."""
    coordinator = started(tmp_path)
    wait_for(lambda: len(stamps(tmp_path)) >= 1)
    with pytest.raises(ValueError, match="another process"):  # while the first one lives
        slow().run(tmp_path / "out")
    workers = children(coordinator.pid)
    coordinator.send_signal(getattr(signal, number))
    _, said = coordinator.communicate(timeout=20)
    assert ("KeyboardInterrupt" in said) == (number == "SIGINT")
    before = stamps(tmp_path)
    assert workers and (number == "SIGKILL" or not any(map(alive, workers)))
    wait_for(lambda: not any(map(alive, workers)))
    assert stamps(tmp_path) == before and {run.status for run in slow().status(tmp_path / "out").runs} == {"finished", "missing"}


WRONG = (
    ({"runs": 0}, "runs must be a whole number of at least 1"),
    ({"runs": True}, "runs"),
    ({"seed": -1}, "seed"),
    ({"evaluations": 0}, "evaluations must be a whole number"),
    ({"evaluations": {"glider": 10}}, "unknown problem in evaluations 'glider'"),
    ({"solvers": "mac"}, "did you mean macs"),
    ({"solvers": {"a": {"solver": "macs", "agent": 10}}}, "setting of solver 'macs' 'agent', did you mean agents"),
    ({"solvers": {"a": {"solver": "macs", "agents": 1}}}, "agents must be"),
    ({"solvers": []}, "solvers: there are none"),
    ({"solvers": [Plain(), Plain(agents=5)]}, "'plain' is there twice"),
    ({"problems": "godard"}, "did you mean 'goddard'"),
    ({"problems": {"a": 7}}, "'a' must be a name"),
    ({"transcriptions": "dfat:4x6"}, "unknown transcription 'dfat:4x6'"),
    ({"transcriptions": {"glide": "dfet:2x2", "other": "dfet:2x2"}}, "unknown problem in transcriptions 'other'"),
    ({"transcriptions": 3}, "must be a word such as dfet:4x6"),
    ({"inner": "autos"}, "unknown inner level 'autos', did you mean auto?"),
    ({"tolerance": 0}, "tolerance must be a positive number"),
    ({"time_limit": "long"}, "time_limit must be a positive number"),
    ({"start": "smoth"}, "unknown start 'smoth', did you mean smooth?"),
    ({"start": {"spred": 0.1}}, "unknown setting of start 'spred', did you mean spread?"),
    ({"start": {"spread": 2}}, "Smooth: spread must be in (0, 1], not 2"),
    ({"start": [1.0]}, "start must be 'uniform', 'smooth', or a table"),
    *(({"name": name}, "its name is that of a folder") for name in ("../evil", "..", "a\\b", "a\0b")),
)


def test_a_definition_that_makes_no_sense_is_refused_in_its_own_words():
    for changes, words in WRONG:
        with pytest.raises(ValueError) as refused:
            Study(**{"name": "glides"} | KEEP | changes)
        assert words in str(refused.value) and ("study 'glides'" in str(refused.value) or "name" in changes), changes


def test_what_other_processes_cannot_have_is_refused_before_any_work(monkeypatch):
    monkeypatch.setattr(Plain, "__module__", "__main__")
    with pytest.raises(ValueError, match="cannot import Plain from a script"):
        study()


def test_a_study_and_its_report_print_on_one_line():
    shown = repr(study())
    assert shown.startswith("Study(name='glides'") and "\n" not in shown and "time_limit" not in shown
    assert repr(Report("a table\nof two lines", (Path("report.txt"),))) == "<Report: 1 file>"
