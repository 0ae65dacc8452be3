"""Benchmark of studies: two processes against one, and the time of a study beyond that of its runs."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from macs.io.console import Steps

from ..study import Study
from .measured import Column, Row, Target, short, table, verdicts

ONE, TWO = "one process", "two processes"
LIMIT = "arithmetic alone"
SPIN = "total = 0\nfor i in range({}):\n    total += i * i"
"""Arithmetic that needs nothing but a core."""
FASTER, BEYOND = 1.7, 0.05
"""Targets: the least ratio of speeds of two processes to one, and the largest share of its runs' time that a study takes beyond it."""


@dataclass(frozen=True)
class Effort:
    """Size of a measurement: rounds, runs in each, an even number, and the evaluations of a run."""

    rounds: int = 3
    runs: int = 8
    evaluations: int = 5_000
    spin: int = 20_000_000


QUICK = Effort(rounds=1, runs=6, evaluations=500, spin=5_000_000)


def bench_study(rows: list[Row], effort: Effort) -> None:
    """Measure; `rows` are filled as values become known, also if `Stopped` ends it."""
    batch = Study("bench", problems="goddard", solvers="macs", evaluations=effort.evaluations, runs=effort.runs, seed=1)
    case = f"goddard, {effort.runs} runs of {effort.evaluations}"
    pair, limit = {1: Row(case, ONE), 2: Row(case, TWO)}, Row(LIMIT, TWO)
    with Steps("studies", 2 * effort.rounds) as steps:
        for i in range(effort.rounds):
            taken = {}
            # None is always the first.
            for jobs in (1, 2) if i % 2 == 0 else (2, 1):
                steps.begin(f"{pair[jobs].who}, round {i + 1}")
                taken[jobs] = _timed(batch, jobs)
            for jobs, (seconds, work) in taken.items():
                pair[jobs].add(speed=taken[1][0] / seconds, seconds=seconds, work=work / taken[1][1], beyond=jobs * seconds / work - 1.0)
            limit.add(speed=_spun(effort.spin, 1) / _spun(effort.spin, 2))
            if i == 0:
                rows += [*pair.values(), limit]


def _timed(batch: Study, jobs: int) -> tuple[float, float]:
    """Seconds of a study, and of all its runs together."""
    with tempfile.TemporaryDirectory(prefix="macs_") as folder:
        began = time.perf_counter()
        summary = batch.run(Path(folder) / "out", jobs=jobs)
        seconds = time.perf_counter() - began
    if summary.finished < len(summary.runs):
        raise RuntimeError(f"runs failed, so there is nothing to compare: {next(run.message for run in summary.runs if not run.finished)}")
    return seconds, float(np.sum([run.wall_time for run in summary.runs]))


def _spun(count: int, at_once: int) -> float:
    """Seconds of two processes of plain arithmetic, `at_once` at a time."""
    began = time.perf_counter()
    for _ in range(2 // at_once):
        running = [subprocess.Popen([sys.executable, "-c", SPIN.format(count)]) for _ in range(at_once)]
        for process in running:
            process.wait()
    return time.perf_counter() - began


def report(rows: Sequence[Row]) -> str:
    """The measured values, and the targets."""
    lines = [
        "STUDIES: a whole study with two processes against one, in turn; median, least and greatest of few rounds. Runs' time: that of all",
        "runs together, as multiples of what they take one at a time; above 1, runs that go on side by side slow each other down. Beyond:",
        "the time of the study beyond its runs', as a share of it: writing files, waiting for the last run, and a second or two for",
        "each process to start once, which weighs more here than in a study of many long runs. Arithmetic",
        "alone: the same ratio of two processes that share nothing and wait for nothing.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """Two processes are much faster than one, and little time goes into anything but runs."""
    found = {row.who: row for row in rows if row.case != LIMIT}
    speed, beyond = found[TWO].of("speed"), found[ONE].of("beyond")
    return [
        Target(TWO, f"at least {FASTER} times as fast", short(speed), speed >= FASTER),
        Target(ONE, f"at most {100 * BEYOND:g} % beyond", f"{100 * beyond:.1f} %", beyond <= BEYOND),
    ]


COLUMNS: tuple[Column, ...] = (
    ("times as", "fast", lambda row: row.spread("speed") if row.who == TWO else "1"),
    ("runs'", "time", lambda row: row.spread("work") if row.who == TWO else "1"),
    ("beyond", "", lambda row: f"{100 * row.of('beyond'):.1f} %" if "beyond" in row.values else "-"),
    ("s", "", lambda row: short(row.of("seconds")) if "seconds" in row.values else "-"),
    ("", "rounds", lambda row: str(len(row.values["speed"]))),
)
