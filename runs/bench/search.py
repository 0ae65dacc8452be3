"""Benchmark of searches: MACS against gradient sweeps from many starts, on the same mesh, in the same time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from macs import MACS, Front, sweep
from macs.io.console import Steps
from macs.io.interrupts import Stopped
from macs.pareto.energy import spread
from macs.refinement.search_mesh import default_transcription
from problems import Problem, load
from problems.cases import goddard, landing_site, orbit_rise
from transcription import Transcription
from transcription.stopping import stopped_by

from ..measures.indicators import gd, hypervolume, igd
from .measured import Column, Row, Target, short, table, verdicts

POINTS = 10
STARTS = 4
"""From how many vectors a sweep solves each point, once a single one has been tried."""
OURS, THEIRS = "MACS", "sweeps"
AS_GOOD, BETTER = 0.999, 1.01
"""Ratios of hypervolumes."""


@dataclass(frozen=True)
class Search:
    """A case on its own mesh, the truth, the budgets of the whole and of the quick benchmark (0: not in it), and the least ratio of
    hypervolumes that is asked of the whole one."""

    name: str
    reference: Callable[[], np.ndarray]
    evaluations: int
    quick: int
    least: float


CASES = (
    Search("goddard", goddard.reference, 10_000, 600, AS_GOOD),
    Search("orbit_rise", orbit_rise.reference, 50_000, 1_000, AS_GOOD),
    Search("orbit_rise_full", orbit_rise.reference, 50_000, 0, BETTER),
    Search("landing_site", landing_site.reference, 20_000, 2_000, BETTER),
)


def bench_search(rows: list[Row], seeds: Sequence[int], quick: bool, cases: Sequence[Search] = CASES) -> None:
    """Measure all cases, with each seed; `rows` are filled as values become known, also if `Stopped` ends it."""
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
    method = default_transcription(problem)
    steps.begin(f"{case.name}, {OURS}, seed {seed}")
    ours = MACS(agents=POINTS, archive=POINTS).solve(problem, method, evaluations=evaluations, seed=seed)
    if ours.stats["stopped"] == "interrupted":
        raise Stopped("interrupted")
    steps.begin(f"{case.name}, {THEIRS}, seed {seed}")
    theirs = _sweeps(problem, method, ours.stats["wall_time"], seed, steps)
    union = np.vstack([ours.F, theirs.F])
    volumes = [hypervolume(front.F, union) for front in (ours, theirs)]
    for row, front, ratio in zip(pair, (ours, theirs), (volumes[0] / volumes[1], 1.0), strict=True):
        row.add(ratio=ratio, gd=gd(front, reference), igd=igd(front, reference), points=len(front))
        row.add(**{key: front.stats[key] for key in ("evaluations", "gradient_solves")}, seconds=front.stats["wall_time"])


def _sweeps(problem: Problem, method: Transcription, seconds: float, seed: int, steps: Steps) -> Front:
    """Sweeps until they had as much time: the plain one, then with random starts, from nothing and from the best known in turn.

    Each gets to its end, since one that is cut short is worth little: they have a little more time, not less.
    """
    front, k = None, 0
    while front is None or front.stats["wall_time"] < seconds:
        known = front if k % 2 == 0 and front is not None and len(front) else None
        with stopped_by(steps.asked):
            more = sweep(problem, method, points=POINTS, starts=STARTS if k else 1, seed=1000 * seed + k, start=known)
        steps.check()
        front, k = more if front is None else Front.merge([front, more]), k + 1
    return front[np.flatnonzero(spread(front.F, POINTS))] if len(front) > POINTS else front


def report(rows: Sequence[Row]) -> str:
    """The measured values, and the targets."""
    lines = [
        f"SEARCHES: MACS with its defaults against gradient sweeps from many starts, on the same mesh, {POINTS} points, in the same time.",
        f"The first sweep has one start, others {STARTS}, from nothing and from the best known in turn; their points are thinned by the",
        "archive's rule. Hypervolume: as multiples of that of the sweeps, normalised by ideal and nadir of both, up to 1.1. GD, IGD:",
        "distances to the true front and from it, normalised by its range. Median and quartiles over seeds, least and greatest of few.",
        "",
        table(rows, COLUMNS),
        "",
        *verdicts(targets(rows)),
    ]
    return "\n".join(lines)


def targets(rows: Sequence[Row]) -> list[Target]:
    """The ratio of hypervolumes of each case, by the median of the seeds; none of a case that had fewer evaluations."""
    found, asked = {row.case: row for row in rows if row.who == OURS}, "hypervolume at least {:g} times that of the sweeps"
    return [
        Target(case.name, asked.format(case.least), row.spread("ratio"), row.of("ratio") >= case.least)
        for case in CASES
        if (row := found.get(case.name)) and row.of("evaluations") >= case.evaluations
    ]


COLUMNS: tuple[Column, ...] = (
    ("hypervolume", "ratio", lambda row: row.spread("ratio") if row.who == OURS else "1"),
    ("GD", "", lambda row: row.spread("gd")),
    ("IGD", "", lambda row: row.spread("igd")),
    ("evalua-", "tions", lambda row: f"{row.of('evaluations'):.0f}"),
    ("gradient", "solves", lambda row: f"{row.of('gradient_solves'):.0f}"),
    ("s", "", lambda row: short(row.of("seconds"))),
    ("", "seeds", lambda row: str(len(row.values["ratio"]))),
)
