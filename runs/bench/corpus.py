"""Benchmark of the work for one optimum: gradient solves, iterations and CPU time of every problem of the catalogue, and of others that are
given, beside those of an earlier run."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from macs.io.console import Steps
from problems import names
from problems.cases.standard import SHARE
from problems.catalogue import STANDARD as FOLDER

from .contract import Bench, Effort, Row, column
from .published import RIGHT, VERIFIED, lines_of, records_of, rows_of

BEFORE = ", before"
"""What is added to the verdict of an earlier run."""
WORK = {"starts": "gradient solves", "iterations": "iterations", "cpu": "CPU time"}


def corpus_rounds(address: str, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """A round solves a problem with all its data, in a process of its own."""

    def measured(number: int) -> Iterable[Row]:
        lines, ended = lines_of("defaults", address, effort, steps)
        # Of a problem without trajectories there is no line.
        return rows_of(Path(address).name if ".py:" in address else address, records_of(address) if lines or ended else (), lines, ended)

    return measured


def is_solved(row: Row) -> bool:
    """Whether the optimum was found, as far as it is known."""
    return row.who.removesuffix(BEFORE) in (RIGHT, VERIFIED)


def earlier(file: str | Path) -> dict[str, Row]:
    """The rows of an earlier run by their cases, from its CSV file. Raises ValueError if that has none."""
    found = dict[str, Row]()
    try:
        with Path(file).open(newline="") as lines:
            for line in csv.DictReader(lines):
                if line.get("benchmark") == "corpus":
                    row = found.setdefault(line["case"], Row(line["case"], line["contender"] + BEFORE))
                    row.values.setdefault(line["quantity"], []).append(float(line["value"]))
    except OSError as error:
        raise ValueError(f"cannot read {file}: {error.strerror}") from error
    if not found:
        raise ValueError(f"{file} has no values of `macs bench corpus --csv`")
    return found


def means(rows: Sequence[Row]) -> list[str]:
    """Geometric means of the work of solved problems and, beside an earlier run, of its ratios; and what was solved only then."""
    now, solved = [row for row in rows if not row.who.endswith(BEFORE)], [row for row in rows if is_solved(row)]
    before = {row.case: row for row in solved if row.who.endswith(BEFORE)}
    both = [(row, before[row.case]) for row in now if is_solved(row) and row.case in before]
    lines = [f"solved: {sum(map(is_solved, now))} of {len(now)}"]
    for name, words in WORK.items():
        amounts = [row.of(name) for row in now if is_solved(row) and row.of(name) > 0]
        line = f"{words}: geometric mean {np.exp(np.mean(np.log(amounts))):.3g}" if amounts else f"{words}: -"
        ratios = [row.of(name) / other.of(name) for row, other in both if row.of(name) > 0 and other.of(name) > 0]
        lines.append(f"{line}, {np.exp(np.mean(np.log(ratios))):.3f} times those before" if ratios else line)
    if before:
        lost = [row.case for row in now if row.case in before and not is_solved(row)]
        other = [row.case for row, one in both if abs(row.of("ours") - one.of("ours")) > SHARE * max(abs(one.of("ours")), 1e-6)]
        slower = [row.case for row, one in both if row.of("cpu") > 1.2 * one.of("cpu") + 0.2]
        for what, cases in (("solved before only", lost), ("another optimum", other), ("slower by a fifth and 0.2 s", slower)):
            lines.append(f"{what}: {', '.join(cases) or 'none'}")
    return [*lines, ""]


CORPUS = Bench(
    title="corpus",
    about="CORPUS: work for the optimum of the first objective of each problem, without any option, each in a process of its own. Right: "
    "the published optimum, simulated; verified: none is published. Iterations, unlike CPU seconds, do not depend on the machine's load.",
    full=Effort(tuple(names()), seconds=300.0),
    quick=Effort(tuple(FOLDER + name for name in ("breakwell", "linear_tangent", "moon_landing", "zermelo")), seconds=300.0),
    prepare=corpus_rounds,
    columns=(column("optimum", "", "ours", form=".7g"), *(column(name, "", name) for name in WORK)),
    notes=means,
)
