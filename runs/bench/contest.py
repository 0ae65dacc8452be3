"""Benchmarks of searches on plain functions: MACS against other algorithms at equal evaluations, seed by seed.

The searches are those of studies: in a folder that is kept, the same command makes only those that are missing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import fill

import numpy as np

from macs.front import Front

from ..measures.indicators import hypervolume, igd, igd_plus
from ..measures.references import union
from ..measures.statistics import ALPHA, holm, pairwise, summarise
from ..study import Study
from . import functions as plain
from .contract import SECONDS, Bench, Column, Effort, Row, Target, column, rounds_of, short
from .functions import FUNCTIONS, OURS, PlainFunction, solvers

WORDS = {"igd": "IGD", "igd_plus": "IGD+", "volume": "hypervolume"}
LARGER = ("volume",)
"""Indicators of which larger values are better."""
DIGITS = {"volume": 5}
"""Of an indicator in tables, other than three: volumes of good fronts differ little."""
OUTCOMES = ("better on", "worse on", "no difference shown on")
UNJUDGED = "Not judged: what is asked is asked of all functions with all their evaluations, against all rivals."
ABOUT = (
    "MACS with its defaults against algorithms of pymoo with theirs, at equal evaluations. Populations are as large as the archive of "
    "MACS; NSGA-III gives all its non-dominated points. Points: how many there are. {indicators}Medians and quartiles over seeds; rank: "
    "of the median among all; to best rival: the median of MACS divided by the best rival's (hypervolume: above 1 is "
    "better{otherwise}); p: two-sided Mann-Whitney test against MACS, from five seeds on, by {by}, corrected by Holm over the rivals of "
    "each function. {directed} have as many directions as points: a simplex lattice where one has so many, else evenly spread ones. All "
    "seeds are spawned from {seeds[0]}{seeds[1]}."
)
DIRECTED = ("NSGA-III", "MOEA/D", "RVEA")

Fronts = dict[str, list[Front]]
"""By solver, one for each seed that all solvers have finished."""


@dataclass(frozen=True)
class Contest:
    """What is compared on a set of functions, and how it is judged."""

    name: str  # of the set
    heading: str
    rivals: tuple[str, ...]
    quick: tuple[str, ...]  # functions of the quick benchmark
    by: str  # the indicator that tests and targets are of
    share: float | None = None  # of the functions on which the best median of all is asked; None: nothing is, but of the first set
    seeds: tuple[int, str] = (2026, "")  # the one that all are spawned from, and what is to be said of these
    more: str = ""  # what else its page says first

    @property
    def solvers(self) -> tuple[str, ...]:
        """Names, ours first."""
        return (OURS, *self.rivals)

    def chosen(self, effort: Effort) -> dict[str, PlainFunction]:
        """Its functions, or those of an effort, with no more evaluations than that has."""
        least = [replace(one, evaluations=min(effort.evaluations or one.evaluations, one.evaluations)) for one in FUNCTIONS[self.name]()]
        return {one.name: one for one in least if not effort.cases or one.name in effort.cases}

    def studies(self, effort: Effort) -> dict[str, Study]:
        """Studies of all functions that have as many points, by the names of their folders."""
        groups: dict[int, list[PlainFunction]] = {}
        for one in self.chosen(effort).values():
            groups.setdefault(one.points, []).append(one)
        return {
            f"{self.name}-{points}": Study(
                f"{self.name}, {points} points",
                problems={one.name: one.stated() for one in group},
                solvers=solvers(self.rivals, points),
                evaluations={one.name: one.evaluations for one in group},
                runs=effort.rounds,
                seed=self.seeds[0],  # from which those of all searches are spawned
                verify=None,
            )
            for points, group in groups.items()
        }

    def complete(self, rows: Sequence[Row]) -> list[str]:
        """The functions, if all were measured with all solvers and all evaluations; else none, and nothing is judged."""
        budgets = {one.name: one.evaluations for one in FUNCTIONS[self.name]()}
        full = [row.case for row in rows if row.who == OURS and row.of("evaluations") >= budgets[row.case]]
        return full if {row.who for row in rows} >= set(self.solvers) and len(full) == len(budgets) else []

    def targets(self, rows: Sequence[Row]) -> list[Target]:
        """What is asked of the set."""
        cases = self.complete(rows)
        if self.name == "many":
            return asked_of_many(rows, cases)
        if not cases or self.share is None:
            return []
        good = as_good_as_the_best(rows, cases, self.by, 1.0)
        asked = f"best median {WORDS[self.by]} on at least {100 * self.share:g} %"
        return [Target(f"{len(cases)} functions", asked, f"{len(good)} of {len(cases)}", len(good) >= self.share * len(cases))]

    def measure(self, rows: list[Row], effort: Effort) -> None:
        """Make all searches; `rows` are filled at the end, also if it is an interrupt."""
        functions, batches = self.chosen(effort), self.studies(effort)
        with TemporaryDirectory(prefix="macs_") if effort.keep is None else nullcontext(effort.keep) as folder:
            interrupted, fronts = False, dict[str, Fronts]()
            try:
                for name, batch in batches.items():
                    search(batch, Path(folder) / name, effort)
            except KeyboardInterrupt:
                interrupted = True
            for name, batch in batches.items():
                if (Path(folder) / name).exists():
                    fronts |= finished_fronts(batch, Path(folder) / name, effort.solvers)
        rows += [row for name, one in functions.items() for row in compared(one, fronts.get(name, {}))]
        if interrupted:
            raise KeyboardInterrupt

    def about(self, rows: Sequence[Row]) -> str:
        """What is measured, by which of the indicators."""
        keys = {key for row in rows for key in row.values}
        known = bool(keys & {"igd", "igd_plus"})
        units = "the objectives' units, as in the competition" if self.name == "uf" else "ranges of the front"
        ranges = "ranges of the front" if known else "ranges of what is not dominated among all that all found"
        mean = f"mean distance of the true front from the points, in {units}"
        told = {
            "igd": f"IGD: {mean}. ",
            "igd_plus": f"IGD+: {'the same' if 'igd' in keys else mean}, where an objective counts only if a point is worse in it. ",
            "volume": f"Hypervolume: in {ranges}, up to 1.1. ",
            "distance": "Distance: of the points from the front, in closed form. ",
        }
        return f"{self.heading}: {self.more}" + ABOUT.format(
            indicators="".join(text for key, text in told.items() if key in keys),
            otherwise=", else below 1" if known else "",
            by=WORDS[self.by],
            directed=", ".join(who for who in DIRECTED if who in self.rivals),
            seeds=self.seeds,
        )

    def notes(self, rows: Sequence[Row]) -> list[str]:
        """How ours stands against the best rivals, and whether the set is judged."""
        keys = [self.by, *(key for key in ("igd_plus",) if any(key in row.values for row in rows))]
        found = [line for key in keys for line in against_the_best(rows, key, p_values(rows, key))]
        return found + ([] if self.complete(rows) else [UNJUDGED])

    @property
    def bench(self) -> Bench:
        """The benchmark of it, with ten seeds."""
        return Bench(
            title=self.name,
            about=self.about,
            full=Effort(rounds=10),
            quick=Effort(self.quick, evaluations=1000),
            whole=self.measure,
            columns=lambda rows: columns_of(rows, p_values(rows, self.by)),
            targets=self.targets,
            notes=self.notes,
            modules=(plain,),
            seeded=True,
            kept=True,
        )


def search(batch: Study, folder: Path, effort: Effort) -> None:
    """Make the searches that a study's folder lacks or has by other code, of all solvers or only some."""
    summary = batch.run(folder, jobs=effort.jobs, fresh=True, solvers=effort.solvers or None, progress=True)
    if summary.failed:
        raise RuntimeError(f"searches failed, so there is nothing to compare:\n{summary}")


