"""What README promises: a test for each promise that is not kept by one module alone. `test_manual` runs README's code.

Elsewhere: hollow and set apart (`test_front_plot`, `test_verified`), pymoo's bits (`test_pymoo_adapter`), equalities (`test_repair`),
switches (`test_dfet_moving_edges`), rates (`test_trade_offs`), studies (`test_study`), forged files (`test_files`, `test_checkpoint`),
failed flights (`test_inner`).
"""

import pickle
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from macs import MACS, NSGA2, Front, optimize, payoff, sweep
from macs.decisions import Dialogue, WeightedSum, decide
from macs.evaluation import bilevel
from macs.solvers import checkpoint
from problems import Problem, load
from runs import Study
from runs.cli.parser import build_parser
from transcription import DFET

ROOT = Path(__file__).parents[1]
MESH, SOLVER = DFET(4, 4), MACS(agents=4, archive=6, mesh="fixed")
SEARCH = {"evaluations": 80, "seed": 1}
COST = WeightedSum({"cost": 1.0})


@pytest.fixture(scope="module")
def front() -> Front:
    """Of the ascent; on this mesh the angle of the quickest flight leaves its bounds between nodes."""
    return SOLVER.solve(load("goddard"), MESH, **SEARCH)


def assert_same(one: Front, other: Front) -> None:
    assert one.F.tobytes() == other.F.tobytes() and one.decision.tobytes() == other.decision.tobytes()
    assert {**one.stats, "wall_time": 0} == {**other.stats, "wall_time": 0}


def test_a_point_is_verified_where_an_integration_without_any_of_our_code_agrees(front):
    """By scipy: within a thousandth of what the bounds of states and control and the objectives span."""
    right = []
    for point in front:
        flight = point.trajectory["ascent"]

        def rates(t, s, flight=flight):
            u = flight.at(t)["u"]
            return [s[1], 4e-3 * np.cos(u), s[3], 4e-3 * np.sin(u) - 1.6e-3]

        end = solve_ivp(rates, (flight.t0, flight.tf), np.zeros(4), rtol=1e-8, atol=1e-10, max_step=flight.tf / 100).y[:, -1]
        angle = max(abs(flight.at(t)["u"]) for t in np.linspace(flight.t0, flight.tf, 400))
        speed = (end[1] - point.objectives["horizontal speed"]) / np.ptp(front.objectives[:, 1])
        misses = [(end[2] - 10) / 12, end[3] / 20, max(angle - np.pi / 2, 0) / np.pi, speed]
        right.append(bool(np.abs(misses).max() < 1e-3))
    assert front.verified.tolist() == right and 1 <= sum(right) < len(front) and front.violation.max() <= 1e-6


BITS = {
    "mending": (lambda front: front.mended()),
    "finer meshes": (lambda front: front[1:3].refine_mesh()),
    "optimize": (lambda front: Front.of(optimize(load("standard/stirred_tank"), DFET(3, 2), starts=3, seed=4).alone())),
    "payoff": (lambda front: payoff(load("goddard"), DFET(3, 3), starts=2, seed=4)),
    "sweep": (lambda front: sweep(load("goddard"), DFET(3, 3), points=3, starts=2, seed=4)),
    "decide": (lambda front: Front.of(decide(load("standard/stirred_tank"), DFET(3, 2), COST, starts=3, seed=4).point.alone())),
}


@pytest.mark.parametrize("way", BITS)
def test_the_same_seed_gives_the_same_bits(front, way):
    first = BITS[way](front)
    assert len(first) and first.stats["reproducible"]
    assert_same(BITS[way](front), first)


KILLED = """
import os, signal
from macs import MACS
from macs.solvers import checkpoint
from problems import load
from transcription import DFET

checkpoint.WRITE_SECONDS = checkpoint.WRITE_SHARE = 0.0
kill = lambda progress: os.kill(os.getpid(), signal.SIGKILL) if progress.evaluations > 40 else None
{solver!r}.solve(load("goddard"), {mesh!r}, **{search}, checkpoint="run.ckpt", callback=kill)
"""


def test_a_killed_search_goes_on_to_the_same_bits(front, tmp_path):
    script = KILLED.format(solver=SOLVER, mesh=MESH, search=SEARCH)
    assert subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=False).returncode == -signal.SIGKILL
    seen = []
    see = {"callback": lambda progress: seen.append(progress.evaluations)}
    assert_same(SOLVER.solve(load("goddard"), MESH, **SEARCH, checkpoint=tmp_path / "run.ckpt", **see), front)
    assert min(seen) > 40, "it does not begin again"


