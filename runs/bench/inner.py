"""Benchmark of inner levels: the same batches in turn, so that a noisy machine affects all alike."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from macs.io.console import Steps
from transcription import NLP
from transcription.base import CONVERGED
from transcription.inner import InnerResult, InnerSolver, Ipopt, Newton, Projection, Propagate
from transcription.numerics.batched import compiler

from .cases import BATCH, INNER, Batch, Case
from .measured import Column, Row, Target, short, table, verdicts

BASELINE, PROJECTION, DEFAULT = "ipopt, constant objective", "ipopt, projection", "projection"
EXACT = Ipopt()
EXACT_TOLERANCE = 1e-11
AT_LEAST = 5e-3
"""Seconds for which a fast solver repeats a batch, so that the clock and a hiccup matter less."""
RANGES = 20
"""Random candidates whose feasible points give the objectives' ranges."""


@dataclass(frozen=True)
class Effort:
    """Size of a measurement: rounds for each case, as many as fit into some seconds; in how many of them the exact projection is solved;
    and whether functions are measured interpreted too, where they can be compiled."""

    least: int = 5
    rounds: int = 40
    seconds: float = 12.0
    checked: int = 6
    interpreted: bool = True


QUICK = Effort(least=2, rounds=6, seconds=1.0, checked=1, interpreted=False)


@dataclass
class Contender:
    """An inner level and the NLP that it works on; `when` is whether that may be compiled, see `compiling`."""

    row: Row
    solver: InnerSolver
    nlp: NLP
    when: str

    def solve(self, candidates: np.ndarray, warm: np.ndarray | None, tolerance: float) -> InnerResult:
        with compiling(self.when):
            return self.solver.solve(self.nlp, candidates, warm, tolerance=tolerance)

    def timed(self, candidates: np.ndarray, warm: np.ndarray | None, tolerance: float) -> tuple[float, InnerResult]:
        """Seconds for each candidate, and the results."""
        began, times = time.perf_counter(), 0
        while True:
            result = self.solve(candidates, warm, tolerance)
            times, elapsed = times + 1, time.perf_counter() - began
            if elapsed >= AT_LEAST:
                return elapsed / times / len(candidates), result


def bench_inner(rows: list[Row], effort: Effort, cases: Sequence[Case] = INNER) -> None:
    """Measure all cases; `rows` are filled as values become known, also if `Stopped` ends it."""
    with Steps("inner levels", len(cases)) as steps:
        for case in cases:
            steps.begin(case.name)
            _measure(case, rows, effort, steps)


def _measure(case: Case, rows: list[Row], effort: Effort, steps: Steps) -> None:
    rng = np.random.default_rng(0)
    contenders = _contenders(case, effort)
    nlp, when = contenders[0].nlp, contenders[0].when
    with compiling(when):
        ranges = _ranges(nlp, case.tolerance)
        batches = [case.batch(nlp, rng) for _ in range(effort.rounds)]
    _warm_up(case, contenders, batches, effort.seconds)
    began = time.perf_counter()
    for i, (candidates, warm) in enumerate(batches):
        steps.check()
        exact = EXACT.solve(nlp, candidates, warm, tolerance=EXACT_TOLERANCE) if i < effort.checked else None
        # The order changes, so that none always follows the slow one.
        turn = i % len(contenders)
        timed = {id(c): c.timed(candidates, warm, case.tolerance) for c in contenders[turn:] + contenders[:turn]}
        baseline, _ = timed[id(contenders[0])]
        if i == 0:
            rows += [contender.row for contender in contenders]
        for contender in contenders:
            seconds, result = timed[id(contender)]
            contender.row.add(speed=baseline / seconds, seconds=seconds, **_quality(result, exact, ranges))
        if i + 1 >= effort.least and time.perf_counter() - began > effort.seconds:
            return


def _contenders(case: Case, effort: Effort) -> list[Contender]:
    """The baseline comes first."""
    problem = case.make()
    when = "always" if compiler() else "0"
    with compiling(when):
        nlp = case.mesh.transcribe(problem)
    solvers: dict[str, InnerSolver] = {BASELINE: Ipopt(objective="constant"), PROJECTION: Ipopt(), "newton": Newton()}
    solvers |= {DEFAULT: Projection()} | ({"propagate": Propagate()} if case.propagates else {})
    contenders = [Contender(Row(case.name, name), solver, nlp, when) for name, solver in solvers.items()]
    if when != "0" and effort.interpreted:
        with compiling("0"):
            contenders.append(Contender(Row(case.name, f"{DEFAULT}, interpreted"), Projection(), case.mesh.transcribe(problem), "0"))
    return contenders


def _warm_up(case: Case, contenders: Sequence[Contender], batches: Sequence[Batch], seconds: float) -> None:
    """Programs get built and functions compiled before the clock is looked at, with all the numbers of candidates that will be needed."""
    candidates, warm = batches[0]
    for contender in contenders:
        contender.solve(candidates[:1], None if warm is None else warm[:1], case.tolerance)
    began = time.perf_counter()
    for batch in batches:
        for contender in {id(contender.nlp): contender for contender in contenders}.values():
            with compiling(contender.when):
                Newton().solve(contender.nlp, *batch, tolerance=case.tolerance)
        if time.perf_counter() - began > seconds:
            return


