"""Benchmark of populations: all candidates of a generation propagated in one call, against one after the other."""

from __future__ import annotations

import timeit
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from macs.io.console import Steps
from problems import load
from transcription import Smooth, Transcription, parse
from transcription.inner import Propagate
from transcription.numerics.batched import compiler

from .inner import compiling
from .measured import Column, Row, Target, short, table, verdicts

CASE, METHOD = "reentry_case1", "shooting:200"
SINGLY, TOGETHER, COMPILED = "one by one", "in one call", "in one call, compiled"
ASKED = 4.0
"""Times as fast as one by one in one call, without a compiler. Candidates a second would depend on the machine."""


@dataclass(frozen=True)
class Effort:
    """Size of a measurement: rounds, calls of each contender in a round, of which the quickest counts, candidates, and the case."""

    rounds: int = 5
    calls: int = 5
    candidates: int = 120
    method: str = METHOD


QUICK = Effort(rounds=2, calls=2)


def bench_population(rows: list[Row], effort: Effort) -> None:
    """Measure; `rows` are filled as values become known, also if `Stopped` ends it."""
    problem, method = load(CASE), parse(effort.method)
    X = Smooth().draw(problem, method, effort.candidates, np.random.default_rng(0))
    case = f"{CASE}, {effort.method}, {effort.candidates} candidates"
    plain = _propagator(method, "0")
    contenders: dict[str, Callable[[], None]] = {SINGLY: lambda: [plain(x[None]) for x in X][-1], TOGETHER: lambda: plain(X)}
    if compiler():
        quick = _propagator(method, "always")
        contenders[COMPILED] = lambda: quick(X)
    found = {who: Row(case, who) for who in contenders}
    with Steps("populations", effort.rounds + 1) as steps:
        steps.begin("to begin with")
        for work in contenders.values():
            work()  # functions are made
        for i in range(effort.rounds):
            steps.begin(f"round {i + 1}")
            seconds = {who: min(timeit.repeat(work, number=1, repeat=effort.calls)) for who, work in contenders.items()}
            for who, taken in seconds.items():
                found[who].add(speed=seconds[SINGLY] / taken, candidates=effort.candidates / taken)
            if i == 0:
                rows += found.values()


def _propagator(method: Transcription, when: str) -> Callable[[np.ndarray], None]:
    """The function that propagates candidates (k, d), compiled or not, see `compiling`."""
    with compiling(when):
        nlp = method.transcribe(load(CASE))

    def propagate(candidates: np.ndarray) -> None:
        with compiling(when):
            Propagate().solve(nlp, candidates)

    return propagate


def report(rows: Sequence[Row]) -> str:
    """The measured values, and the targets."""
    lines = [
        "POPULATIONS: the candidates of a population search, propagated and scored in one call, against one after the other, in turn;",
        "median, least and greatest of few rounds. Candidates a second depend on the machine and its load.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """One call is so many times as fast as one by one, by the median of the rounds."""
    speed = next(row for row in rows if row.who == TOGETHER).of("speed")
    return [Target("in one call, without a compiler", f"at least {ASKED:g} times as fast", short(speed), speed >= ASKED)]


COLUMNS: tuple[Column, ...] = (
    ("times as", "fast", lambda row: "1" if row.who == SINGLY else row.spread("speed")),
    ("candidates", "a second", lambda row: short(row.of("candidates"))),
    ("", "rounds", lambda row: str(len(row.values["speed"]))),
)
