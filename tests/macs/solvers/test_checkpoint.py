"""Runs that end before their time and go on from a checkpoint: they end with the bits of runs that never stopped."""

import errno
import logging
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from compiled_cases import compiled

from macs import CTAEA, MACS, MOEAD, MOPSO, MOPSOCD, NSGA2, NSGA3, RVEA, SMSEMOA, Front
from macs.evaluation import bilevel
from macs.gradients import polish
from macs.io.workers import TOGETHER
from macs.search.settings import Variant
from macs.solvers import checkpoint
from macs.solvers.packing import encode
from macs.solvers.solver import Solver
from transcription import DFET
from transcription.inner import Ipopt
from transcription.nlp.scalarized import Solved

MESH = DFET(3, 2)
BOX = [(0.0, 1.0)] * 5
SMALL = MACS(agents=4, archive=6)
POLISHED = MACS(agents=4, archive=6, polish_every=4, mesh="fixed")


def function(X: np.ndarray) -> np.ndarray:
    g = 1 + X[:, 1:].sum(axis=1)
    return np.stack([X[:, 0], g * (1 - np.sqrt(X[:, 0] / g))], axis=1)


def minimize(solver: Solver = SMALL, box: Any = BOX, f: Any = function, evaluations: int = 400, seed: int | None = 1, **more: Any) -> Front:
    return solver.minimize(f, box, evaluations=evaluations, seed=seed, **more)


def solve(solver: Solver = POLISHED, evaluations: int = 160, seed: int | None = 1, problem: str = "orbit_rise", **more: Any) -> Front:
    """With the inner level that begins without gradient solves: those that are counted are of the polish."""
    more = {"mesh": MESH, "inner": "projection"} | more
    return solver.solve(compiled(problem), more.pop("mesh"), evaluations=evaluations, seed=seed, **more)


def plain(array: np.ndarray) -> Any:
    """An array as a file has it."""
    return msgspec.msgpack.decode(encode(array))


uninterrupted, solved = cache(minimize), cache(solve)


def after(iterations: int) -> Any:
    """A callback that ends the run after so many iterations."""
    left = iter(range(iterations))
    return lambda progress: next(left, None) is None


def assert_same(front: Front, other: Front) -> None:
    assert front.F.tobytes() == other.F.tobytes() and front.F.shape == other.F.shape
    assert front.decision.tobytes() == other.decision.tobytes()
    assert [point.optimality for point in front] == [point.optimality for point in other]
    assert {**front.stats, "wall_time": 0} == {**other.stats, "wall_time": 0}


class Counted:
    """A function that counts its rows, and may fail in the middle."""

    def __init__(self, fails_after: float = np.inf) -> None:
        self.rows, self.fails_after = 0, fails_after

    def __call__(self, X: np.ndarray) -> np.ndarray:
        self.rows += len(X)
        if self.rows > self.fails_after:
            raise RuntimeError("the licence server is down")
        return function(X)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "run.ckpt"


SOLVERS = [
    SMALL,
    NSGA2(population=12),
    NSGA3(divisions=11),
    MOEAD(divisions=11),
    MOEAD(divisions=11, batch=True),
    MOPSOCD(particles=12),
    MOPSO(particles=12),
    SMSEMOA(population=12),
    RVEA(divisions=11),
    CTAEA(divisions=11),
]


@pytest.mark.slow
@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("constraints", [None, lambda X: 0.5 - X[:, :1]], ids=["free", "constrained"])
def test_a_black_box_goes_on_to_the_same_bits(file, solver, constraints) -> None:
    given = {"evaluations": 150, "constraints": constraints}
    whole = minimize(solver, **given)
    for iterations in (0, 2):
        counted = Counted()
        stopped = minimize(solver, f=counted, checkpoint=file, callback=after(iterations), **given)
        assert stopped.stats["stopped"] == "callback" and stopped.stats["evaluations"] == counted.rows
        resumed = Counted()
        rest = minimize(solver, f=resumed, checkpoint=file, **given)
        assert_same(rest, whole)
        assert counted.rows + resumed.rows == 150 and rest.stats["wall_time"] > stopped.stats["wall_time"]
        file.unlink()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solver", "evaluations", "iterations"),
    [
        (MACS(agents=4, archive=6, variant=Variant(refine_every=25)), 160, 4),
        (MACS(agents=4, archive=6, refine=False), 160, 4),
        (MOPSO(particles=6), 30, 1),
    ],
    ids=str,
)
def test_a_trajectory_problem_goes_on_to_the_same_bits(file, solver, evaluations, iterations) -> None:
    part = solve(solver, evaluations, checkpoint=file, callback=after(iterations))
    assert part.stats["stopped"] == "callback" and bool(part.stats["gradient_solves"]) == getattr(solver, "refine", False)
    assert_same(solve(solver, evaluations, checkpoint=file), solve(solver, evaluations))


