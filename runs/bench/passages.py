"""Benchmark of the passages of aerocapture: Newton's method on collocation and the table, against `solve_bvp`, at known accuracy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from macs.io.console import Steps
from problems.cases.aerocapture.passage import PASSAGE, Passage, Passages, passages
from problems.cases.aerocapture.passage_table import tabulated

from .measured import Column, Row, Target, short, table, verdicts
from .rivals.by_solve_bvp import solved

SINGLY, TOGETHER, TABLE = "ours, one by one", "ours, in one call", "table, in one call"
RIVALS = {"solve_bvp, 1e-6": (80, 1e-6), "solve_bvp, 1e-8": (80, 1e-8)}
"""Numbers of nodes to begin with, of 10 to 160 those that take least, and tolerances."""
AGAINST = "solve_bvp, 1e-8"
"""The paper's accuracy."""
ASKED = {SINGLY: 5.0, TABLE: 200.0}


@dataclass(frozen=True)
class Effort:
    """Size of a measurement: rounds, ballistic coefficients, and those of the calls of the table."""

    rounds: int = 7
    coefficients: int = 20
    rows: int = 1000


QUICK = Effort(rounds=2, coefficients=5)


def bench_passages(rows: list[Row], effort: Effort) -> None:
    """Measure; `rows` are filled as values become known, also if `Stopped` ends it."""
    few, many = (np.geomspace(40.0, 1000.0, count) for count in (effort.coefficients, effort.rows))
    truths = {len(bc): _columns(passages(bc, Passage(intervals=24))) for bc in (few, many)}
    contenders: dict[str, tuple[np.ndarray, Callable[[], np.ndarray]]] = {
        who: (few, lambda nodes=nodes, tolerance=tolerance: np.array([solved(bc, PASSAGE, nodes, tolerance) for bc in few]))  # type: ignore[misc]
        for who, (nodes, tolerance) in RIVALS.items()
    }
    contenders[SINGLY] = few, lambda: np.vstack([_columns(passages(bc)) for bc in few])
    contenders[TOGETHER] = few, lambda: _columns(passages(few))
    contenders[TABLE] = many, lambda: _columns(tabulated(many))
    case = f"passages, 40 to 1000 kg/m2, {len(few)} coefficients"
    found = {who: Row(case, who) for who in contenders}
    with Steps("passages", effort.rounds + 1) as steps:
        steps.begin("to begin with")
        errors = {who: float(np.abs(work() / truths[len(bc)] - 1.0).max()) for who, (bc, work) in contenders.items()}
        for i in range(effort.rounds):
            steps.begin(f"round {i + 1}")
            seconds = {who: _seconds(work) / len(bc) for who, (bc, work) in contenders.items()}
            for who, taken in seconds.items():
                found[who].add(speed=seconds[AGAINST] / taken, microseconds=1e6 * taken, error=errors[who])
            if i == 0:
                rows += found.values()


def _columns(solutions: Passages) -> np.ndarray:
    """Lift, entry angle and arc, which `solve_bvp` gives, too: (n, 3)."""
    return np.column_stack([solutions.lift, solutions.entry_angle, solutions.arc])


def _seconds(work: Callable[[], np.ndarray]) -> float:
    """Time of this process alone in a call."""
    began = process_time()
    work()
    return process_time() - began


def report(rows: Sequence[Row]) -> str:
    """The measured values, and the targets."""
    lines = [
        f"PASSAGES: the boundary value problem of aerocapture, against {AGAINST}, in turn; median, and quartiles or least and greatest.",
        "solve_bvp has vectorised rates, all derivatives and the same guess, and no heat load, which ours have. Error: greatest of lift,",
        "entry angle and arc, relative to a fine mesh. Microseconds of this process for a coefficient depend on the machine and its load.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """Ours are so many times as fast."""
    return [
        Target(row.who, f"at least {ASKED[row.who]:.0f} times as fast", short(row.of("speed")), row.of("speed") >= ASKED[row.who])
        for row in rows
        if row.who in ASKED
    ]


COLUMNS: tuple[Column, ...] = (
    ("times as", "fast", lambda row: "1" if row.who == AGAINST else row.spread("speed")),
    ("", "microseconds", lambda row: short(row.of("microseconds"))),
    ("greatest", "error", lambda row: f"{row.of('error'):.0e}"),
    ("", "rounds", lambda row: str(len(row.values["speed"]))),
)
