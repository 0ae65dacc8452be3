"""Exponents of growth: slopes of time and memory over size, both on logarithmic scales, beside the asked limit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from macs.io.console import Steps

from ...execution.apart import lines_apart
from ..measured import Column, Row, Target, short, table, verdicts
from .series import SERIES, Series

ASKED = 1.1
"""Largest exponent of what grows linearly: caches, and what is measured, make some hundredths of it."""
FITTED = 3
"""The fit is over so many of the largest sizes, where the cost that does not grow matters least."""
LEAST = 16.0
"""MB by which a process must have grown between the first and the last of these sizes, for its memory to say anything: blocks of the
allocator are that large."""
KINDS = {"time": "seconds", "memory": "MB"}


@dataclass(frozen=True)
class Effort:
    """Rounds; repetitions of each size in a round, of which the quickest counts; whether sizes are the quick ones, and all series of a
    round have one step of progress; seconds that a step may take."""

    rounds: int = 3
    repeats: int = 5
    quick: bool = False
    limit: float = 600.0


FULL, QUICK = Effort(), Effort(rounds=1, repeats=2, quick=True)


def bench_scale(rows: list[Row], effort: Effort, series: Sequence[Series] = SERIES) -> None:
    """Measure all series; `rows` are filled as values become known, also if `Stopped` ends it."""
    sizes = {one.name: one.quick if effort.quick else one.sizes for one in series}
    found = {one.name: Row(one.name, one.unit) for one in series if sizes[one.name]}
    apart = [list(found)] if effort.quick else [[name] for name in found]
    with Steps("growth", effort.rounds * len(apart)) as steps:
        for i in range(effort.rounds):
            for names in apart:
                steps.begin(f"{', '.join(names) if len(names) < 2 else f'{len(names)} series'}, round {i + 1}")
                tasks = [f"{name}:{','.join(map(str, sizes[name]))}" for name in names]
                lines, _ = lines_apart("runs.bench.scale.child", (str(effort.repeats), *tasks), effort.limit, steps)
                measured = [json.loads(line) for line in lines]
                for name in names:
                    add_round(found[name], sizes[name], [one[1:] for one in measured if one[0] == name])
                rows += [found[name] for name in names if i == 0]


def add_round(row: Row, sizes: Sequence[int], measured: Sequence[tuple[int, float, float]]) -> None:
    """Add the repetitions that one process measured, (size, seconds, MB) each, and the exponents of the quickest of each size; a series
    that did not reach its last size has none, and is noted as unfinished. The peak is that of the first repetition: later ones have it
    from larger sizes."""
    quickest = {size: min(one for own, one, _ in measured if own == size) for size, *_ in measured}
    peaks = {size: memory for size, _, memory in reversed(measured)}
    for size, least in quickest.items():
        row.add(**{f"seconds at {size}": least, f"MB at {size}": peaks[size]})
    if len(quickest) < len(sizes):
        row.add(unfinished=1.0)
        return
    largest = sizes[-FITTED:]
    count, seconds, memory = (np.array(one, dtype=float) for one in (largest, [quickest[i] for i in largest], [peaks[i] for i in largest]))
    row.add(size=count[-1], seconds=seconds[-1], MB=memory[-1], time=exponent(count, seconds))
    if memory[-1] - memory[0] >= LEAST:
        row.add(memory=exponent(count, memory))


def exponent(sizes: np.ndarray, costs: np.ndarray) -> float:
    """The power of the size with which costs grow: the slope of a straight line through their logarithms; costs of 0 count as tiny."""
    return float(np.polyfit(np.log(sizes), np.log(np.maximum(costs, 1e-6)), 1)[0])


def targets(rows: Sequence[Row]) -> list[Target]:
    """No cost grows faster than asked, by the median of its exponents, and all series come to their end."""
    made = []
    for kind in KINDS:
        powers = {row.case: row.of(kind) for row in rows if row.values.get(kind)}
        worst = max(powers, key=lambda case: powers[case], default="")
        too_large = {case: power for case, power in powers.items() if not power <= ASKED} or ({worst: powers[worst]} if worst else {})
        measured = ", ".join(f"{power:.2f} ({case})" for case, power in too_large.items()) or "-"
        made.append(Target(f"exponents of {kind}", f"at most {ASKED:g} each", measured, all(power <= ASKED for power in powers.values())))
    unfinished = [row.case for row in rows if row.values.get("unfinished")]
    return [*made, Target("series without an end", "none", ", ".join(unfinished) or "none", not unfinished)]


def report(rows: Sequence[Row]) -> str:
    """The measured values, and the limit."""
    lines = [
        "GROWTH: CPU time and peak memory of work at increasing sizes, each series in a process of its own. Exponents: the power of the",
        f"size with which they grow over the {FITTED} largest sizes, 1 for a cost that is proportional to it. Memory: above that of a",
        f"process with all modules; no exponent where it grows by less than {LEAST:g} MB.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def _exponents(kind: str) -> Column:
    return (kind, "exponent", lambda row: row.spread(kind))


COLUMNS: tuple[Column, ...] = (
    ("largest", "size", lambda row: f"{row.of('size'):g}" if row.values.get("size") else "-"),
    ("seconds", "there", lambda row: short(row.of("seconds"))),
    ("MB", "there", lambda row: short(row.of("MB"))),
    _exponents("time"),
    _exponents("memory"),
)