def test_a_checkpoint_changes_no_bit_and_a_finished_one_needs_no_evaluations(file, monkeypatch) -> None:
    monkeypatch.setattr(checkpoint, "WRITE_SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "WRITE_SHARE", 0.0)
    first, counted = minimize(checkpoint=file), Counted()
    assert_same(first, uninterrupted())
    again = minimize(checkpoint=file, f=counted)
    assert counted.rows == 0
    assert_same(again, first)
    assert again.stats["wall_time"] == pytest.approx(first.stats["wall_time"], abs=0.5)


@pytest.mark.slow
def test_a_finished_search_is_not_polished_twice(file, monkeypatch) -> None:
    solve(checkpoint=file)
    whole = solved()
    monkeypatch.setattr(polish, "polish", lambda *_, **__: pytest.fail("polished again"))
    assert_same(solve(checkpoint=file), whole)


class Solving:
    """Counts the gradient solves; within the one of a certain number something happens."""

    def __init__(self, patch: pytest.MonkeyPatch, number: int = 0, happens: Callable[[], None] = lambda: None) -> None:
        self.count, self._number, self._happens, self._solve = 0, number, happens, bilevel.scalarize
        patch.setattr(bilevel, "scalarize", self)

    def __call__(self, *arguments: Any, **more: Any) -> Solved:
        found = self._solve(*arguments, **more)
        self.count += found.begun
        if found.begun and self.count == self._number:
            self._happens()
        return found


def fails() -> None:
    raise MemoryError("killed")


def press() -> None:
    os.kill(os.getpid(), signal.SIGINT)


SOLVES = [1, 9, 20]
"""Gradient solves within which a polish is stopped: of the ends, of the places between them, and late."""


@pytest.mark.slow
@pytest.mark.parametrize("number", SOLVES)
def test_killed_in_the_polish(file, monkeypatch, number) -> None:
    whole = solved()  # before anything is counted
    with monkeypatch.context() as patch, pytest.raises(MemoryError):
        Solving(patch, number, fails)
        solve(checkpoint=file)
    with monkeypatch.context() as patch:
        solving = Solving(patch)
        assert_same(solve(checkpoint=file), whole)
    left = whole.stats["gradient_solves"] - (number - 1)  # that one was not finished
    assert left <= solving.count < left + TOGETHER  # a batch that was cut short is made again


@pytest.mark.slow
@pytest.mark.parametrize("number", SOLVES)
@pytest.mark.parametrize("kept", [True, False])
def test_interrupted_in_the_polish(file, monkeypatch, number, kept) -> None:
    whole = solved()  # before anything is counted
    with monkeypatch.context() as patch:
        Solving(patch, number, press)
        part = solve(checkpoint=file if kept else None)
    assert part.stats["stopped"] == "interrupted" and not part.stats["reproducible"]
    assert part.stats["gradient_solves"] == number and len(part)
    if kept:
        with monkeypatch.context() as patch:
            solving = Solving(patch)
            assert_same(solve(checkpoint=file), whole)
        left = whole.stats["gradient_solves"] - number
        assert left <= solving.count < left + TOGETHER  # a batch that was cut short is made again


@pytest.mark.slow
def test_interrupted_within_the_last_solve(file, monkeypatch) -> None:
    with monkeypatch.context() as patch:
        Solving(patch, solved().stats["gradient_solves"], press)
        front = solve(checkpoint=file)
    assert front.stats["stopped"] == "budget"  # there was nothing left to interrupt
    assert np.array_equal(front.F, solved().F)
    assert all(point.optimality is None for point in front), "who interrupts does not want to wait for certificates"
    assert_same(solve(checkpoint=file), solved())


@pytest.mark.slow
def test_what_an_interrupt_cut_short_is_done_again(file, monkeypatch) -> None:
    """Ctrl-C within a batch of IPOPT's solves leaves some of them undone; they must not be taken for failures when the run goes on."""
    settings = {"problem": "goddard", "evaluations": 60, "inner": "ipopt", "solver": MACS(agents=4, archive=6, refine=False)}
    inside, calls = Ipopt._solve_all, []

    def press(self, nlp, start, guess, tolerance):
        calls.append(len(start))
        if len(calls) == 6:
            os.kill(os.getpid(), signal.SIGINT)
        return inside(self, nlp, start, guess, tolerance)

    with monkeypatch.context() as patch:
        patch.setattr(Ipopt, "_solve_all", press)
        part = solve(**settings, checkpoint=file)
    assert part.stats["stopped"] == "interrupted" and part.stats["failures"].get("timeout")
    rest = solve(**settings, checkpoint=file)
    assert rest.stats["reproducible"]
    assert_same(rest, solve(**settings))


def test_a_first_population_that_was_cut_short_is_not_kept(file) -> None:
    solve(problem="goddard", inner="ipopt", checkpoint=file, time_limit=1e-9)
    assert not file.exists()


def test_a_time_limit_counts_from_each_call(file) -> None:
    for _ in range(2):
        assert minimize(evaluations=10**6, checkpoint=file, time_limit=0.3).stats["stopped"] == "time limit"
    # Of the last call alone it is next to nothing.
    assert minimize(evaluations=10**6, checkpoint=file, callback=after(0)).stats["wall_time"] > 0.3


def test_an_error_in_the_users_function_loses_nothing(file) -> None:
    part = minimize(checkpoint=file, f=Counted(fails_after=250))
    assert part.stats["stopped"] == "failed" and "the licence server is down, at" in part.stats["first_failure"]
    counted, whole = Counted(), uninterrupted().stats["evaluations"]
    rest = minimize(checkpoint=file, f=counted)
    assert rest.stats["stopped"] == "budget" and counted.rows == whole - part.stats["evaluations"]


@dataclass(frozen=True)
class Stuck(MACS):
    """Has nothing left to try after the third iteration."""

    def advance(self, state, evaluator, budget) -> None:
        if state.iteration < 3:
            super().advance(state, evaluator, budget)


def test_idle_iterations_are_counted_on(file) -> None:
    part = minimize(Stuck(agents=4, archive=6), checkpoint=file, callback=after(50))
    assert part.stats["stopped"] == "callback"
    left = []
    rest = minimize(Stuck(agents=4, archive=6), checkpoint=file, callback=left.append)
    assert rest.stats["stopped"] == "idle" and len(left) == 100 + 3 - 51
    assert_same(rest, minimize(Stuck(agents=4, archive=6)))


def test_a_drawn_seed_is_taken_over(file) -> None:
    part = minimize(seed=None, checkpoint=file, callback=after(3))
    rest = minimize(seed=None, checkpoint=file)
    assert rest.stats["seed"] == part.stats["seed"]
    assert_same(rest, minimize(seed=part.stats["seed"]))


def test_a_start_goes_on_too(file) -> None:
    start = minimize(seed=2, evaluations=100)
    minimize(start=start, checkpoint=file, callback=after(2))
    assert_same(minimize(start=start, checkpoint=file), minimize(start=start))
    with pytest.raises(ValueError, match="start is"):
        minimize(checkpoint=file)


SCRIPT = """
import sys, time
import numpy as np
from macs import MACS, MOPSO
from macs.search.settings import Variant
from macs.solvers import checkpoint

checkpoint.WRITE_SECONDS = checkpoint.WRITE_SHARE = 0.0

def function(X):
    with open("log", "a") as log:
        log.write("x" * len(X))
    time.sleep(0.002)
    g = 1 + X[:, 1:].sum(axis=1)
    return np.stack([X[:, 0], g * (1 - np.sqrt(X[:, 0] / g))], axis=1)

front = SOLVER.minimize(function, [(0.0, 1.0)] * 5, evaluations=400, checkpoint="run.ckpt", seed=1)
front.save("front.nc")
"""


def killed(folder: Path, script: str, when: int) -> tuple[int, int]:
    """A script is killed once it has logged so much, and called again; what it had logged, and what it logged then."""
    (folder / "script.py").write_text(script, encoding="utf-8")
    log = folder / "log"
    call = [sys.executable, "script.py"]
    run = subprocess.Popen(call, cwd=folder)
    ends = time.monotonic() + 60
    while (log.stat().st_size if log.exists() else 0) < when:
        assert run.poll() is None and time.monotonic() < ends
        time.sleep(0.005)
    run.kill()
    assert run.wait() == -signal.SIGKILL and not (folder / "front.nc").exists()
    done = log.stat().st_size
    subprocess.run(call, cwd=folder, check=True, timeout=60)
    assert {path.name for path in folder.iterdir() if ".part" not in path.name} == {"script.py", "log", "run.ckpt", "front.nc"}
    return done, log.stat().st_size - done


@pytest.mark.slow
@pytest.mark.parametrize("solver", [SMALL, MOPSO(particles=10)], ids=["MACS", "MOPSO"])
def test_kill_9(tmp_path, solver) -> None:
    done, again = killed(tmp_path, SCRIPT.replace("SOLVER", repr(solver)), 200)
    assert 400 - done <= again < 400 - done + 120 < 400  # what one or two iterations had evaluated since the last write
    assert_same(Front.load(tmp_path / "front.nc"), minimize(solver))


POLISH = """
import sys, time
from macs import MACS
from macs.evaluation import bilevel
from macs.search.settings import Variant
from macs.solvers import checkpoint
from problems import load
from transcription import DFET

checkpoint.WRITE_SECONDS = checkpoint.WRITE_SHARE = 0.0
scalarize = bilevel.scalarize

def logged(*arguments, **more):
    found = scalarize(*arguments, **more)
    with open("log", "a") as log:
        log.write("x")
    time.sleep(0.02)
    return found

bilevel.scalarize = logged
solver = MACS(agents=4, archive=6, polish_every=4, mesh="fixed")
front = solver.solve(load("orbit_rise"), DFET(3, 2), evaluations=160, checkpoint="run.ckpt", seed=1, inner="projection")
front.save("front.nc")
"""


@pytest.mark.slow
def test_kill_9_in_the_polish(tmp_path) -> None:
    done, again = killed(tmp_path, POLISH, 17)
    left = solved().stats["gradient_solves"] - done
    assert 0 < left <= again <= left + TOGETHER  # a batch that was cut short is made again
    assert_same(Front.load(tmp_path / "front.nc"), solved())


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"seed": 2}, "seed is 1 there, 2 here"),
        ({"evaluations": 500}, r"evaluations is 400 there, 500 here \(a larger budget is another search"),
        ({"solver": MACS(agents=5, archive=6)}, r"solver.settings.agents is 4 there, 5 here"),
        ({"solver": Stuck(agents=4, archive=6)}, "solver.name is 'MACS' there, 'Stuck' here"),
        ({"tolerance": 1e-3}, "tolerance is 1e-06 there, 0.001 here"),
        ({"box": [(0.0, 1.0)] * 4}, r"bounds.x5 is \[0.0, 1.0\] there, nothing here"),
        ({"box": [(0.0, 1.0)] * 4 + [(0.0, 2.0)]}, r"bounds.x5 is \[0.0, 1.0\] there, \[0.0, 2.0\] here"),
        ({"names": ("cost", "risk")}, "objectives.names is nothing there"),
        ({"constraints": lambda X: X[:, :1] - 2}, "constraints is False there, True here"),
    ],
)
def test_another_black_box_is_refused(file, other, message) -> None:
    minimize(checkpoint=file, callback=after(2))
    content, counted = file.read_bytes(), Counted()
    with pytest.raises(ValueError, match=f"run.ckpt' belongs to another run: .*{message}.*delete this one"):
        minimize(**{"f": counted, **other}, checkpoint=file)
    assert counted.rows == 0 and file.read_bytes() == content


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"problem": "goddard"}, r"problem.name is 'orbit_rise' there, 'goddard' here; problem.fingerprint .*bounds, equations"),
        ({"mesh": DFET(3, 3)}, "transcription.settings.order is 2 there, 3 here"),
        ({"inner": "propagate"}, "inner is 'projection' there, 'propagate' here"),
        ({"solver": MACS(agents=4, archive=6, refine=False), "seed": 7}, "solver.settings.refine is True there, False here; seed"),
    ],
)
def test_another_problem_is_refused(file, other, message) -> None:
    solve(evaluations=30, checkpoint=file, callback=after(0))
    content = file.read_bytes()
    with pytest.raises(ValueError, match=message.replace("; seed", "; .*seed")):
        solve(**{"evaluations": 30, **other}, checkpoint=file)
    assert file.read_bytes() == content


