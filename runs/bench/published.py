"""Benchmarks on the published problems, each in a process of its own: whether defaults find the published optimum, and whether all
transcriptions find the same one."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from macs import Front, optimize
from macs.io.console import Steps
from problems import load
from problems.cases.standard import ASKED_ABOUT, SHARE, PublishedOptimum, cases, published
from problems.catalogue import STANDARD as FOLDER
from problems.problem import Problem
from transcription import Meshed, MultipleShooting, Transcription, parse
from transcription.base import CONVERGED

from ..execution.processes import CRASHED, TIMEOUT, lines_apart
from ..execution.task import peak_memory
from .contract import ASKED, Bench, Column, Effort, Row, Target, column

RIGHT, WRONG, VERIFIED, UNVERIFIED, FAILED = "right", "WRONG", "verified", "not verified", "FAILED"


def lines_of(kind: str, name: str, effort: Effort, steps: Steps) -> tuple[list[dict[str, Any]], str]:
    """What `by_defaults` or `by_all_methods` prints for a problem in a process of its own, and why it ended early, if it did."""
    lines, ended = lines_apart(__name__, (kind, name), effort.seconds, steps)
    return [json.loads(line) for line in lines], ended


def told(line: dict[str, Any]) -> None:
    """Print a result, so that it is known even if what follows does not end."""
    print(json.dumps(line), flush=True)


# By defaults


def default_rounds(name: str, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """A round solves a problem with all data whose optimum is published."""

    def measured(number: int) -> Iterable[Row]:
        lines, ended = lines_of("defaults", FOLDER + name, effort, steps)
        yield from rows_of(name, published(name), lines, ended or CRASHED)

    return measured


def rows_of(name: str, records: Sequence[PublishedOptimum | None], lines: Sequence[dict[str, Any]], ended: str) -> Iterator[Row]:
    """The rows of a problem with all its data, of which each has a line, unless they ended early."""
    for i, record in enumerate(records):
        given = ", ".join(f"{key}={value:g}" for key, value in record.data.items()) if record else ""
        line = lines[i] if i < len(lines) else {"status": ended}
        yield compared(f"{name} ({given})" if given else name, record, line)


def records_of(address: str) -> tuple[PublishedOptimum | None, ...]:
    """The published optima of a problem, one for each of its data; None for a problem without."""
    return published(address.removeprefix(FOLDER)) if address.startswith(FOLDER) else (None,)


def by_defaults(address: str) -> None:
    """Print what a user gets without any option, simulated; `seconds` and `cpu` are those from the statement to the solution."""
    for record in records_of(address):
        began, worked = time.perf_counter(), time.process_time()
        problem = load(address, **(record.data if record else {}))
        if not isinstance(problem, Problem):
            return
        point = optimize(problem)
        seconds, cpu = time.perf_counter() - began, time.process_time() - worked
        stats, check = point.alone().stats, point.simulate()
        objective = record.objective if record else next(iter(point.objectives))
        told(
            {
                "status": point.status,
                "ours": point.objectives[objective],
                "simulated": check.objectives[objective],
                "violation": check.violation,
                "seconds": seconds,
                "cpu": cpu,
                "starts": stats["gradient_solves"],
                "iterations": stats["inner_iterations"],
                "verified": float(bool(point.verified)),
                "memory": peak_memory(),
            }
        )


def compared(case: str, record: PublishedOptimum | None, line: dict[str, Any]) -> Row:
    """The row of an optimum; its `who` is the verdict: that of a problem without a published optimum is whether it is verified."""
    values = {key: float(value) for key, value in line.items() if key != "status"}
    if record is not None:
        values["published"] = record.value
    if line["status"] in (TIMEOUT, CRASHED):
        return Row.once(case, line["status"], **values)
    who = VERIFIED
    if record is not None:
        values["error"] = record.error(values["simulated"])
        who = RIGHT if record.met(values["simulated"]) else WRONG
    return Row.once(case, FAILED if line["status"] != "converged" else who if values["verified"] else UNVERIFIED, **values)


def default_targets(rows: Sequence[Row]) -> list[Target]:
    """Nearly all right, none that is believed wrongly, and within the memory."""
    right, wrong = (sum(row.who == who for row in rows) for who in (RIGHT, WRONG))
    most = max((row.of("memory") for row in rows if row.values.get("memory")), default=0.0)
    return [
        Target("right and verified", "at least 17 of 18", f"{right} of {len(rows)}", 18 * right >= 17 * len(rows)),
        Target("wrong, but verified", "none", str(wrong), not wrong),
        Target("memory", f"at most {ASKED['MB']:g} MB each", f"{most:.0f} MB", most <= ASKED["MB"]),
    ]


STANDARD = Bench(
    title="published problems",
    about="PUBLISHED PROBLEMS: the optimum that the defaults find, against the published one. Error: of the value as simulated, relative "
    f"to the published one, or to its scale; right within {SHARE:g}, or what the published digits are good for. Violation: largest "
    "one when simulated. Not verified: said so by the program itself. Seconds: from the statement to the solution.",
    full=Effort(tuple(name for name in cases() if name not in ASKED_ABOUT), seconds=300.0),
    quick=Effort(("linear_tangent", "breakwell", "moon_landing", "schwartz"), seconds=300.0),
    prepare=default_rounds,
    columns=(
        *(column(name, "", name, form=".7g") for name in ("published", "ours", "simulated")),
        column("error", "", "error", form="+.1e"),
        column("vio-", "lation", "violation", form=".0e"),
        column("s", "", "seconds"),
        column("starts", "", "starts"),
        column("itera-", "tions", "iterations"),
        column("MB", "", "memory"),
    ),
    targets=default_targets,
)

WILD = replace(
    STANDARD,
    title="problems that others asked about",
    about=f"FROM THE WILD: each stands for a kind that was wrong once. {STANDARD.about}",
    full=Effort(ASKED_ABOUT, seconds=300.0),
    quick=Effort(("thrift", "rail", "layers"), seconds=300.0),
)


# By all transcriptions

WORDS = ("dfet:16x3", "gauss:16x4", "radau:16x4", "lobatto:16x4", "chebyshev:16x4", "multiple-shooting:120x2:linear")
"""Where each begins: with as many points on as many intervals, or as many nodes of linear controls."""
AGREE = 1e-3
"""Largest difference of two optima, in the scale of the published one: what points may miss by default and still be verified."""
NONE, AGREED, DISAGREED = "-", "agree", "DISAGREE"


def method_rounds(name: str, effort: Effort, steps: Steps) -> Callable[[int], Iterable[Row]]:
    """A round solves a problem by all transcriptions."""

    def measured(number: int) -> Iterable[Row]:
        return [agreement(name, *lines_of("methods", name, effort, steps))]

    return measured


def by_all_methods(name: str) -> None:
    """Print what each method finds for a problem.

    First all begin with the problem's own guess. Those whose optimum differs from the best one begin again from that, or from the next two:
    where there are several optima, which of them is found is a matter of starts. Shooting cannot express a path constraint that is an
    equality, which would leave its controls between two nodes no freedom.
    """
    record = published(name)[0]
    problem = load(FOLDER + name, **record.data)
    compiled = problem.compile()
    sign = next(sign for goal, sign in zip(compiled.goals, compiled.signs, strict=True) if goal.name == record.objective)
    equality = any(limit.lower == limit.upper for phase in compiled.phases for limit in phase.paths)
    best: dict[str, tuple[dict[str, Any], Front]] = {}

    def attempt(word: str, start: Front | None) -> None:
        front = optimum(problem, parse(word), record.objective, start)
        value = front[0].objectives[record.objective]
        line = {"method": word, "value": value, "verified": float(bool(front[0].verified)), "again": float(start is not None)}
        before = best[word][0] if word in best else None
        if before is None or (line["verified"], -sign * value) > (before["verified"], -sign * before["value"]):
            best[word] = line, front
            told(line)

    words = [word for word in WORDS if not (equality and isinstance(parse(word), MultipleShooting))]
    for word in words:
        attempt(word, None)
    good = sorted((word for word in words if best[word][0]["verified"]), key=lambda word: sign * best[word][0]["value"])
    for word in words:
        for start in good[:3]:
            apart = abs(record.error(best[word][0]["value"]) - record.error(best[good[0]][0]["value"]))
            if start != word and not (best[word][0]["verified"] and apart <= AGREE):
                attempt(word, best[start][1])


def optimum(problem: Problem, method: Transcription, objective: str, start: Front | None) -> Front:
    """The optimum by a method from the problem's guess, or from another optimum, on refined meshes where it has any; simulated."""
    given = None
    if start is not None and start[0].trajectory is not None:
        given = method.nlp(problem).interpolate(start[0].trajectory)[None]
    front = Front.of(optimize(problem, method, objective=objective, start=given, verify=None).alone())
    if isinstance(method, Meshed) and front.status[0] == CONVERGED:
        front = front.refine_mesh(tolerance=1e-5, limit=8)
    return front.verify(AGREE)


