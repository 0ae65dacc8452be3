"""Benchmark of studies: two processes against one, and the time of a study beyond that of its runs."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from macs.io.console import Steps

from ..study import Study
from .contract import ASKED, Bench, Effort, Row, Target, column, rounds_of, side_by_side

ONE, TWO = "one process", "two processes"
LIMIT = "arithmetic alone"


@dataclass(frozen=True)
class StudyCase:
    """Runs of a study, an even number, evaluations of each, and the length of a loop that needs nothing but a core."""

    runs: int = 8
    evaluations: int = 5_000
    loop: int = 20_000_000

    @property
    def name(self) -> str:
        """Of its rows."""
        return f"goddard, {self.runs} runs of {self.evaluations}"


def rounds(case: StudyCase, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each round runs the study with one process and with two, and so the loop."""
    batch = Study("bench", problems="goddard", solvers="macs", evaluations=case.evaluations, runs=case.runs, seed=1)

    def measured(number: int) -> Iterable[Row]:
        timed = side_by_side({ONE: partial(seconds_of_runs, batch, 1), TWO: partial(seconds_of_runs, batch, 2)}, number)
        seconds, work = ({who: one[i] for who, one in timed.items()} for i in (0, 1))
        for who, jobs in ((ONE, 1), (TWO, 2)):
            values = {"seconds": seconds[who], "work": work[who] / work[ONE], "beyond": jobs * seconds[who] / work[who] - 1.0}
            yield Row.once(case.name, who, speed=seconds[ONE] / seconds[who], **values)
        loops = side_by_side({ONE: partial(spin, case.loop, 1), TWO: partial(spin, case.loop, 2)}, number)
        yield Row.once(LIMIT, TWO, speed=loops[ONE][0] / loops[TWO][0])

    return measured


def seconds_of_runs(batch: Study, jobs: int) -> float:
    """Make a study; returns the seconds of all its runs together."""
    with tempfile.TemporaryDirectory(prefix="macs_") as folder:
        summary = batch.run(Path(folder) / "out", jobs=jobs)
    if summary.finished < len(summary.runs):
        raise RuntimeError(f"runs failed, so there is nothing to compare: {next(run.message for run in summary.runs if not run.finished)}")
    return float(np.sum([run.wall_time for run in summary.runs]))


def spin(count: int, at_once: int) -> None:
    """Two processes of plain arithmetic, `at_once` at a time."""
    code = f"total = 0\nfor i in range({count}):\n    total += i * i"
    for _ in range(2 // at_once):
        for process in [subprocess.Popen([sys.executable, "-c", code]) for _ in range(at_once)]:
            process.wait()


def targets(rows: Sequence[Row]) -> list[Target]:
    """Two processes are much faster than one, and little time goes into anything but runs."""
    by_who = {row.who: row for row in rows if row.case != LIMIT}
    speed, beyond = by_who[TWO].of("speed"), by_who[ONE].of("beyond")
    return [
        Target(TWO, f"at least {ASKED['study']:g} times as fast", by_who[TWO].short("speed"), speed >= ASKED["study"]),
        Target(ONE, f"at most {100 * ASKED['beyond']:g} % beyond", f"{100 * beyond:.1f} %", beyond <= ASKED["beyond"]),
    ]


STUDY = Bench(
    title="studies",
    about="STUDIES: a whole study with two processes against one, in turn; median, least and greatest of few rounds. Runs' time: that of "
    "all runs together, as multiples of what they take one at a time; above 1, runs that go on side by side slow each other down. "
    "Beyond: the time of the study beyond its runs', as a share of it: writing files, waiting for the last run, and a second or "
    "two for each process to start once, which weighs more here than in a study of many long runs. Arithmetic alone: the same "
    "ratio of two processes that share nothing and wait for nothing.",
    full=Effort((StudyCase(),), rounds=3),
    quick=Effort((StudyCase(runs=6, evaluations=500, loop=5_000_000),)),
    prepare=rounds,
    columns=(
        ("times as", "fast", lambda row: row.spread("speed") if row.who == TWO else "1"),
        ("runs'", "time", lambda row: row.spread("work") if row.who == TWO else "1"),
        column("beyond", "", "beyond", form=".1%"),
        column("s", "", "seconds"),
        rounds_of("speed"),
    ),
    targets=targets,
)
