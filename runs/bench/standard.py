"""Benchmark of published problems: each solved with defaults, in a process of its own, and compared with its published optimum when
simulated."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

from macs import optimize
from macs.io.console import Steps
from problems import load
from problems.cases.standard import SHARE, PublishedOptimum, cases, published
from problems.catalogue import STANDARD

from ..execution.apart import CRASHED, LATE, lines_apart
from ..execution.memory import peak_memory
from .measured import Column, Row, Target, short, table, verdicts

RIGHT, WRONG, UNVERIFIED, FAILED = "right", "WRONG", "not verified", "FAILED"
QUICK = ("linear_tangent", "breakwell", "moon_landing", "schwartz")
MEMORY = 1500.0
"""Target: megabytes of each process."""


@dataclass(frozen=True)
class Effort:
    """Size of a measurement: names of problems (all if none), and seconds after which one is ended."""

    names: tuple[str, ...] = ()
    limit: float = 300.0


def bench_standard(rows: list[Row], effort: Effort) -> None:
    """Measure; `rows` are filled as values become known, also if `Stopped` ends it."""
    tasks = [(name, i) for name in effort.names or cases() for i in range(len(published(name)))]
    with Steps("published problems", len(tasks)) as steps:
        for name, i in tasks:
            steps.begin(title(name, i))
            rows.append(compared(title(name, i), published(name)[i], apart(name, i, effort.limit, steps)))


def title(name: str, i: int) -> str:
    """A problem with its data, where they are not the defaults."""
    data = ", ".join(f"{key}={value:g}" for key, value in published(name)[i].data.items())
    return f"{name} ({data})" if data else name


def solved(name: str, i: int) -> dict[str, float | str]:
    """What a user gets without any option, simulated; `seconds` are those from the statement to the solution."""
    record, began = published(name)[i], time.perf_counter()
    problem = load(STANDARD + name, **record.data)
    point = optimize(problem)
    seconds = time.perf_counter() - began
    stats = point.alone().stats
    check = point.simulate()
    return {
        "status": point.status,
        "ours": point.objectives[record.objective],
        "simulated": check.objectives[record.objective],
        "violation": check.violation,
        "seconds": seconds,
        "starts": stats["gradient_solves"],
        "iterations": stats["inner_iterations"],
        "verified": float(bool(point.verified)),
        "memory": peak_memory(),
    }


def apart(name: str, i: int, limit: float, steps: Steps) -> dict[str, float | str]:
    """`solved` in a process of its own."""
    lines, ended = lines_apart(__name__, (name, str(i)), limit, steps)
    return {"status": ended, "seconds": limit} if ended else json.loads(lines[-1])


def compared(case: str, record: PublishedOptimum, found: dict[str, float | str]) -> Row:
    """The row of a problem; its `who` is the verdict."""
    values = {key: float(value) for key, value in found.items() if key != "status"}
    if found["status"] in (LATE, CRASHED):
        row = Row(case, str(found["status"]))
    else:
        simulated = values["simulated"]
        values["error"] = record.error(simulated)
        right = RIGHT if record.met(simulated) else WRONG
        row = Row(case, FAILED if found["status"] != "converged" else right if values["verified"] else UNVERIFIED)
    row.add(published=record.value, **values)
    return row


def report(rows: Sequence[Row]) -> str:
    """The measured values, and the targets."""
    lines = [
        "PUBLISHED PROBLEMS: the optimum that the defaults find, against the published one. Error: of the value as simulated, relative to",
        f"the published one, or to its scale; right within {SHARE:g}, or what the published digits are good for. Violation: largest one",
        "when simulated. Not verified: said so by the program itself. Seconds: from the statement to the solution.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """Nearly all right, none that is believed wrongly, and within the memory."""
    right, wrong = (sum(row.who == who for row in rows) for who in (RIGHT, WRONG))
    most = max(row.of("memory") if "memory" in row.values else 0.0 for row in rows)
    return [
        Target("right and verified", "at least 17 of 18", f"{right} of {len(rows)}", 18 * right >= 17 * len(rows)),
        Target("wrong, but verified", "none", str(wrong), not wrong),
        Target("memory", f"at most {MEMORY:g} MB each", f"{most:.0f} MB", most <= MEMORY),
    ]


def _value(name: str) -> Column:
    return (name, "", lambda row: f"{row.of(name):.7g}" if row.values.get(name) else "-")


def _short(name: str, header: str, unit: str = "") -> Column:
    return (header, unit, lambda row: short(row.of(name)) if row.values.get(name) else "-")


COLUMNS: tuple[Column, ...] = (
    _value("published"),
    _value("ours"),
    _value("simulated"),
    ("error", "", lambda row: f"{row.of('error'):+.1e}" if row.values.get("error") else "-"),
    ("vio-", "lation", lambda row: f"{row.of('violation'):.0e}" if row.values.get("violation") else "-"),
    _short("seconds", "s"),
    _short("starts", "starts"),
    _short("iterations", "itera-", "tions"),
    _short("memory", "MB"),
)


if __name__ == "__main__":
    print(json.dumps(solved(sys.argv[1], int(sys.argv[2]))))