def agreement(name: str, lines: Sequence[dict[str, Any]], ended: str) -> Row:
    """The row of a problem; its `who` is whether the optima that are verified agree, by their differences from the published one."""
    record, last = published(name)[0], {str(line["method"]): line for line in lines}
    errors = {word: record.error(line["value"]) for word, line in last.items() if line["verified"]}
    middle, verdict = float(np.median(list(errors.values()))) if errors else 0.0, NONE
    if len(errors) > 1:
        verdict = AGREED if all(abs(error - middle) <= within(parse(word)) for word, error in errors.items()) else DISAGREED
    values = {"published": record.value}
    for word, line in last.items():
        values |= {word: line["value"], f"{word} verified": line["verified"], f"{word} again": line["again"]}
    return Row.once(name, f"{verdict}, {ended}" if ended else verdict, **values)


def within(method: Transcription) -> float:
    """By how much an optimum may differ: more where edges do not move, since linear controls cannot switch but within an interval."""
    return AGREE if isinstance(method, Meshed) and method.moves_edges else 10 * AGREE


def method_targets(rows: Sequence[Row]) -> list[Target]:
    """No two verified optima of one problem disagree."""
    different = [row.case for row in rows if row.who.startswith(DISAGREED)]
    return [Target("verified, but different", "none", ", ".join(different) or "none", not different)]


