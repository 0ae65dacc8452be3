"""Random kills of solves, studies and workers of a cluster, and whether what is resumed has the same numbers.

By hand: `python tests/runs/kills.py --kills 100`.
"""

import argparse
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from misbehaving import Slow, glide

from macs import MACS, Front
from macs.solvers import checkpoint
from problems import load
from runs import Study
from transcription import DFET

FORK = multiprocessing.get_context("fork")
"""Children begin with all that is imported: most of the time is theirs."""


def solved(file: Path | None) -> Front:
    """A search with a polish, slow enough to be killed anywhere in it, that keeps itself in a file as often as it can."""
    checkpoint.WRITE_SECONDS = checkpoint.WRITE_SHARE = 0.0
    pause = None if file is None else (lambda _: time.sleep(0.02))
    solver = MACS(agents=4, archive=6)
    return solver.solve(load("goddard"), DFET(3, 3), evaluations=120, seed=3, checkpoint=file, callback=pause, progress=False)


def study() -> Study:
    """Four runs, of which each takes some tenths of a second."""
    return Study("glides", problems={"glide": glide()}, solvers={"slow": Slow()}, runs=4, seed=1, evaluations=60)


def bits(front: Front) -> tuple[bytes, bytes]:
    """All that must be the same."""
    return front.F.tobytes(), np.ascontiguousarray(front.decision).tobytes()


def fronts(summary: Any) -> dict[int, tuple[bytes, bytes]]:
    """The bits of each run, by its number."""
    return {run.number: bits(run.front) for run in summary.runs if run.finished}


def interrupted(work: Callable[[], object], kills: int, longest: float, rng: np.random.Generator) -> int:
    """Do some work in a process of its own, which is killed with all of its children after a random time, as often as `kills`; then let it
    end. Returns how often it was killed."""
    done = 0
    while True:
        child = FORK.Process(target=_leading, args=(work,))
        child.start()
        child.join(rng.uniform(0.0, longest) if done < kills else None)
        if child.exitcode is not None:
            assert child.exitcode == 0, f"it ended with {child.exitcode}"
            return done
        _grouped(child)
        # Its own children survive a while where it alone is killed: as often as not, they do.
        (os.killpg if rng.random() < 0.5 else os.kill)(child.pid, signal.SIGKILL)
        child.join()
        done += 1


def _grouped(child: Any) -> None:
    """Make a child the leader of a group of its own, which it may not have done yet itself."""
    with suppress(OSError):
        os.setpgid(child.pid, child.pid)


def _leading(work: Callable[[], object]) -> None:
    os.setpgid(0, 0)
    work()


def kill_solves(kills: int, rng: np.random.Generator) -> int:
    """Kill solves until there were so many; each has the bits of one that was not killed."""
    expected, done, number = bits(solved(None)), 0, 0
    with tempfile.TemporaryDirectory() as folder:
        while done < kills:
            # A new file, and below a new study, each time: one that is finished leaves nothing to kill.
            file, number = Path(folder) / f"{number}.ckpt", number + 1
            done += interrupted(lambda file=file: solved(file), int(rng.integers(1, 6)), 1.5, rng)  # type: ignore[misc]
            assert bits(solved(file)) == expected
    return done


def kill_studies(kills: int, rng: np.random.Generator) -> int:
    """Kill studies likewise; no run that had been finished is written again."""
    done = number = 0
    with tempfile.TemporaryDirectory() as folder:
        expected = fronts(study().run(Path(folder) / "uninterrupted", jobs=2))
        while done < kills:
            out, number, before = Path(folder) / f"study {number}", number + 1, dict[Path, int]()
            for _ in range(int(rng.integers(1, 4))):
                done += interrupted_once(out, rng)
                stamps = {path: path.stat().st_mtime_ns for path in out.rglob("*.nc")}
                assert before.items() <= stamps.items(), "a finished run was written again"
                before = stamps
            assert fronts(_patiently(lambda out=out: study().run(out, jobs=2))) == expected  # type: ignore[misc]
    return done