def finished_fronts(batch: Study, folder: Path, only: Sequence[str] = ()) -> dict[str, Fronts]:
    """By function: the fronts of the seeds that all solvers have finished, or all of these."""
    runs = {
        (run.cell.problem, run.cell.solver, run.number): run
        for run in batch.status(folder).runs
        if run.finished and run.code == batch.code(run.cell)
    }
    who = batch.chosen(only or None)
    fronts: dict[str, Fronts] = {}
    for function in dict.fromkeys(cell.problem for cell in batch.cells):
        numbers = [n for n in range(1, batch.runs + 1) if all((function, one, n) in runs for one in who)]
        fronts[function] = {one: [runs[function, one, n].front for n in numbers] for one in who}
    return fronts


def compared(function: PlainFunction, fronts: Fronts) -> list[Row]:
    """The rows of a function from its fronts; none if there are none."""
    if not any(fronts.values()):
        return []
    known = [front.F for own in fronts.values() for front in own if len(front)]
    truth = function.front() if function.front else np.asarray(union(known)) if known else None
    rows = []
    for who, own in fronts.items():
        row = Row(function.name, who)
        for front in own:
            values: dict[str, float] = {
                "evaluations": front.stats["evaluations"],
                "points": len(front),
                "seconds": front.stats["wall_time"],
                "volume": hypervolume(front.F, truth) if truth is not None and len(front) else 0.0,
            }
            if function.front and truth is not None:
                raw = function.name.startswith("UF")
                measures = {"igd": igd, "igd_plus": igd_plus}
                values |= {key: measures[key](front.F, truth, normalise=not raw, curve=not raw) for key in function.distances}
            if function.distance and len(front):
                values["distance"] = float(function.distance(front.F).mean())
            # An infinite distance, of a front without points, counts: `Row.once` would leave it out.
            for key, value in values.items():
                row.values.setdefault(key, []).append(float(value))
        rows.append(row)
    return rows


