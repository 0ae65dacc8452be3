"""Time limits and Ctrl-C: whatever the work is doing, it ends within two seconds, with what it has, and says so.

The clocks of these tests are generous by half a second, and what they end would take many times as long.
"""

import io
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from terminals import Terminal

from macs import MACS, Front, optimize, payoff, sweep
from macs.fronts.builders import from_vectors
from macs.io import console
from macs.io.console import StatusLine, Steps, working
from macs.io.interrupts import Interrupts, spending
from problems import Problem, load
from runs.cli import main
from transcription import DFET, MultipleShooting
from transcription.inner import Newton
from transcription.nlp.program import Watched, ipopt_options
from transcription.nlp.scalarized import scalarize
from transcription.numerics import batched
from transcription.numerics.batched import Batched
from transcription.stopping import Stopped, stopped_by, stopping
from transcription.trajectories import arcs
from transcription.trajectories.simulate import simulate

LIMIT, BOUND = 0.5, 2.5
ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals")


@contextmanager
def within(seconds: float):
    """The block may take so many seconds of this process's work: by the clock it takes longer on a busy machine."""
    began = time.process_time()
    yield
    assert time.process_time() - began < seconds


@contextmanager
def ctrl_c(after: float):
    """Ctrl-C after so many seconds."""
    timer = threading.Timer(after, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def test_a_time_limit_ends_a_solve_between_its_iterations_and_ctrl_c_is_not_swallowed():
    """Of a program that IPOPT would work on for minutes: a chain of narrow valleys, from the wrong end."""
    x = ca.SX.sym("x", 3000)
    f = ca.sum1(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2)
    solver = Watched("valleys", {"x": x, "f": f}, ipopt_options(600.0, 10**6))
    with Interrupts(LIMIT), within(BOUND):
        solver(x0=-1.0)
    stats = solver.stats()
    assert stats["return_status"] == "User_Requested_Stop" and stats["iter_count"] > 10
    with within(BOUND), pytest.raises(KeyboardInterrupt), ctrl_c(LIMIT):
        solver(x0=-1.0)


def test_a_program_is_not_built_any_more():
    x = ca.SX.sym("x")
    with stopped_by(lambda: "time limit"), pytest.raises(Stopped, match="time limit"):
        Watched("one", {"x": x, "f": x**2}, ipopt_options(1.0, 10))


@pytest.mark.slow
def test_a_search_that_is_cut_within_solves_goes_on_to_the_same_bits(tmp_path):
    def solve(**more):
        return MACS(agents=3, archive=3).solve(load("goddard"), DFET(8, 6), evaluations=24, seed=1, inner="ipopt", verify=None, **more)

    whole, cuts = solve(), 0
    while True:
        with within(BOUND):
            part = solve(checkpoint=tmp_path / "run.ckpt", time_limit=0.15 + 0.1 * cuts)
        if part.stats["stopped"] == "budget":
            break
        assert not part.stats["reproducible"] and part.stats["stopped"] == "time limit"
        cuts += 1
    assert cuts, "the whole takes longer than the limit"
    assert part.F.tobytes() == whole.F.tobytes() and part.decision.tobytes() == whole.decision.tobytes()


@pytest.mark.parametrize("method", [MultipleShooting(9), DFET(3, 3)])
def test_they_are_not_built_to_the_end(method):
    nlp = method.transcribe(load("orbit_rise"))
    questions = iter(range(10**6))
    with stopped_by(lambda: next(questions) >= 1):
        solved = scalarize(nlp, nlp.first_guess(nlp.lower[nlp.free][None])[0], reference=np.zeros(2), weights=np.ones(2))
    assert solved.status == "timeout" and solved.clocked and not solved.begun


@pytest.mark.slow
def test_a_time_limit_ends_them_on_a_fine_mesh():
    nlp = DFET(600, 6).transcribe(load("orbit_rise"))
    start = nlp.first_guess(nlp.lower[nlp.free][None])[0]
    with Interrupts(LIMIT), within(BOUND):
        solved = scalarize(nlp, start, reference=np.zeros(2), weights=np.ones(2))
    assert solved.status == "timeout" and solved.clocked


def impossible() -> Problem:
    """A state that cannot get where it has to be."""
    problem = Problem("impossible")
    phase = problem.phase("p", t0=0.0, tf=1.0)
    x = phase.state("x", bounds=(-10, 10), initial=0.0, final=5.0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=u)
    problem.minimize("end", phase.integral(u * x))
    problem.minimize("effort", phase.integral(u**2))
    return problem


def test_a_time_limit_ends_newton_loops():
    nlp = DFET(2, 2).transcribe(impossible())
    with Interrupts(LIMIT), within(BOUND):
        found = Newton(max_iterations=10**9).solve(nlp, np.zeros((4, len(nlp.free))))
    assert set(found.status) == {"timeout"} and found.clocked and found.iterations.min() > 10
    assert np.isfinite(found.violation).all()


def stiff() -> Problem:
    """Explicit integrators need a million steps a second for it."""
    problem = Problem("stiff")
    phase = problem.phase("p", t0=0.0, tf=100.0)
    x = phase.state("x", bounds=(-10, 10), initial=1.0)
    u = phase.control("u", bounds=(-1, 1))
    phase.dynamics(x=-1e6 * (x - u))
    problem.minimize("effort", phase.integral(u**2))
    problem.maximize("end", phase.final(x))
    return problem


@pytest.fixture
def endless_integrations(monkeypatch):
    """On a quick machine an integration may break down, after as many steps as it may have, before the clock ends it."""
    monkeypatch.setattr(arcs, "MOST_CALLS", 10**9)


def test_a_time_limit_ends_a_simulation(endless_integrations):
    nlp = DFET(20, 1).transcribe(stiff())
    Z = nlp.propagate(nlp.first_guess(np.full((2, len(nlp.free)), 0.5)))
    front = Front.of(from_vectors(nlp, Z, {"name": "nothing"}, {"tolerance": 1e-3}))
    with Interrupts(LIMIT), within(BOUND), pytest.raises(Stopped, match="time limit"):
        simulate(front.compiled(), front[0].trajectory)
    with Interrupts(LIMIT), within(BOUND):
        found = front.verify(1e-3)
    assert len(found) == 2 and not found.was_simulated.any() and not found.verified.any()


@pytest.mark.slow
def test_what_was_found_is_still_simulated_if_that_is_quick():
    before = signal.getsignal(signal.SIGINT)
    with Interrupts() as interrupts:
        found = MACS().solve(load("goddard"), DFET(4, 3), evaluations=60, seed=1, callback=lambda _: signal.raise_signal(signal.SIGINT))
        assert interrupts.reason == "interrupted", "the whole, too"
    assert found.stats["stopped"] == "interrupted" and len(found) and found.was_simulated.all()
    assert signal.getsignal(signal.SIGINT) is before


def test_a_search_without_time_for_its_first_evaluation_says_so(tmp_path):
    front = MACS().solve(load("goddard"), DFET(4, 3), evaluations=100, seed=1, time_limit=1e-9)
    assert len(front) == 0 and front.message == "nothing was evaluated yet: time limit"
    assert front.stats["evaluations"] == 0 and front.stats["stopped"] == "time limit" and not front.stats["reproducible"]
    assert front.stats["seed"] == 1 and front.names == ("flight time", "horizontal speed") and "time limit" in front.table()
    front.save(tmp_path / "front.nc")
    again = Front.load(tmp_path / "front.nc")
    assert len(again) == 0 and again.message == front.message and again.stats["stopped"] == "time limit"


def test_tools_without_time_for_their_first_solve_say_so():
    with pytest.raises(TimeoutError, match="optimize: time limit before the first solve"):
        optimize(load("goddard"), time_limit=1e-9)
    for front in (sweep(load("goddard"), points=5, time_limit=1e-9), sweep(load("goddard"), DFET(4, 3), points=5, time_limit=1e-9)):
        assert len(front) == 0 and front.message and front.stats["gradient_solves"] == 0 and not front.stats["reproducible"]
    ends = payoff(load("goddard"), DFET(4, 3), time_limit=1e-9)
    assert ends.status.tolist() == ["timeout", "timeout"] and not ends.stats["reproducible"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "tool",
    [
        lambda **more: sweep(load("orbit_rise"), DFET(30, 1), points=300, **more),
        lambda **more: Front.of(optimize(load("orbit_rise"), DFET(30, 1), starts=300, **more).alone()),
    ],
)
def test_tools_end_in_time(tool):
    with within(BOUND):
        found = tool(time_limit=LIMIT)
    assert found.stats["stopped"] == "time limit" and not found.stats["reproducible"] and (len(found) or found.message)


@pytest.mark.slow
def test_mesh_refinement_ends_in_time():
    front = sweep(load("goddard"), DFET(3, 2), points=6, verify=None)
    with within(BOUND):
        found = front.refine_mesh(tolerance=1e-10, limit=60, time_limit=LIMIT)
    assert len(found) == len(front) and found.stats["stopped"] == "time limit" and not found.stats["reproducible"]


@pytest.fixture
def doubled(monkeypatch):
    """A Function that is compiled at its second call, by whatever CC is."""
    x = ca.SX.sym("x", 3)
    monkeypatch.setenv("MACS_COMPILE", "always")
    monkeypatch.setattr(batched, "_useless", set())

    def make(command: str) -> Batched:
        monkeypatch.setenv("CC", command)
        return Batched(ca.Function("doubled", [x], [2 * x]))

    return make


def right(function: Batched) -> bool:
    X = np.arange(12.0).reshape(4, 3)
    return all(np.array_equal(function(X)[0], 2 * X) for _ in range(3))


def script(folder: Path, text: str) -> str:
    path = folder / "cc.sh"
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


def test_a_compiler_that_hangs_is_given_up(doubled, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(batched, "COMPILER_SECONDS", LIMIT)
    command = script(tmp_path, f"sleep 60 & echo $! > {tmp_path}/pid; wait")
    with within(BOUND):
        assert right(doubled(command))
    assert "functions are not compiled" in caplog.text and "did not end within 0.5 s" in caplog.text
    state = subprocess.run(["ps", "-o", "stat=", "-p", (tmp_path / "pid").read_text()], capture_output=True, text=True).stdout
    assert not state.strip("Z+s \n"), "nor does what it has started live on"
    assert batched.compiler() is None, "it is not tried again"
    caplog.clear()
    assert right(doubled(command)) and not caplog.text


def test_a_time_limit_ends_a_compiler(doubled, tmp_path, caplog):
    function = doubled(script(tmp_path, "sleep 60"))
    with Interrupts(LIMIT), within(BOUND):
        assert right(function)
    assert not caplog.text and batched.compiler(), "that was not its fault"


@pytest.mark.parametrize("command", ["false", "/nowhere/cc"])
def test_a_compiler_that_fails_leaves_a_note(doubled, command, caplog):
    with caplog.at_level(logging.WARNING):
        assert right(doubled(command)) and right(doubled(command))
    assert caplog.text.count("functions are not compiled, and take more time: ") == 1 and command in caplog.text


def test_what_interrupts_a_part_interrupts_the_whole():
    with Interrupts() as whole, Interrupts() as part:
        signal.raise_signal(signal.SIGINT)
        assert part.reason == whole.reason == "interrupted" and stopping()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert not stopping()
    with Interrupts() as whole:
        with Interrupts(1e-9) as part:
            assert part.reason == "time limit" and stopping()
        assert not whole.reason and not stopping(), "the time of a part is its own"
        with Interrupts(1e-9), working(None, False) as (_, inner):
            assert inner.reason == "time limit"
            with pytest.raises(Stopped, match="time limit"):
                inner.check()


def test_a_forked_process_hears_no_ctrl_c(monkeypatch):
    with Interrupts() as whole:
        monkeypatch.setattr(os, "getpid", lambda: 0)
        for _ in range(2):
            signal.raise_signal(signal.SIGINT)
        assert not whole.reason


def test_a_second_ctrl_c_in_a_function_returns_what_there_is():
    seen = []

    def function(X):
        seen.extend(X)
        if len(seen) > 100:
            for _ in range(2):
                signal.raise_signal(signal.SIGINT)
        return np.column_stack([X[:, 0], 1 - X[:, 0]])

    front = MACS().minimize(function, [(0, 1)] * 2, evaluations=10_000, seed=1, progress=False)
    assert len(front) and front.stats["stopped"] == "interrupted" and front.stats["evaluations"] < len(seen)


def test_a_part_ends_with_the_whole():
    with Interrupts(LIMIT), within(BOUND):
        front = MACS().minimize(lambda X: np.column_stack([X[:, 0], 1 - X[:, 0]]), [(0, 1)] * 2, evaluations=10**9, seed=1)
    assert front.stats["stopped"] == "time limit" and len(front) and not front.stats["reproducible"]


def test_progress_shows_itself_on_a_terminal_if_it_takes_long(monkeypatch):
    monkeypatch.setattr(console, "SHOWN_AFTER", 0.2)
    quick, slow, elsewhere = Terminal(), Terminal(), io.StringIO()
    with StatusLine(None, quick) as show:
        show("soon over")
    with StatusLine(None, elsewhere) as unseen, StatusLine(None, slow) as show:
        for _ in range(2):
            time.sleep(0.2)
            unseen("nobody looks on")
            show("it goes on")
            time.sleep(0.2)
    assert not quick.getvalue() and not elsewhere.getvalue() and "it goes on" in slow.getvalue()


def test_an_interrupted_report_ends_at_once():
    with pytest.raises(KeyboardInterrupt), Steps("report", 2, io.StringIO(), at_once=True) as steps:
        steps.begin("first")
        signal.raise_signal(signal.SIGINT)
        pytest.fail("it went on")


def test_ctrl_c_during_imports_is_one_line():
    code = (
        "import os, signal, time\nfrom runs.cli.answers import ended_at_once\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "with ended_at_once('macs solve'):\n    os.kill(os.getpid(), signal.SIGINT)\n    time.sleep(30)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=20, cwd=ROOT)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "macs solve: interrupted\n")


def test_an_interrupted_solve_that_has_nothing_leaves_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    transcribe = DFET.transcribe

    def interrupted(self, problem):
        signal.raise_signal(signal.SIGINT)
        return transcribe(self, problem)

    monkeypatch.setattr(DFET, "transcribe", interrupted)
    assert main(["solve", "goddard", "--out", "front.nc"]) == 130
    said = capsys.readouterr()
    assert said.err.endswith("macs solve: nothing was evaluated yet: interrupted\n") and not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("problem", ["goddard", "betts"])
def test_an_interrupted_solve_saves_what_there_is(tmp_path, problem):
    call = [sys.executable, "-m", "runs.cli", "solve", problem, "--evaluations", "10000000", "--out", str(tmp_path / "front.nc")]
    with subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT) as process:
        process.stderr.readline()
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        with within(2 * BOUND):
            out, err = process.communicate(timeout=60)
    assert process.returncode == 130 and "front saved in" in out and "Traceback" not in err
    assert Front.load(tmp_path / "front.nc").stats["stopped"] == "interrupted"
    assert [path.name for path in tmp_path.iterdir()] == ["front.nc"]


def test_what_seconds_were_spent_on_leaves_out_what_is_within() -> None:
    with spending("outer") as seconds:
        time.sleep(0.02)
        with spending("inner"):
            time.sleep(0.05)
    assert 0.02 <= seconds["outer"] < 0.05 <= seconds["inner"]
    with spending("another") as others:
        pass
    assert list(others) == ["another"] and "another" not in seconds