def counts(rows: Sequence[Row]) -> list[str]:
    """How many problems agree, and how many ended early."""
    agreed, ended = sum(row.who.startswith(AGREED) for row in rows), sum(TIMEOUT in row.who or CRASHED in row.who for row in rows)
    return [f"agree: {agreed} of {len(rows)}; ended early: {ended}", ""]


def method_column(word: str) -> Column:
    """The optima of a method; * from an optimum of another one, (in brackets) not verified."""

    def text(row: Row) -> str:
        if not row.values.get(word):
            return NONE
        value = f"{row.of(word):.7g}" + "*" * int(row.of(f"{word} again"))
        return value if row.of(f"{word} verified") else f"({value})"

    name, _, mesh = word.partition(":")
    return (name, mesh, text)


METHODS = Bench(
    title="published problems",
    about="TRANSCRIPTIONS: the optimum of each published problem by every method, each from the problem's guess, on refined meshes, and "
    "simulated. *: from an optimum of another, since its own start led elsewhere. (In brackets): not verified. Verified optima "
    f"agree within {AGREE:g} of the published value, or of its scale; linear controls, by shooting, within {10 * AGREE:g}.",
    full=Effort(tuple(cases()), seconds=300.0),
    quick=Effort(("breakwell", "linear_tangent", "schwartz", "zermelo"), seconds=300.0),
    prepare=method_rounds,
    columns=(column("published", "", "published", form=".7g"), *map(method_column, WORDS)),
    targets=method_targets,
    notes=counts,
)


if __name__ == "__main__":
    {"defaults": by_defaults, "methods": by_all_methods}[sys.argv[1]](sys.argv[2])