# Medians, and what is asked


def medians(rows: Sequence[Row], case: str, key: str) -> dict[str, float]:
    """The median of an indicator by the name of the solver; infinite where runs found no point."""
    return {row.who: summarise(row.values[key]).median for row in rows if row.case == case and row.values.get(key)}


def best_rival(values: Mapping[str, float], key: str) -> tuple[str, float]:
    """The name and the median of the best of the others."""
    others = {who: value for who, value in values.items() if who != OURS}
    who = (max if key in LARGER else min)(others, key=lambda one: others[one])
    return who, others[who]


def as_good_as_the_best(rows: Sequence[Row], cases: Sequence[str], key: str, part: float) -> list[str]:
    """The functions on which the median of ours is at least so good a part of the best rival's; not those on which all found nothing."""
    good = []
    for case in cases:
        values = medians(rows, case, key)
        rival = best_rival(values, key)[1]
        if values[OURS] >= part * rival and values[OURS] > 0.0 if key in LARGER else values[OURS] <= rival / part and values[OURS] < np.inf:
            good.append(case)
    return good


def asked_of_many(rows: Sequence[Row], cases: Sequence[str]) -> list[Target]:
    """Nearer to the front and larger than NSGA-III on DTLZ2; the best or nearly so on most with five objectives."""
    made = []
    for case in [one for one in cases if one.startswith("DTLZ2,")]:
        for key, word in (("distance", "mean distance below NSGA-III's"), ("volume", "hypervolume above NSGA-III's")):
            values = medians(rows, case, key)
            ours, theirs = values[OURS], values["NSGA-III"]
            made.append(Target(case, word, f"{short(ours)} to {short(theirs)}", ours > theirs if key in LARGER else ours < theirs))
    five = [case for case in cases if case.endswith("5 objectives")]
    if five:
        good = as_good_as_the_best(rows, five, "volume", 0.98)
        asked = "best or within 2 % of the best rival's hypervolume on 4"
        made.append(Target("5 objectives", asked, f"{len(good)} of {len(five)}", len(good) >= 4))
    return made