@pytest.mark.parametrize("when", ["search", "polish"])
@pytest.mark.parametrize("reason", ["interrupted", "time limit"])
def test_ctrl_c_and_time_limits_keep_the_front_so_far(front, monkeypatch, when, reason):
    """In the middle of the search, and within the ninth of the eighteen solves of its polish, when all evaluations are spent."""
    solve, solves = bilevel.scalarize, 0

    def end():
        if reason == "interrupted":
            signal.raise_signal(signal.SIGINT)
        else:
            monkeypatch.setattr("macs.io.interrupts.time", SimpleNamespace(perf_counter=lambda: time.perf_counter() + 1000.0))

    def polished(*arguments, **more):
        nonlocal solves
        solved = solve(*arguments, **more)
        solves += solved.begun
        if when == "polish" and solved.begun and solves == 9:
            end()
        return solved

    def searched(progress):
        if when == "search" and progress.evaluations > 40:
            end()

    monkeypatch.setattr(bilevel, "scalarize", polished)
    part = SOLVER.solve(load("goddard"), MESH, **SEARCH, time_limit=900.0, callback=searched)
    assert part.stats["stopped"] == reason and not part.stats["reproducible"] and reason in part.table()
    assert len(part) and np.isfinite(part.F).all() and part.violation.max() <= 1e-6 and part.was_simulated.all()
    assert (part.stats["evaluations"] == 80) == (when == "polish") and solves == (9 if when == "polish" else 0)


@pytest.mark.parametrize("solver", [MACS(), NSGA2(population=12)], ids=repr)
def test_a_failed_evaluation_has_a_status_and_never_a_number_in_the_objectives(solver):
    """What fails in one objective has the best value of the other one."""
    failed = 0

    def function(X):
        nonlocal failed
        bad = X[:, 1] > 0.5
        failed += int(bad.sum())
        return np.where(bad[:, None], [np.nan, -1e9], np.column_stack([X[:, 0], 1 - X[:, 0] + X[:, 1]]))

    found = solver.minimize(function, [(0, 1)] * 2, evaluations=200, seed=1)
    assert failed > 5 and found.stats["failures"]["failed"] == failed
    assert len(found) and found.F.min() >= 0 and found.decision[:, 1].max() <= 0.5


def test_where_nothing_is_feasible_the_answer_names_what_is_violated_by_how_much_and_the_conflict():
    """From rest at 0 to rest at 1 in a unit of time, where 0.25 is the most: 0.75 m of a scale of 8 m are missing."""
    problem = Problem("walk")
    walk = problem.phase("walk", t0=0.0, tf=1.0)
    walk.state("x", bounds=(-4, 4), initial=0, final=1, unit="m")
    v, u = walk.state("v", bounds=(-1, 1), initial=0, final=0), walk.control("u", bounds=(-1, 1))
    walk.dynamics(x=v, v=u)
    problem.minimize("effort", walk.integral(u**2))
    problem.minimize("jerk", walk.integral(u**4))
    for answer in (SOLVER.solve(problem, DFET(2, 2), seed=1), sweep(problem, DFET(2, 2), points=3)):
        assert len(answer) == 0 and answer.closest.status == "infeasible"
        assert answer.closest.violations["final value of walk.x"] == pytest.approx(0.75 / 8, abs=1e-3)
        assert "violates final value of walk.x by 0.094 of its scale, 8 m, in conflict with final value of walk.v" in answer.message


class Forged:
    """Leaves a mark where it is unpickled."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def test_no_file_is_unpickled(tmp_path):
    file, mark = tmp_path / "file", tmp_path / "mark"
    readers = [Front.load, Dialogue.load, Study.load, lambda file: SOLVER.solve(load("goddard"), MESH, **SEARCH, checkpoint=file)]
    for content in (pickle.dumps(Forged(mark)), checkpoint.sealed(pickle.dumps(Forged(mark)))):
        file.write_bytes(content)
        for read in readers:
            with pytest.raises(ValueError):
                read(file)
            assert not mark.exists() and file.read_bytes() == content
    pickle.loads(pickle.dumps(Forged(mark)))
    assert mark.exists(), "the mark is a mark"
    unpickles = re.compile(r"pickle\.loads?\(|Unpickler|allow_pickle=True|marshal|shelve|joblib")
    modules = [path for floor in ("problems", "transcription", "macs", "runs") for path in (ROOT / floor).rglob("*.py")]
    found = {path.name for path in modules if unpickles.search(path.read_text(encoding="utf-8"))}
    assert found == {"task.py", "processes.py", "workers.py"}, "only what processes of a study, or of a call, send each other"


def test_the_two_commands():
    said = subprocess.run(["make", "-n", "run", "test"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    (run,) = re.findall(r"bin/macs (.+)", said)
    call = build_parser().parse_args(run.split())
    assert (call.command, call.problem, call.out, call.plot) == ("solve", "goddard", "out/goddard.nc", "out/goddard.png")
    assert re.search(r"-m pytest ", said)
