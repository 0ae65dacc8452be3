"""Benchmark of `workers=`: one call on two processes against one, and the rounds of work that it needs on more."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from macs import MACS, Front, payoff, sweep
from macs.io.console import Steps
from macs.io.workers import each, processes
from transcription import DFET

from .contract import ASKED, Bench, Column, Effort, Row, Target, column, rounds_of, side_by_side
from .searches import cart_pole

ONE, TWO = "one process", "two processes"
ASLEEP = "32 equal tasks"


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