def test_a_function_of_other_objectives_is_refused(file) -> None:
    minimize(checkpoint=file, callback=after(2))
    with pytest.raises(ValueError, match="function returned 3, 2 expected"):
        minimize(checkpoint=file, f=lambda X: X[:, :3])


FORGED: list[tuple[str, dict[str, Any], str]] = [
    ("agents", {"Z": plain(np.zeros((2, 5)))}, "state.agents.F has . rows, 2 expected"),
    ("", {"ideal": plain(np.zeros(3))}, "state.ideal has 3 rows, 2 expected"),
    ("agents", {"direction": plain(np.full(4, 10**6))}, "state.agents.direction has numbers outside of the .* rows of state.directions"),
    ("", {"rng": "3"}, "no generator: .* - at `[$].rng`"),
]


@pytest.mark.parametrize(("part", "changes", "message"), FORGED)
def test_a_forged_file_is_refused_by_the_name_of_the_field(file, part, changes, message) -> None:
    minimize(checkpoint=file, callback=after(2))
    document = msgspec.msgpack.decode(checkpoint.read_file(file))
    state = msgspec.msgpack.decode(document["state"])
    (state[part] if part else state).update(changes)
    content = checkpoint.sealed(msgspec.msgpack.encode(document | {"state": msgspec.msgpack.encode(state)}))
    file.write_bytes(content)
    with pytest.raises(ValueError, match=f"run.ckpt' cannot be continued by this MACS: {message}[^\n]*; it was left as it is"):
        minimize(checkpoint=file, f=lambda X: pytest.fail("evaluated"))
    assert file.read_bytes() == content


