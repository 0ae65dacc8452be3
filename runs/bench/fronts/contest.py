"""MACS until it is done, its other inner levels with as many evaluations as they need for the same front, and sweeps, one after another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from macs import MACS, Front, sweep
from macs.io.console import Steps
from macs.io.interrupts import Stopped
from macs.pareto.dominance import nondominated
from macs.pareto.spread import spread
from problems import Problem
from transcription import Transcription, parse
from transcription.stopping import stopped_by

from ...measures.indicators import hypervolume
from ..measured import Column, Row, Target, short, table, verdicts
from .cases import CASES, Case

POINTS = 10
OURS, PROPAGATE, PROJECTION = "until done", "propagate", "projection"
SWEEP, SWEEPS = "sweep", "sweep, ten starts"
SAME, END = 0.99, 1e-3
"""A front is as good as another one with this part of its hypervolume, up to 1.1 of the ranges of both, and ends that are worse by no more
than this part of the ranges."""

ASKED = 1.3
"""Times the time of the better other inner level, at most."""


@dataclass(frozen=True)
class Effort:
    """Cases, seeds, and the evaluations that another inner level is given, one number after the other until its front is as good."""

    cases: tuple[Case, ...] = CASES
    seeds: tuple[int, ...] = (1, 2, 3)
    evaluations: tuple[int, ...] = (250, 500, 1000, 2000, 4000)


QUICK = Effort((CASES[0], CASES[4]), (1,), (250, 500))


def bench_fronts(rows: list[Row], effort: Effort) -> None:
    """Measure all cases, with each seed; `rows` are filled as values become known, also if `Stopped` ends it."""
    names = (OURS, PROPAGATE, PROJECTION, SWEEP, SWEEPS)
    with Steps("fronts", len(effort.cases) * len(effort.seeds) * len(names)) as steps:
        for case in effort.cases:
            of_case = {who: Row(case.name, who) for who in names}
            for seed in effort.seeds:
                _measure(case, seed, effort.evaluations, of_case, steps)
                if seed == effort.seeds[0]:
                    rows += of_case.values()


def _measure(case: Case, seed: int, budgets: Sequence[int], rows: dict[str, Row], steps: Steps) -> None:
    problem, method = case.build(), parse(case.transcription)

    def begin(who: str) -> None:
        steps.begin(f"{case.name}, {who}, seed {seed}")

    begin(OURS)
    fronts = {OURS: _search(problem, method, seed, "auto", None)}
    for inner in (PROPAGATE, PROJECTION):
        begin(inner)
        for budget in budgets:
            fronts[inner] = _search(problem, method, seed, inner, budget)
            if as_good(fronts[inner].F, fronts[OURS].F):
                break
    for who, starts in ((SWEEP, 1), (SWEEPS, 10)):
        begin(who)
        with stopped_by(steps.asked):
            fronts[who] = sweep(problem, method, points=POINTS, starts=starts, seed=seed, verify=None)
        steps.check()
    union = np.vstack([front.F for front in fronts.values()])
    best = union[nondominated(union)]
    most = hypervolume(best[np.flatnonzero(spread(best, POINTS))] if len(best) > POINTS else best, best)
    ours = fronts[OURS].stats["wall_time"]
    for who, front in fronts.items():
        costs = {key: front.stats[key] for key in ("evaluations", "work", "gradient_solves")}
        good = float(as_good(front.F, fronts[OURS].F))
        seconds = front.stats["wall_time"]
        rows[who].add(
            volume=hypervolume(front.F, best) / most, good=good, seconds=seconds, ratio=seconds / ours, points=len(front), **costs
        )


def _search(problem: Problem, method: Transcription, seed: int, inner: str, evaluations: int | None) -> Front:
    solver = MACS(archive=POINTS, mesh="fixed")
    front = solver.solve(problem, method, evaluations=evaluations, seed=seed, inner=inner, verify=None)
    if front.stats["stopped"] == "interrupted":
        raise Stopped("interrupted")
    return front


def as_good(F: np.ndarray, other: np.ndarray) -> bool:
    """Whether a front (k, m), all minimised, is as good as another one (l, m): see `SAME` and `END`."""
    if not len(F):
        return False
    both = np.vstack([F, other])
    span = np.ptp(both[nondominated(both)], axis=0)
    ends = (F.min(axis=0) <= other.min(axis=0) + END * span).all()
    return bool(ends) and hypervolume(F, both) >= SAME * hypervolume(other, both)


def report(rows: Sequence[Row]) -> str:
    """The measured values, and what they say of the targets."""
    lines = [
        f"FRONTS: MACS with defaults until it is done, {POINTS} points, on a given mesh, not simulated. 'propagate' and 'projection': the",
        "same search with these inner levels, and the fewest evaluations of a few numbers with which its front is as good as ours: 0.99 of",
        "the hypervolume, ends within 0.001 of the ranges; the time is that of this search alone. Where none is as good, the time is that",
        "of the most evaluations. 'sweep': from the problem's guess, one start or ten a point. Volume: in that of ten points of the best",
        "of all of one seed. Median and quartiles over seeds, least and greatest of few.",
        "",
        table(rows, COLUMNS),
        "",
        *_beside_sweeps(rows),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """The search that chooses its inner level takes little more time than the better one of them, where one is as good."""
    made = []
    for case, found in _by_case(rows).items():
        others = [found[who].of("ratio") for who in (PROPAGATE, PROJECTION) if found[who].of("good") == 1.0]
        value = f"{short(1 / min(others))} times" if others else "none is as good"
        asked = f"at most {ASKED:g} times as long as the better other inner level"
        made.append(Target(case, asked, value, not others or 1 / min(others) <= ASKED))
    return made


def _beside_sweeps(rows: Sequence[Row]) -> list[str]:
    """What a sweep from one start takes, where its front is as good."""
    return [
        f"{case}: {short(1 / one.of('ratio'))} times as long as a sweep from one start"
        if (one := found[SWEEP]).of("good") == 1.0
        else f"{case}: a sweep from one start is not as good"
        for case, found in _by_case(rows).items()
    ]


def _by_case(rows: Sequence[Row]) -> dict[str, dict[str, Row]]:
    found: dict[str, dict[str, Row]] = {}
    for row in rows:
        found.setdefault(row.case, {})[row.who] = row
    return found


COLUMNS: tuple[Column, ...] = (
    ("time in", "ours", lambda row: "1" if row.who == OURS else row.spread("ratio")),
    ("as good", "as ours", lambda row: f"{100 * row.of('good', np.mean):.0f} %"),
    ("volume", "", lambda row: row.spread("volume")),
    ("evalua-", "tions", lambda row: f"{row.of('evaluations'):.0f}"),
    ("gradient", "solves", lambda row: f"{row.of('gradient_solves'):.0f}"),
    ("s", "", lambda row: short(row.of("seconds"))),
)
