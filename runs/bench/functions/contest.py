"""MACS against other algorithms on a set of plain functions, at equal evaluations, seed by seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...measures.indicators import hypervolume, igd
from ...measures.references import union
from ...measures.statistics import holm, pairwise
from ...study import Study
from ..measured import Row, Target, table, verdicts
from .cases import OURS, Function, the_set
from .judged import JUDGED_BY, LARGER, TARGETS, WORDS, against_the_best, columns_of
from .searches import SEED, Fronts, finished, place, search, studies

SEEDS = 10
QUICK = 1000
"""Evaluations of the quick benchmark, with one seed."""
UNJUDGED = "Not judged: what is asked is asked of all functions with all their evaluations, against all rivals."
ENOUGH = 5
"""Seeds from which on a test of ranks can say anything."""


@dataclass(frozen=True)
class Contest:
    """The benchmark of one set, by its name."""

    name: str

    def bench(
        self,
        rows: list[Row],
        seeds: int = SEEDS,
        evaluations: int | None = None,
        names: Sequence[str] = (),
        jobs: int = 1,
        keep: str | None = None,
        only: Sequence[str] | None = None,
    ) -> None:
        """Measure; `rows` are filled at the end, also if it is an interrupt.

        Fewer `evaluations` than the set's own, and only the functions of these names, if any; so many `jobs` at the same time; a folder to
        `keep` searches in, which are not made again; `only` these solvers, and not all of the set.
        """
        chosen = the_set(self.name)
        functions = {one.name: one for one in chosen.functions if not names or one.name in names}
        batches = studies(self.name, chosen.rivals, list(functions.values()), seeds, evaluations)
        with place(keep) as folder:
            try:
                for name, batch in batches.items():
                    search(batch, folder / name, jobs, only)
            except KeyboardInterrupt:
                rows += measured(batches, folder, functions, only)
                raise
            rows += measured(batches, folder, functions, only)

    def quick(self, rows: list[Row]) -> None:
        """One seed and few evaluations of some functions."""
        self.bench(rows, 1, QUICK, the_set(self.name).quick)

    def targets(self, rows: Sequence[Row]) -> list[Target]:
        """What is asked of this set; nothing if there were fewer evaluations than it is asked of."""
        return TARGETS[self.name](rows)

    def report(self, rows: Sequence[Row]) -> str:
        """The measured values, and the targets."""
        chosen = the_set(self.name)
        key = JUDGED_BY[self.name]
        p = p_values(rows, key)
        lines = [
            f"{chosen.title}: MACS with its defaults against algorithms of pymoo with theirs, at equal evaluations.",
            "Populations are as large as the archive of MACS; NSGA-III gives all its non-dominated points. Points: how many there are.",
            "IGD: mean distance of the true front from the points, in the objectives' units for UF (as in the competition), else in ranges",
            "of the front. Hypervolume: in these ranges, up to 1.1. Distance: of the points from the front, in closed form. Medians and",
            "quartiles over seeds; rank: of the median among all; to best rival: the median of MACS divided by the best rival's (IGD:",
            "below 1 is better, hypervolume: above 1); p: two-sided Mann-Whitney test against MACS, from five seeds on,",
            f"by {WORDS[key]}, corrected by Holm over the rivals of each function. NSGA-III, MOEA/D and RVEA have as many directions as",
            f"points: a simplex lattice where one has so many, else evenly spread ones. All seeds are spawned from {SEED}.",
            *([] if chosen.functions[0].front else ["Ranges are those of what is non-dominated among all that all found."]),
            "",
            table(rows, columns_of(rows, p)),
            "",
            *against_the_best(rows, key, p),
            *(verdicts(self.targets(rows)) or [UNJUDGED]),
        ]
        return "\n".join(lines)


def measured(batches: Mapping[str, Study], folder: Path, functions: Mapping[str, Function], only: Sequence[str] | None = None) -> list[Row]:
    """The rows of all functions from the searches that are finished, of all solvers or only some."""
    fronts: dict[str, Fronts] = {}
    for name, batch in batches.items():
        fronts |= finished(batch, folder / name, only) if (folder / name).exists() else {}
    return [row for one in functions for row in compared(functions[one], fronts.get(one, {}))]


def compared(function: Function, fronts: Fronts) -> list[Row]:
    """The rows of a function from its fronts; none if there are none."""
    if not any(fronts.values()):
        return []
    known = [front.F for found in fronts.values() for front in found if len(front)]
    truth = function.front() if function.front else np.asarray(union(known)) if known else None
    rows = []
    for who, found in fronts.items():
        row = Row(function.name, who)
        for front in found:
            own: dict[str, float] = {
                "evaluations": front.stats["evaluations"],
                "points": len(front),
                "seconds": front.stats["wall_time"],
                "volume": hypervolume(front.F, truth) if truth is not None and len(front) else 0.0,
            }
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


def p_values(rows: Sequence[Row], key: str) -> dict[tuple[str, str], float]:
    """p of each rival against ours on each function by an indicator, after Holm's correction."""
    found: dict[tuple[str, str], float] = {}
    for case in dict.fromkeys(row.case for row in rows):
        own = {row.who: row for row in rows if row.case == case}
        if len(own) < 2 or len(own[OURS].values[key]) < ENOUGH:
            continue
        pairs = pairwise({who: row.values[key] for who, row in own.items()}, larger=key in LARGER)
        mine = [pair for pair in pairs if OURS in (pair.first, pair.second)]
        for pair, p in zip(mine, holm([pair.p for pair in mine]), strict=True):
            found[case, pair.second if pair.first == OURS else pair.first] = float(p)
    return found