@pytest.mark.parametrize(
    ("where", "error", "message"),
    [
        ("", IsADirectoryError, "it is a folder"),
        ("missing/run.ckpt", FileNotFoundError, "there is no folder"),
        ("run.ckpt/more", FileNotFoundError, "there is no folder"),
    ],
)
def test_places_that_cannot_be_written(tmp_path, where, error, message) -> None:
    (tmp_path / "run.ckpt").touch()
    counted = Counted()
    with pytest.raises(error, match=message):
        minimize(checkpoint=tmp_path / where, f=counted)
    with pytest.raises(error, match=message):
        solve(checkpoint=str(tmp_path / where))
    assert counted.rows == 0


@pytest.mark.slow
def test_a_full_disk_loses_neither_the_search_nor_the_last_checkpoint(file, monkeypatch, caplog) -> None:
    monkeypatch.setattr(checkpoint, "WRITE_SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "WRITE_SHARE", 0.0)
    write, written = checkpoint.write_whole, []

    def full(path, content) -> None:
        written.append(len(content))
        if len(written) > 5:
            raise OSError(errno.ENOSPC, f"cannot write '{path}': No space left on device")
        write(path, content)

    with monkeypatch.context() as patch, caplog.at_level(logging.WARNING):
        patch.setattr(checkpoint, "write_whole", full)
        front = minimize(checkpoint=file)
    assert re.search("No space left on device.*behind", front.stats.pop("checkpoint"))
    assert_same(front, uninterrupted())
    assert len([record for record in caplog.records if "goes on without" in record.message]) == 1 and len(written) > 7
    counted = Counted()
    assert_same(minimize(checkpoint=file, f=counted), uninterrupted())
    assert 0 < counted.rows < 400
