"""Benchmarks of work: gradient solves, iterations and CPU time for one optimum of every problem of the catalogue, and of others that are
given, beside those of an earlier run; and what runs are charged, beside what they take of a processor."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from textwrap import fill

import numpy as np

from macs import MACS
from macs.gradient_solvers import Optimum, Sweep
from macs.io.console import Steps
from problems import load, names
from problems.cases.standard import SHARE
from problems.catalogue import STANDARD as FOLDER
from transcription import parse

from .contract import Bench, Effort, Row, column, finished, merge
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


# Charges

RUNS = {"search": MACS(refine=False), "sweep": Sweep(1, points=5), "mended": Sweep(1, "mended", 5), "optimum": Optimum(1)}
FITTED = "reentry_case1 dfet:24x3:bernstein:1, reentry_case1 shooting:200, goddard dfet:4x6, goddard shooting:20, orbit_rise dfet:30x1"
BOTH = "goddard multiple-shooting:20, goddard radau:10x4, orbit_rise shooting:30, orbit_rise multiple-shooting:30, orbit_rise radau:15x3, "
BOTH += f"reentry_case1 radau:24x3, skip dfet:12x4, skip multiple-shooting:40, skip radau:12x4, {FITTED.split(', ', 2)[2]}"
ONE = "reentry_case1 dfet:24x3:bernstein:1 search, reentry_case1 shooting:200 search, reentry_case1 shooting:77 optimum, reentry_case1 "
ONE += "multiple-shooting:60x3 search, reentry_case1 multiple-shooting:60x3 optimum, skip shooting:40 search, goddard radau:4x2 mended, "
ONE += "orbit_rise dfet:8x1 mended"
CHARGED = (*(f"{case} {kind}" for case in BOTH.split(", ") for kind in ("search", "sweep")), *ONE.split(", "))


def charged(rows: list[Row], effort: Effort) -> None:
    """Each round, from its number as a seed, has all runs in turn, so that none has a quieter machine than the others. Before the first a
    short search pays for what is made once. Searches whose propagations solve the equations of a re-entry are shorter."""
    stated = cache(lambda name: load(name).compile())
    with Steps("charges", len(effort.cases) * effort.rounds) as steps:
        for seed, case in product(range(1, effort.rounds + 1), effort.cases):
            steps.begin(f"{case}, round {seed}")
            name, word, kind = case.split()
            most = 4000 if "shooting" in word or name in ("goddard", "orbit_rise") else 1000
            for count in (most // 2, most) if seed == 1 and kind == "search" else (most,):
                began = time.process_time()
                front = RUNS[kind].solve(stated(name), parse(word), evaluations=count, seed=seed, inner="propagate", verify=None)
                seconds, nominal = time.process_time() - began, 1e-9 * finished(front).stats["charge"]
            merge(rows, [Row.once(f"{name} {word}", kind, nominal=nominal, processor=seconds, ratio=nominal / seconds)])


def agreement(rows: Sequence[Row], agree: float = 1.5) -> list[str]:
    """How many runs of some kinds agree with the processor and with each other, the greatest ratio between two, and which are outside."""
    every, words = sorted((row.of("ratio"), f"{row.case} {row.who}") for row in rows), ""
    for kinds in (("search",), ("search", "sweep"), tuple(RUNS)):
        (least, low), *_ = own = [one for one in every if one[1].endswith(kinds)]  # rows begin with a search
        most = max(sum(one <= ratio <= agree * one for ratio, _ in own) for one, _ in own)
        near = sum(1 / agree <= ratio <= agree for ratio, _ in own)
        words += f"Of {len(own)} ({', '.join(kinds)}), {near} are within a factor of {agree:g} of the processor, {most} of each other, and "
        words += f"the greatest ratio between two is {own[-1][0] / least:.2f}, of {own[-1][1]} to {low}. "
    words += "Outside: " + (", ".join(f"{who} {ratio:.2f}" for ratio, who in every if not 1 / agree <= ratio <= agree) or "none")
    return fill(f"{words}.", 140, break_on_hyphens=False).splitlines()


CHARGES = Bench(
    title="charges",
    about="CHARGES: seconds that runs are charged, by counts and prices, over those of a processor; median [least, greatest] of rounds, "
    "each with all runs in turn. Search: MACS without gradients, 1000 or 4000 evaluations; sweep: 5 points by gradients; mended: then "
    "simulated, solved again; optimum: one solve. Not here, too long: sweeps of skip by single shooting, of reentry_case1 but by radau.",
    full=Effort(CHARGED, rounds=5),
    quick=Effort(CHARGED[:2]),
    whole=charged,
    columns=(
        ("", "prices", lambda row: "fitted" if row.case in FITTED else "judged"),
        *(column(name, "s", name) for name in ("nominal", "processor")),
        ("ratio", "", lambda row: f"{row.of('ratio'):.2f} [{row.of('ratio', min):.2f}, {row.of('ratio', max):.2f}]"),
    ),
    notes=agreement,
)