def p_values(rows: Sequence[Row], key: str) -> dict[tuple[str, str], float]:
    """p of each rival against ours on each function by an indicator, after Holm's correction; none of fewer than five seeds, too few for a
    test of ranks."""
    p: dict[tuple[str, str], float] = {}
    for case in dict.fromkeys(row.case for row in rows):
        own = {row.who: row for row in rows if row.case == case}
        if len(own) < 2 or len(own[OURS].values[key]) < 5:
            continue
        pairs = pairwise({who: row.values[key] for who, row in own.items()}, larger=key in LARGER)
        mine = [pair for pair in pairs if OURS in (pair.first, pair.second)]
        for pair, value in zip(mine, holm([pair.p for pair in mine]), strict=True):
            p[case, pair.second if pair.first == OURS else pair.first] = float(value)
    return p


def against_the_best(rows: Sequence[Row], key: str, p: Mapping[tuple[str, str], float]) -> list[str]:
    """Lines on which functions ours differs from the best rival of each, how often from each rival, and where it is the last; none if
    nothing was tested."""
    if not p:
        return []
    found, each, last = {word: list[str]() for word in OUTCOMES}, dict[str, Counter[str]](), list[str]()
    for case in dict.fromkeys(case for case, _ in p):
        values = medians(rows, case, key)
        first, worst = best_rival(values, key)[0], (min if key in LARGER else max)(values.values())
        last += [case] if values[OURS] == worst != values[first] else []
        for who in values.keys() - {OURS}:
            ahead = (values[OURS] > values[who]) == (key in LARGER)
            word = OUTCOMES[2 if p[case, who] >= ALPHA else int(not ahead)]
            each.setdefault(who, Counter())[word] += 1
            if who == first:
                found[word].append(case if word != OUTCOMES[1] else f"{case} to {who}")
    best = ", ".join(f"{word} {len(cases)}{' (' + ', '.join(cases) + ')' if cases else ''}" for word, cases in found.items())
    pairs = "; ".join(f"{who} {', '.join(str(each[who][word]) for word in OUTCOMES)}" for who in dict.fromkeys(who for _, who in p))
    lines = [
        f"By {WORDS[key]}, against the best rival of each function (p < {ALPHA:g}): {best}.",
        f"Number of functions better, worse, without difference, against {pairs}.",
        f"Last by the median, alone or with others: {', '.join(last) or 'on none'}.",
    ]
    return [*(fill(line, 140, break_on_hyphens=False) for line in lines), ""]


# The table


def columns_of(rows: Sequence[Row], p: Mapping[tuple[str, str], float]) -> tuple[Column, ...]:
    """The columns of a table: those indicators that there are, and comparisons where there are several solvers."""
    columns: list[Column] = []
    several = len({row.who for row in rows}) > 1
    for key, title in (*WORDS.items(), ("distance", "distance")):
        if any(row.values.get(key) for row in rows):
            columns.append((title, "", lambda row, key=key: spread(row, key)))  # type: ignore[misc]
            if several:
                columns.append(("", "rank", lambda row, key=key: rank(rows, row, key)))  # type: ignore[misc]
            if several and key != "distance":
                columns.append(("to best", "rival", lambda row, key=key: ratio(rows, row, key)))  # type: ignore[misc]
    tested: Column = ("p", "Holm", lambda row: f"{p[row.case, row.who]:.2g}" if (row.case, row.who) in p else "")
    counts = (column("evalua-", "tions", "evaluations", form=".0f"), column("", "points", "points", form=".0f"))
    return (*columns, *([tested] if several else []), *counts, SECONDS, rounds_of("seconds", "seeds"))


def spread(row: Row, key: str) -> str:
    """Median and quartiles, in which runs without a point are infinite."""
    values = row.values.get(key)
    if not values:
        return "-"
    middle, digits = summarise(values, larger=key in LARGER), DIGITS.get(key, 3)
    median, lower, upper = (short(value, digits) for value in (middle.median, middle.lower, middle.upper))
    return f"{median} [{lower}, {upper}]" if len(values) > 1 else median


