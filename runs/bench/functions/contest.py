"""MACS against other algorithms on a set of plain functions, at equal evaluations, with as many points, seed by seed."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

from macs.io.console import Steps
from macs.io.interrupts import Stopped

from ...measures.indicators import hypervolume, igd
from ...measures.references import union
from ...measures.statistics import holm, pairwise
from ..measured import Row, Target, table, verdicts
from .cases import OURS, Function, solvers, the_set
from .judged import TARGETS, columns_of

SEEDS = tuple(range(1, 11))
QUICK = 1000
"""Evaluations of the quick benchmark, with one seed."""
UNJUDGED = "Not judged: what is asked is asked of all functions with all their evaluations."
ENOUGH = 5
"""Seeds from which on a test of ranks can say anything."""


@dataclass(frozen=True)
class Contest:
    """The benchmark of one set, by its name."""

    name: str

    def bench(
        self, rows: list[Row], seeds: Sequence[int] = SEEDS, evaluations: int | None = None, names: Sequence[str] = (), jobs: int = 1
    ) -> None:
        """Measure; `rows` are filled as values become known, also if `Stopped` ends it. Fewer `evaluations` than the set's own, and only
        the functions of these names, if any; so many `jobs` at the same time."""
        chosen = the_set(self.name)
        functions = [one for one in chosen.functions if not names or one.name in names]
        contenders = (OURS, *chosen.rivals)
        runs = [Run(self.name, one.name, who, seed, evaluations) for one in functions for seed in seeds for who in contenders]
        with Steps(chosen.title.lower(), len(runs)) as steps, made(runs, jobs) as results:
            for function in functions:
                fronts: dict[str, list[Found]] = {who: [] for who in contenders}
                try:
                    for seed in seeds:
                        for who in contenders:
                            steps.begin(f"{function.name}, {who}, seed {seed}")
                            fronts[who].append(next(results))
                finally:
                    rows += compared(function, fronts)

    def quick(self, rows: list[Row]) -> None:
        """One seed and few evaluations of some functions."""
        self.bench(rows, (1,), QUICK, the_set(self.name).quick)

    def targets(self, rows: Sequence[Row]) -> list[Target]:
        """What is asked of this set; nothing if there were fewer evaluations than it is asked of."""
        return TARGETS[self.name](rows)

    def report(self, rows: Sequence[Row]) -> str:
        """The measured values, and the targets."""
        chosen = the_set(self.name)
        lines = [
            f"{chosen.title}: MACS with its defaults against algorithms of pymoo with theirs, at equal evaluations, with as many points.",
            "IGD: mean distance of the true front from the points, in the objectives' units for UF (as in the competition), else in ranges",
            "of the front. Hypervolume: in these ranges, up to 1.1. Distance: of the points from the front, in closed form. Medians and",
            "quartiles over seeds; rank: of the median among all; p: Mann-Whitney, corrected by Holm for all rivals, from five seeds on.",
            *([] if chosen.functions[0].front else ["Ranges are those of what is non-dominated among all that all found."]),
            "",
            table(rows, columns_of(rows, p_values(rows))),
            "",
            *(verdicts(self.targets(rows)) or [UNJUDGED]),
        ]
        return "\n".join(lines)


@dataclass(frozen=True)
class Run:
    """One search: of the set with this name, a function, a solver and a seed, with so many evaluations if they are fewer than its own."""

    set: str
    function: str
    who: str
    seed: int
    evaluations: int | None


@dataclass(frozen=True)
class Found:
    """What a search has found: objectives F (k, m), its evaluations and its seconds."""

    F: np.ndarray
    evaluations: int
    seconds: float

    def __len__(self) -> int:
        return len(self.F)


def searched(run: Run) -> Found:
    """The result of a run. Raises `Stopped` if Ctrl-C ended it."""
    chosen = the_set(run.set)
    function = next(one for one in chosen.functions if one.name == run.function)
    solver = solvers(chosen.rivals, function.points)[run.who]
    budget = min(run.evaluations or function.evaluations, function.evaluations)
    front = solver.minimize(*function.problem(), evaluations=budget, seed=run.seed, progress=False)
    if front.stats["stopped"] == "interrupted":
        raise Stopped("interrupted")
    return Found(front.F, front.stats["evaluations"], front.stats["wall_time"])


@contextmanager
def made(runs: Sequence[Run], jobs: int) -> Iterator[Iterator[Found]]:
    """The results of runs in their order: made when they are asked for, or by so many processes, which end with the context."""
    if jobs == 1:
        yield map(searched, runs)
        return
    with get_context("spawn").Pool(jobs, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        yield pool.imap(searched, runs)


def compared(function: Function, fronts: dict[str, list[Found]]) -> list[Row]:
    """The rows of a function from its fronts, one for each seed that all solvers have finished; none if there is no such seed."""
    count = min(len(found) for found in fronts.values())
    if not count:
        return []
    known = [front.F for found in fronts.values() for front in found[:count] if len(front)]
    truth = function.front() if function.front else np.asarray(union(known)) if known else None
    rows = []
    for who, found in fronts.items():
        row = Row(function.name, who)
        for front in found[:count]:
            own: dict[str, float] = {"evaluations": front.evaluations, "points": len(front), "seconds": front.seconds}
            own["volume"] = hypervolume(front.F, truth) if truth is not None and len(front) else 0.0
            if function.front and truth is not None:
                raw = function.name.startswith("UF")
                own["igd"] = igd(front.F, truth, normalise=not raw, curve=not raw)
            if function.distance and len(front):
                own["distance"] = float(function.distance(front.F).mean())
            # An infinite distance, of a front without points, counts: `Row.add` would leave it out.
            for key, value in own.items():
                row.values.setdefault(key, []).append(float(value))
        rows.append(row)
    return rows


def p_values(rows: Sequence[Row]) -> dict[tuple[str, str], float]:
    """p of each rival against ours on each function, by the indicator that is asked for, after Holm's correction."""
    found: dict[tuple[str, str], float] = {}
    for case in dict.fromkeys(row.case for row in rows):
        own = {row.who: row for row in rows if row.case == case}
        key = "igd" if case.startswith(("UF", "ZDT")) else "volume"
        if len(own[OURS].values[key]) < ENOUGH:
            continue
        pairs = pairwise({who: row.values[key] for who, row in own.items()}, larger=key == "volume")
        mine = [pair for pair in pairs if OURS in (pair.first, pair.second)]
        for pair, p in zip(mine, holm([pair.p for pair in mine]), strict=True):
            found[case, pair.second if pair.first == OURS else pair.first] = float(p)
    return found
