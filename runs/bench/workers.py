"""Benchmarks of two processes against one: of calls with `workers=`, with the rounds of work that they need on more, and of studies."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from macs import MACS, Front, payoff, sweep
from macs.io.console import Steps
from macs.io.workers import each, processes
from transcription import DFET

from ..study import Study
from .contract import ASKED, Bench, Column, Effort, Row, Target, column, rounds_of, side_by_side
from .searches import cart_pole

ONE, TWO, ASLEEP, LIMIT = "one process", "two processes", "32 equal tasks", "arithmetic alone"


@dataclass(frozen=True)
class WorkersCase:
    """A call, and how many times as fast it is to be with two processes."""

    name: str
    call: Callable[[], Front]
    asked: float


def measured_calls(case: WorkersCase | str, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """Each round makes the call with one process and with two; of equal tasks, in which threads only wait, with 4 and 16."""

    def measured(number: int) -> Iterable[Row]:
        if isinstance(case, str):
            yield Row.once(case, "16 against 4", part=waited(16) / waited(4))
            return
        timed = side_by_side({ONE: partial(made, case, 1), TWO: partial(made, case, 2)}, number)
        if not np.array_equal(timed[ONE][1][0], timed[TWO][1][0]):
            raise RuntimeError(f"{case.name}: two processes lead to another front than one")
        batches = np.array(timed[TWO][1][1])
        rounds = {f"on {count}": float(np.ceil(batches / count).sum()) for count in (1, 2, 4, 16)}
        for who, (seconds, _) in timed.items():
            yield Row.once(case.name, who, seconds=seconds, speed=timed[ONE][0] / seconds, **(rounds if who == TWO else {}))

    return measured


def made(case: WorkersCase, count: int) -> tuple[np.ndarray, list[int]]:
    """The objectives that a call finds, and the sizes of the batches into which it cuts its work."""
    with processes(count) as helpers:
        before = len(helpers.batches) if helpers else 0
        front = case.call()
        return front.F, helpers.batches[before:] if helpers else []


def waited(count: int) -> float:
    """Seconds of equal tasks in which so many threads only wait."""
    with ThreadPoolExecutor(count) as threads, processes(threads):
        began = time.perf_counter()
        each(lambda seconds, _: time.sleep(seconds), 0.05, [(k,) for k in range(32)])
        return time.perf_counter() - began


def targets(rows: Sequence[Row]) -> list[Target]:
    """Two processes are faster than one by what each case asks."""
    asked = {case.name: case.asked for case in WORKERS.full.cases if isinstance(case, WorkersCase)}
    found = [
        Target(row.case, f"at least {asked[row.case]:g} times as fast", row.short("speed"), row.of("speed") >= asked[row.case])
        for row in rows
        if row.who == TWO
    ]
    equal = [row for row in rows if row.case == ASLEEP]
    return found + [Target(row.case, f"at most {ASKED['16']:g}", row.short("part"), row.of("part") <= ASKED["16"]) for row in equal]


def columns(rows: Sequence[Row]) -> list[Column]:
    """Those of the table, with one for each number of processes for which rounds were counted."""
    counts = dict.fromkeys(name for row in rows for name in row.values if name.startswith("on "))
    return [
        ("times as", "fast", lambda row: row.spread("speed") if row.who == TWO else ""),
        *(column("rounds", name, name) for name in counts),
        column("time of 16", "in that of 4", "part", form=".2f"),
        column("s", "", "seconds"),
        rounds_of("seconds"),
    ]


WORKERS = Bench(
    title="workers",
    about="WORKERS: one call with workers=2 against workers=1, in turn, wall time; median, least and greatest of few rounds. The first "
    "round begins the processes. Rounds on 1, 2, 4 and 16: how often that many processes would begin a piece of work at the same "
    "time, from the sizes of the batches into which the call cuts its work, whatever number there are.",
    full=Effort(
        (
            WorkersCase("payoff of the cart-pole", lambda: payoff(cart_pole(), DFET(10, 5), seed=1), 1.6),
            WorkersCase("sweep of the cart-pole", lambda: sweep(cart_pole(), DFET(10, 5), points=10, seed=1), 1.6),
            WorkersCase("MACS of the cart-pole", lambda: MACS().solve(cart_pole(), seed=1), 1.4),
            ASLEEP,
        ),
        rounds=3,
    ),
    quick=Effort((ASLEEP,)),
    prepare=measured_calls,
    columns=columns,
    targets=targets,
)


# Studies


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


def study_rounds(case: StudyCase, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
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


def study_targets(rows: Sequence[Row]) -> list[Target]:
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
    prepare=study_rounds,
    columns=(
        ("times as", "fast", lambda row: row.spread("speed") if row.who == TWO else "1"),
        ("runs'", "time", lambda row: row.spread("work") if row.who == TWO else "1"),
        column("beyond", "", "beyond", form=".1%"),
        column("s", "", "seconds"),
        rounds_of("speed"),
    ),
    targets=study_targets,
)