def rank(rows: Sequence[Row], row: Row, key: str) -> str:
    """The place of the median among all solvers, 1 for the best; none where half the runs found nothing."""
    values = medians(rows, row.case, key)
    if row.who not in values or values[row.who] == (0.0 if key in LARGER else np.inf):
        return "-"
    others, own = np.array(list(values.values())), values[row.who]
    return str(1 + int((others > own).sum() if key in LARGER else (others < own).sum()))


def ratio(rows: Sequence[Row], row: Row, key: str) -> str:
    """Of ours to the best rival's median; empty for others."""
    values = medians(rows, row.case, key)
    if row.who != OURS or row.who not in values or len(values) < 2:
        return ""
    rival = best_rival(values, key)[1]
    return short(values[OURS] / rival, DIGITS.get(key, 3)) if rival else "-"


PYMOO = ("NSGA-II", "NSGA-III", "MOEA/D", "AGE-MOEA-II")
CONSTRAINED = ("NSGA-II", "NSGA-III", "SMS-EMOA", "AGE-MOEA-II", "RVEA", "C-TAEA")
untuned = partial(
    Contest,
    by="volume",
    seeds=(58, ", not used before"),
)
UNTUNED = (
    "Nothing in this package was tuned on these functions, which were chosen before their first contest, and no target is set. {chosen} "
    "Without MOEA/D, which takes ten times as long as most others. "
)
MAF = "MaF1 to MaF6: MaF7 is DTLZ7, on which the search was tuned."
WFG = "WFG: one for each difficulty, bias, a front in pieces, many local optima, variables that are not separable, and deception."
CF = "CF: of two with the same front (4 and 5, 6 and 7, 9 and 10) the one with more local optima."
CRE = (
    "CRE: not the welded beam, which is in the catalogue of problems, nor the one with five objectives, for which SMS-EMOA takes ten "
    "times as long as all others together."
)
ALL_CONTESTS = (
    Contest("many", "MANY OBJECTIVES", (*PYMOO, "RVEA"), ("DTLZ2, 5 objectives",), "volume"),
    Contest("uf", "UF1 TO UF10 OF CEC 2009", PYMOO, ("UF1", "UF8"), "igd", 0.7),
    Contest("zdt", "ZDT", ("NSGA-II", "NSGA-III", "MOEA/D", "SMS-EMOA", "AGE-MOEA-II"), ("ZDT1", "ZDT3"), "igd", 0.6),
    Contest(
        "constrained",
        "CONSTRAINTS",
        CONSTRAINED,
        ("MW1", "C2DTLZ2"),
        "volume",
        0.6,
        (2029, ", none of which was used before MACS and what is asked were as they are"),
    ),
    untuned("maf", "MAF, 5 OBJECTIVES", ("NSGA-II", "NSGA-III", "AGE-MOEA-II", "RVEA"), ("MaF1",), more=UNTUNED.format(chosen=MAF)),
    untuned(
        "wfg", "WFG, 3 OBJECTIVES", ("NSGA-II", "NSGA-III", "SMS-EMOA", "AGE-MOEA-II", "RVEA"), ("WFG4",), more=UNTUNED.format(chosen=WFG)
    ),
    untuned("cf", "CF OF CEC 2009", CONSTRAINED, ("CF1",), more=UNTUNED.format(chosen=CF)),
    untuned("re", "REAL-WORLD PROBLEMS WITH CONSTRAINTS", CONSTRAINED, ("CRE31",), more=UNTUNED.format(chosen=CRE)),
)
CONTESTS = {one.name: one.bench for one in ALL_CONTESTS}


def solvers_of(name: str) -> tuple[str, ...]:
    """The names of the solvers of a set, ours first."""
    return next(one.solvers for one in ALL_CONTESTS if one.name == name)
