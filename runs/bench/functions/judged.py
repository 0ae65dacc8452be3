"""What is asked of MACS on each set of functions, by medians of the seeds, and the columns of the table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...measures.statistics import summarise
from ..measured import Column, Row, Target, short
from .cases import OURS, solvers_of, the_set

WITHIN = 0.98
"""As good as the best rival in hypervolume: at least this part of it."""
WORDS = {"igd": "IGD", "volume": "hypervolume"}
JUDGED_BY = {"many": "volume", "uf": "igd", "zdt": "igd", "constrained": "volume"}
"""The indicator of each set that tests are of."""
SIGNIFICANT = 0.05
LARGER = ("volume",)
"""Indicators of which larger values are better."""


def medians(rows: Sequence[Row], case: str, key: str) -> dict[str, float]:
    """The median of an indicator by the name of the solver; infinite where runs found no point."""
    return {row.who: summarise(row.values[key]).median for row in rows if row.case == case and row.values.get(key)}


def best_rival(found: Mapping[str, float], key: str) -> tuple[str, float]:
    """The name and the median of the best of the others."""
    others = {who: value for who, value in found.items() if who != OURS}
    who = (max if key in LARGER else min)(others, key=lambda one: others[one])
    return who, others[who]


def _complete(rows: Sequence[Row], name: str) -> list[str]:
    """The functions of a set that had all their evaluations, if all were measured with all solvers; else none, and nothing is judged."""
    if not {row.who for row in rows} >= set(solvers_of(name)):
        return []
    budgets = {one.name: one.evaluations for one in the_set(name).functions}
    full = [row.case for row in rows if row.who == OURS and row.of("evaluations") >= budgets[row.case]]
    return full if len(full) == len(budgets) else []


def _nowhere_behind(rows: Sequence[Row], cases: Sequence[str], key: str, part: float) -> list[str]:
    """The functions on which the median of ours is at least so good a part of the best rival's; not those on which all found nothing."""
    good = []
    for case in cases:
        found = medians(rows, case, key)
        rival = best_rival(found, key)[1]
        if found[OURS] >= part * rival and found[OURS] > 0.0 if key in LARGER else found[OURS] <= rival / part and found[OURS] < np.inf:
            good.append(case)
    return good


def many(rows: Sequence[Row]) -> list[Target]:
    """Nearer to the front and larger than NSGA-III on DTLZ2; the best or nearly so on most with five objectives."""
    cases, made = _complete(rows, "many"), []
    for case in [one for one in cases if one.startswith("DTLZ2,")]:
        for key, word in (("distance", "mean distance below NSGA-III's"), ("volume", "hypervolume above NSGA-III's")):
            found = medians(rows, case, key)
            ours, theirs = found[OURS], found["NSGA-III"]
            made.append(Target(case, word, f"{short(ours)} to {short(theirs)}", ours > theirs if key in LARGER else ours < theirs))
    five = [case for case in cases if case.endswith("5 objectives")]
    if five:
        good = _nowhere_behind(rows, five, "volume", WITHIN)
        measured = f"{len(good)} of {len(five)}"
        made.append(Target("5 objectives", "best or within 2 % of the best rival's hypervolume on 4", measured, len(good) >= 4))
    return made


def best_on(rows: Sequence[Row], name: str, share: float) -> list[Target]:
    """The best median of all on at least a share of the functions."""
    key = JUDGED_BY[name]
    cases = _complete(rows, name)
    if not cases:
        return []
    good = _nowhere_behind(rows, cases, key, 1.0)
    asked = f"best median {WORDS[key]} on at least {100 * share:g} %"
    return [Target(f"{len(cases)} functions", asked, f"{len(good)} of {len(cases)}", len(good) >= share * len(cases))]


def against_the_best(rows: Sequence[Row], key: str, p: Mapping[tuple[str, str], float]) -> list[str]:
    """A line on how many functions ours differs from the best rival of each, and an empty one; none if nothing was tested."""
    better, worse, tested = 0, 0, 0
    for case in dict.fromkeys(row.case for row in rows):
        found = medians(rows, case, key)
        who, rival = best_rival(found, key) if len(found) > 1 else ("", 0.0)
        if (case, who) in p:
            tested += 1
            if p[case, who] < SIGNIFICANT:
                ahead = (found[OURS] > rival) == (key in LARGER)
                better, worse = better + ahead, worse + (not ahead)
    if not tested:
        return []
    counts = f"better on {better}, worse on {worse}, no difference shown on {tested - better - worse}"
    return [f"Against the best rival of each function (p < {SIGNIFICANT:g}): {counts}.", ""]


TARGETS: dict[str, Callable[[Sequence[Row]], list[Target]]] = {
    "many": many,
    "uf": lambda rows: best_on(rows, "uf", 0.7),
    "zdt": lambda rows: best_on(rows, "zdt", 0.6),
    "constrained": lambda rows: best_on(rows, "constrained", 0.6),
}


def columns_of(rows: Sequence[Row], p: Mapping[tuple[str, str], float]) -> tuple[Column, ...]:
    """The columns of a table: those indicators that there are, and comparisons where there are several solvers."""
    columns: list[Column] = []
    several = len({row.who for row in rows}) > 1
    for key, title in (("igd", "IGD"), ("volume", "hypervolume"), ("distance", "distance")):
        if any(row.values.get(key) for row in rows):
            columns.append((title, "", lambda row, key=key: spread(row, key)))  # type: ignore[misc]
            if several:
                columns.append(("", "rank", lambda row, key=key: rank(rows, row, key)))  # type: ignore[misc]
            if several and key != "distance":
                columns.append(("to best", "rival", lambda row, key=key: ratio(rows, row, key)))  # type: ignore[misc]
    return (
        *columns,
        *([("p", "Holm", lambda row: f"{p[row.case, row.who]:.2g}" if (row.case, row.who) in p else "")] if several else []),
        ("evalua-", "tions", lambda row: f"{row.of('evaluations'):.0f}"),
        ("", "points", lambda row: f"{row.of('points'):.0f}"),
        ("s", "", lambda row: short(row.of("seconds"))),
        ("", "seeds", lambda row: str(len(row.values["seconds"]))),
    )


def spread(row: Row, key: str) -> str:
    """Median and quartiles, in which runs without a point are infinite."""
    values = row.values.get(key)
    if not values:
        return "-"
    found = summarise(values, larger=key in LARGER)
    return f"{short(found.median)} [{short(found.lower)}, {short(found.upper)}]" if len(values) > 1 else short(found.median)


def rank(rows: Sequence[Row], row: Row, key: str) -> str:
    """The place of the median among all solvers, 1 for the best; none where half the runs found nothing."""
    found = medians(rows, row.case, key)
    if row.who not in found or found[row.who] == (0.0 if key in LARGER else np.inf):
        return "-"
    values, own = np.array(list(found.values())), found[row.who]
    return str(1 + int((values > own).sum() if key in LARGER else (values < own).sum()))


def ratio(rows: Sequence[Row], row: Row, key: str) -> str:
    """Of ours to the best rival's median; empty for others."""
    found = medians(rows, row.case, key)
    if row.who != OURS or row.who not in found or len(found) < 2:
        return ""
    rival = best_rival(found, key)[1]
    return short(found[OURS] / rival) if rival else "-"
