"""MACS against what a user would do instead: gradient sweeps from many starts, on the same mesh, in the same time."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import transcription
from macs import MACS, Front, sweep
from macs.archive import spread
from macs.monitor import Stopped
from problems import Problem, goddard, landing_site, load, orbit_rise
from transcription import Transcription
from transcription.stopping import stopped_by

from ..indicators import gd, hypervolume, igd
from .measured import Column, Row, short, table
from .steps import Steps

POINTS = 10
MOST_STARTS = 64
OURS, THEIRS = "MACS", "sweeps"


@dataclass(frozen=True)
class Search:
    """A case on its own mesh, the truth, the budgets of the whole and of the quick benchmark (0: not in it), and what ratio is asked."""

    name: str
    reference: Callable[[], np.ndarray]
    evaluations: int
    quick: int
    asked: str


CASES = (
    Search("goddard", goddard.reference, 10_000, 600, "at least 0.999"),
    Search("orbit_rise", orbit_rise.reference, 50_000, 1_000, "at least 0.999"),
    Search("orbit_rise_full", orbit_rise.reference, 50_000, 0, "clearly above 1"),
    Search("landing_site", landing_site.reference, 20_000, 2_000, "clearly above 1"),
)


def bench_search(rows: list[Row], seeds: Sequence[int], quick: bool, cases: Sequence[Search] = CASES) -> None:
    """Measure all cases, with each seed; `rows` get what is known as soon as it is, also if `Stopped` ends it."""
    cases = [case for case in cases if case.quick or not quick]
    with Steps("searches", 2 * len(seeds) * len(cases)) as steps:
        for case in cases:
            reference = case.reference()
            pair = Row(case.name, OURS), Row(case.name, THEIRS)
            for seed in seeds:
                _measure(case, seed, case.quick if quick else case.evaluations, reference, pair, steps)
                if seed == seeds[0]:
                    rows += pair


def _measure(case: Search, seed: int, evaluations: int, reference: np.ndarray, pair: tuple[Row, Row], steps: Steps) -> None:
    problem = load(case.name)
    method = transcription.parse(problem.default_transcription)
    steps.begin(f"{case.name}, {OURS}, seed {seed}")
    ours = MACS(agents=POINTS, archive=POINTS).solve(problem, method, evaluations=evaluations, seed=seed)
    if ours.stats["stopped"] == "interrupted":
        raise Stopped("interrupted")
    steps.begin(f"{case.name}, {THEIRS}, seed {seed}")
    theirs = _sweeps(problem, method, ours.stats["wall_time"], seed, steps)
    union = np.vstack([ours.F, theirs.F])
    volumes = [hypervolume(front.F, union) for front in (ours, theirs)]
    for row, front, ratio in zip(pair, (ours, theirs), (volumes[0] / volumes[1], 1.0), strict=True):
        stats = front.stats
        row.add(
            ratio=ratio,
            gd=gd(front, reference),
            igd=igd(front, reference),
            points=len(front),
            evaluations=stats["evaluations"],
            gradient_solves=stats["gradient_solves"],
            seconds=stats["wall_time"],
        )


def _sweeps(problem: Problem, method: Transcription, seconds: float, seed: int, steps: Steps) -> Front:
    """Sweeps with more and more starts, each from the best that is known, until they had as much time; as many points as the archive has.

    The first one gets to its end in any case: nobody would do without it.
    """
    with stopped_by(steps.asked):
        front = sweep(problem, method, points=POINTS, seed=seed)
    steps.check()
    starts, k = 1, 0
    while (left := seconds - front.stats["wall_time"]) > 0:
        # As many starts as there is time for, by what one cost; several at once learn from each other.
        cost, k = front.stats["wall_time"] / max(front.stats["gradient_solves"], 1) * POINTS, k + 1
        starts = int(np.clip(left / cost, 2, min(2 * starts + 2, MOST_STARTS)))
        known = front if len(front) else None
        end = time.perf_counter() + left
        with stopped_by(lambda end=end: time.perf_counter() > end or steps.asked()):  # type: ignore[misc]
            more = sweep(problem, method, points=POINTS, starts=starts, seed=1000 * seed + k, start=known)
        steps.check()
        front = Front.merge([front, more])
    return front[np.flatnonzero(spread(front.F, POINTS))] if len(front) > POINTS else front


def report(rows: Sequence[Row]) -> str:
    """What was measured, and what was asked."""
    ratios = {row.case: row.spread("ratio") for row in rows if row.who == OURS}
    asked = {case.name: case.asked for case in CASES}
    lines = [
        f"SEARCHES: MACS with its defaults against gradient sweeps from many starts, on the same mesh, {POINTS} points, in the same time.",
        "The sweeps begin with one start, then take more and more random ones, each from the best known; their points are thinned by the",
        "archive's rule. Hypervolume: as multiples of that of the sweeps, normalised by ideal and nadir of both, up to 1.1. GD, IGD:",
        "distances to the true front and from it, normalised by its range. Median and quartiles over seeds, least and greatest of few.",
        "",
        table(rows, COLUMNS),
        "",
        *(f"{case}: hypervolume asked {asked[case]}, measured {ratio}" for case, ratio in ratios.items() if case in asked),
    ]
    return "\n".join(lines)


COLUMNS: tuple[Column, ...] = (
    ("hypervolume", "ratio", lambda row: row.spread("ratio") if row.who == OURS else "1"),
    ("GD", "", lambda row: row.spread("gd")),
    ("IGD", "", lambda row: row.spread("igd")),
    ("evalua-", "tions", lambda row: f"{row.of('evaluations'):.0f}"),
    ("gradient", "solves", lambda row: f"{row.of('gradient_solves'):.0f}"),
    ("s", "", lambda row: short(row.of("seconds"))),
    ("", "seeds", lambda row: str(len(row.values["ratio"]))),
)