def interrupted_once(out: Path, rng: np.random.Generator) -> int:
    """Begin the study in a folder, and kill it after a random time, or one of its workers; whether that came in time."""
    child = FORK.Process(target=_leading, args=(lambda: _patiently(lambda: study().run(out, jobs=2)),))
    child.start()
    _grouped(child)
    child.join(rng.uniform(0.0, 5.0))
    workers = children(child.pid)
    if workers and rng.random() < 0.3:
        os.kill(int(rng.choice(workers)), signal.SIGKILL)
        child.join(rng.uniform(0.0, 2.0))
    killed = child.exitcode is None
    if killed:
        (os.killpg if rng.random() < 0.5 else os.kill)(child.pid, signal.SIGKILL)
    child.join()
    return int(killed)


def _patiently(work: Callable[[], Any]) -> Any:
    """What the work returns; workers of a killed study may hold its folder for a moment."""
    ends = time.monotonic() + 30
    while True:
        try:
            return work()
        except ValueError as error:
            if "another process" not in str(error) or time.monotonic() > ends:
                raise
            time.sleep(0.1)


def children(pid: int) -> list[int]:
    """The processes that the threads of a process have started."""
    try:
        return [int(word) for file in Path(f"/proc/{pid}/task").glob("*/children") for word in file.read_text().split()]
    except OSError:
        return []


class Cluster:
    """A scheduler of Dask and its workers, processes of their own."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._count = folder, 0
        self._environment = {**os.environ, "PYTHONPATH": os.pathsep.join(str(Path(part).resolve()) for part in sys.path)}
        self.scheduler = self._start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        said, ends = folder / "0.log", time.monotonic() + 60
        while not (found := re.search(r"Scheduler at:\s+(tcp://\S+)", said.read_text())):
            assert time.monotonic() < ends, said.read_text()
            time.sleep(0.05)
        self.address = found[1]
        self.workers = [self.worker(), self.worker()]

    def worker(self) -> subprocess.Popen:
        """One more worker."""
        return self._start("dask_worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard")

    def _start(self, *call: str) -> subprocess.Popen:
        log = (self._folder / f"{self._count}.log").open("w")
        self._count += 1
        command = [sys.executable, "-m", "distributed.cli." + call[0], *call[1:]]
        return subprocess.Popen(command, stderr=log, stdout=log, cwd=self._folder, env=self._environment)


@contextmanager
def running_cluster() -> Iterator[Cluster]:
    """A cluster with two workers, gone at the end."""
    with tempfile.TemporaryDirectory() as folder:
        made = Cluster(Path(folder))
        try:
            yield made
        finally:
            for process in (*made.workers, made.scheduler):
                process.kill()
                process.wait()


def kill_workers(kills: int, rng: np.random.Generator) -> int:
    """Kill workers of a cluster while it makes a study, each replaced by another; the numbers are those of this machine alone."""
    from runs.execution.processes import cluster

    done = number = 0
    with tempfile.TemporaryDirectory() as folder, running_cluster() as made:
        expected = fronts(study().run(Path(folder) / "here", jobs=2))
        while done < kills:
            out, number = Path(folder) / f"study {number}", number + 1
            ended = threading.Event()

            def killer(ended: threading.Event = ended) -> None:
                nonlocal done
                while not ended.wait(rng.uniform(0.2, 3.0)) and done < kills:
                    which = int(rng.integers(2))
                    made.workers[which].kill()
                    made.workers[which].wait()
                    made.workers[which] = made.worker()
                    done += 1

            thread = threading.Thread(target=killer)
            thread.start()
            try:
                with cluster(made.address) as executor:
                    study().run(out, executor=executor)
            finally:
                ended.set()
                thread.join()
            with cluster(made.address) as executor:  # runs that lost their workers too often
                assert fronts(study().run(out, executor=executor)) == expected
    return done


def main() -> int:
    """Kill solves, studies and workers; an assertion fails where anything differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100, help="number of kills: of solves, studies and workers, as many of each")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    for kill in (kill_solves, kill_studies, kill_workers):
        print(f"{kill.__name__}: {kill(-(-arguments.kills // 3), rng)} kills, and the same numbers", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