def _ranges(nlp: NLP, tolerance: float) -> np.ndarray:
    """Ranges (m,) of the objectives over feasible points near random candidates."""
    span = nlp.span[nlp.free]
    candidates = nlp.lower[nlp.free] + np.random.default_rng(1).random((RANGES, len(span))) * span
    found = Projection().solve(nlp, candidates, tolerance=tolerance)
    F = found.F[found.status == CONVERGED]
    ranges = np.ptp(F, axis=0) if len(F) else np.zeros(len(nlp.problem.goals))
    return np.where(ranges > 0, ranges, 1.0)


def _quality(result: InnerResult, exact: InnerResult | None, ranges: np.ndarray) -> dict[str, float]:
    good = result.status == CONVERGED
    values = {
        "converged": float(good.mean()),
        "moved": float(result.moved[good].mean()) if good.any() else np.nan,
        "iterations": float(result.iterations.mean()),
        "fallbacks": result.fallbacks / len(good),
    }
    if exact is not None and (both := good & (exact.status == CONVERGED)).any():
        off = np.abs((result.F - exact.F)[both] / ranges).max(axis=1)
        values |= {"off, median": float(np.median(off)), "off, largest": float(off.max())}
    return values


def compiling(when: str) -> AbstractContextManager[Any]:
    """A context in which Functions that are made are compiled at once ("always"), or never ("0")."""
    return patch.dict(os.environ, MACS_COMPILE=when)


def report(rows: Sequence[Row]) -> str:
    """The measured values, their meaning, and the targets."""
    used = compiler()
    compiled = f"Functions are compiled ({Path(used).name}) unless a row states otherwise." if used else "No function is compiled."
    lines = [
        "INNER LEVELS: candidates a second, as multiples of those of IPOPT's defaults with a constant objective, the paper's inner level.",
        f"Batches of {BATCH}, the same for all, in turn; median and quartiles over rounds, least and greatest of few; in all: the ratio",
        f"of the sums of all times. {compiled}",
        "moved: mean distance from the candidate, in spans. fallbacks: left to IPOPT. off: by how much objectives differ from the nearest",
        f"point's (projection by IPOPT at {EXACT_TOLERANCE:g}), in ranges of feasible points; large where another point is about as near.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


COLUMNS: tuple[Column, ...] = (
    ("times as", "fast", lambda row: row.spread("speed") if row.who != BASELINE else "1"),
    ("in", "all", lambda row: short(_overall(row)) if row.who != BASELINE else "1"),
    ("ms a", "candidate", lambda row: short(1e3 * row.of("seconds"))),
    ("con-", "verged", lambda row: f"{100 * row.of('converged', np.mean):.0f} %"),
    ("moved", "", lambda row: short(row.of("moved", np.mean))),
    ("itera-", "tions", lambda row: short(row.of("iterations", np.mean))),
    ("fall-", "backs", lambda row: f"{100 * row.of('fallbacks', np.mean):.0f} %" if row.who.startswith(DEFAULT) else ""),
    ("off,", "median", lambda row: short(row.of("off, median"))),
    ("off,", "largest", lambda row: short(row.of("off, largest", np.max))),
    ("", "rounds", lambda row: str(len(row.values["speed"]))),
)


def _overall(row: Row) -> float:
    """The ratio of the sums of all times: a batch that takes long, for one candidate of ten, weighs more in it than in the median."""
    seconds = np.array(row.values["seconds"])
    return float((np.array(row.values["speed"]) * seconds).sum() / seconds.sum())


def targets(rows: Sequence[Row]) -> list[Target]:
    """What is asked of the default inner level: times and distances by the median of the rounds, convergence over all candidates."""
    asked = {case.name: case.asked for case in INNER}
    found = {(row.case, row.who): row for row in rows}
    made = []
    for (case, who), row in found.items():
        if who != DEFAULT:
            continue
        limits, name = asked.get(case, {}), f"{case}, {DEFAULT}"
        if "speed" in limits:
            value, least = f"{row.spread('speed')}, in all {short(_overall(row))}", limits["speed"]
            made.append(Target(name, f"at least {least:g} times as fast", value, row.of("speed") >= least))
        if "moved" in limits:
            moved, nearest = (found[case, other].of("moved") for other in (DEFAULT, PROJECTION))
            value = f"{short(moved)} (nearest: {short(nearest)})"
            made.append(Target(name, f"moved by at most {limits['moved']:g}", value, moved <= limits["moved"]))
        ours, theirs = (found[case, other].of("converged", np.mean) for other in (DEFAULT, BASELINE))
        value = f"{100 * ours:.0f} % to {100 * theirs:.0f} %"
        made.append(Target(name, "converged at least as often", value, ours >= theirs))
    return made
