"""Benchmark of transcriptions: each published problem by every method, refined and simulated, and whether all that solve it agree."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from macs import Front, optimize
from macs.io.console import Steps
from problems import load
from problems.cases.standard import cases, published
from problems.catalogue import STANDARD
from problems.problem import Problem
from transcription import Meshed, MultipleShooting, Transcription, parse
from transcription.base import CONVERGED

from ..execution.apart import CRASHED, LATE, lines_apart
from .measured import Column, Row, Target, table, verdicts

METHODS = ("dfet:16x3", "gauss:16x4", "radau:16x4", "lobatto:16x4", "chebyshev:16x4", "multiple-shooting:120x2:linear")
"""Where each begins: with as many points on as many intervals, or as many nodes of linear controls."""
QUICK = ("breakwell", "linear_tangent", "schwartz", "zermelo")
AGREE = 1e-3
"""Largest difference of two optima, in the scale of the published one: what points may miss by default and still be verified."""
COARSER = 1e-2
"""The same for a method whose edges do not move: its linear controls cannot switch but within an interval."""
TOLERANCE, MESHES = 1e-5, 8
"""Of mesh refinement, and the most meshes."""
STARTS = 3
"""Most optima of others from which a method begins once more."""
NONE, AGREED, DISAGREED = "-", "agree", "DISAGREE"


@dataclass(frozen=True)
class Effort:
    """Size of a measurement: names of problems (all if none), and seconds after which one is ended."""

    names: tuple[str, ...] = ()
    limit: float = 300.0


def bench_methods(rows: list[Row], effort: Effort) -> None:
    """Measure; `rows` are filled as values become known, also if `Stopped` ends it."""
    names = effort.names or tuple(cases())
    with Steps("published problems", len(names)) as steps:
        for name in names:
            steps.begin(name)
            lines, ended = lines_apart(__name__, (name,), effort.limit, steps)
            rows.append(compared(name, [json.loads(line) for line in lines], ended))


def solved(name: str) -> list[dict[str, float | str]]:
    """What each method finds for a problem, printed as soon as it is known.

    First all begin with the problem's own guess. Those whose optimum differs from the best one begin once more from that, or from the next
    best: where there are several optima, which of them is found is a matter of starts. Shooting cannot express a path constraint that is
    an equality, which would leave its controls between two nodes no freedom.
    """
    record = published(name)[0]
    problem = load(STANDARD + name, **record.data)
    sign = next(sign for goal, sign in zip(problem.compile().goals, problem.compile().signs, strict=True) if goal.name == record.objective)
    exact = any(limit.lower == limit.upper for phase in problem.compile().phases for limit in phase.paths)
    words = [word for word in METHODS if not (exact and isinstance(parse(word), MultipleShooting))]
    fronts: dict[str, Front] = {}
    found: dict[str, dict[str, float | str]] = {}

    def try_it(word: str, start: Front | None) -> None:
        front = _optimum(problem, parse(word), record.objective, start)
        point = front[0]
        value = point.objectives[record.objective]
        here: dict[str, float | str] = {"method": word, "value": value, "status": point.status, "verified": float(bool(point.verified))}
        here |= {"again": float(start is not None), "violation": float(np.nan_to_num(point.simulated_violation or np.inf, posinf=1e300))}
        better = word not in found or (here["verified"], -sign * value) > (found[word]["verified"], -sign * float(found[word]["value"]))
        if better:
            found[word], fronts[word] = here, front
            print(json.dumps(here), flush=True)

    for word in words:
        try_it(word, None)
    good = sorted((word for word in words if found[word]["verified"]), key=lambda word: sign * float(found[word]["value"]))
    for word in words:
        for start in good[:STARTS]:
            apart = abs(record.error(float(found[word]["value"])) - record.error(float(found[good[0]]["value"])))
            if start != word and not (found[word]["verified"] and apart <= AGREE):
                try_it(word, fronts[start])
    return list(found.values())


def _optimum(problem: Problem, method: Transcription, objective: str, start: Front | None) -> Front:
    """The optimum by a method from the problem's guess, or from another optimum, on refined meshes where it has any; simulated."""
    given = None
    if start is not None and start[0].trajectory is not None:
        given = method.nlp(problem).interpolate(start[0].trajectory)[None]
    front = Front.of(optimize(problem, method, objective=objective, start=given, verify=None).alone())
    if isinstance(method, Meshed) and front.status[0] == CONVERGED:
        front = front.refine_mesh(tolerance=TOLERANCE, limit=MESHES)
    return front.verify(AGREE)


def compared(name: str, found: Sequence[dict[str, float | str]], ended: str) -> Row:
    """The row of a problem; its `who` is the verdict."""
    record = published(name)[0]
    last = {str(one["method"]): one for one in found}
    good = {word: record.error(float(one["value"])) for word, one in last.items() if one["verified"]}
    row = Row(name, _verdict_of(good) + (f", {ended}" if ended else ""))
    row.add(published=record.value)
    for word, one in last.items():
        row.add(**{word: float(one["value"]), f"{word} verified": float(one["verified"]), f"{word} again": float(one["again"])})
    return row


def _verdict_of(errors: dict[str, float]) -> str:
    """Whether optima that are verified agree, from their differences from the published one."""
    if len(errors) < 2:
        return NONE
    middle = float(np.median(list(errors.values())))
    return AGREED if all(abs(error - middle) <= _within(parse(word)) for word, error in errors.items()) else DISAGREED


def _within(method: Transcription) -> float:
    """By how much an optimum may differ."""
    return AGREE if isinstance(method, Meshed) and method.moves_edges else COARSER


def targets(rows: Sequence[Row]) -> list[Target]:
    """No two verified optima of one problem disagree."""
    different = [row.case for row in rows if row.who.startswith(DISAGREED)]
    return [Target("verified, but different", "none", ", ".join(different) or "none", not different)]


def report(rows: Sequence[Row]) -> str:
    """The optima, and whether they agree."""
    agreed, ended = sum(row.who.startswith(AGREED) for row in rows), sum(LATE in row.who or CRASHED in row.who for row in rows)
    lines = [
        "TRANSCRIPTIONS: the optimum of each published problem by every method, each from the problem's guess, on refined meshes,",
        "and simulated. *: from an optimum of another, since its own start led elsewhere. (In brackets): not verified.",
        f"Verified optima agree within {AGREE:g} of the published value, or of its scale; linear controls, by shooting,",
        f"within {COARSER:g}.",
        "",
        table(rows, COLUMNS),
        "",
        f"agree: {agreed} of {len(rows)}; ended early: {ended}",
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def _cell(word: str) -> Column:
    def text(row: Row) -> str:
        if not row.values.get(word):
            return NONE
        value = f"{row.of(word):.7g}" + "*" * int(row.of(f"{word} again"))
        return value if row.of(f"{word} verified") else f"({value})"

    name, _, mesh = word.partition(":")
    return (name, mesh, text)


COLUMNS: tuple[Column, ...] = (("published", "", lambda row: f"{row.of('published'):.7g}"), *map(_cell, METHODS))


if __name__ == "__main__":
    solved(sys.argv[1])
