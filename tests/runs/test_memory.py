"""Too little memory, and Ctrl-C before a command begins, are one line."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from runs.cli import main
from runs.execution.task import peak_memory

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError(), "out of memory; the process had"),
        (MemoryError("Unable to allocate 728. TiB for an array"), ": Unable to allocate 728. TiB for an array; the process had"),
        (RuntimeError("map: Error calling Map::init:\nstd::bad_alloc"), ": Error calling Map::init: std::bad_alloc; the process had"),
    ],
    ids=["python", "numpy", "casadi"],
)
def test_want_of_memory_is_one_line(tmp_path, monkeypatch, capsys, error, words):
    monkeypatch.chdir(tmp_path)

    def hungry(*_, **__):
        raise error

    monkeypatch.setattr("macs.solvers.solver.Solver.solve", hungry)
    assert main(["solve", "four_bar_truss", "--seed", "1"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("macs solve: out of memory") and words in line and "coarser" in line and not list(tmp_path.iterdir())


def test_the_peak_of_a_process_is_its_own():
    """Not that of the process that started it, which is what `getrusage` says on Linux."""
    code = "from runs.execution.task import peak_memory; print(peak_memory()); block = b'x' * (100 * 2**20); print(peak_memory())"
    block = b"x" * (250 * 2**20)
    answer = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    before, after = map(float, answer.stdout.split())
    assert peak_memory() > len(block) / 2**20 and before < 240 and 100 <= after - before < 110


@pytest.mark.slow
def test_a_limit_of_the_process_is_one_line(tmp_path):
    """The problem's own function asks for more than the process may have: 4 GB within 3."""
    (tmp_path / "hungry.py").write_text(
        "import numpy as np\nfrom problems import VectorProblem\n"
        "def build():\n    problem = VectorProblem('hungry')\n    problem.variable('x', bounds=(0, 1))\n    problem.minimize('f')\n"
        "    problem.function(lambda X: {'f': np.ones(2**29)[: len(X)]})\n    return problem\n"
    )
    code = (
        "import resource, sys\nresource.setrlimit(resource.RLIMIT_AS, (3 * 2**30,) * 2)\nfrom runs.cli import main\n"
        "sys.exit(main(['solve', 'hungry.py:build', '--evaluations', '20', '--seed', '1']))"
    )
    env = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and "macs solve: out of memory: Unable to allocate 4.00 GiB" in done.stderr
    assert "Traceback" not in done.stderr


def test_ctrl_c_while_the_parser_is_imported_is_one_line(tmp_path):
    """argparse is the first thing that the parser imports: here it waits for Ctrl-C."""
    (tmp_path / "argparse.py").write_text("import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(30)\n")
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from runs.cli import main; main()"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join((str(tmp_path), str(ROOT)))}
    began = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "macs: interrupted\n") and time.perf_counter() - began < 20
