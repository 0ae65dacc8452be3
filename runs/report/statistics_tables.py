"""Tables of statistics: each indicator of each solver over its runs, and tests of their differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..measures.statistics import PairTest, overall, pairwise, summarise
from .tables import Cell, Column, Table, table

Samples = Mapping[str, Mapping[str, Sequence[float] | np.ndarray]]
"""Indicator -> solver -> one value for each run; NaN or infinite where a run failed."""

LARGER = frozenset({"hypervolume"})
"""Indicators of which larger values are better."""


def summary_table(samples: Samples, *, caption: str = "", notes: Sequence[str] = ()) -> Table:
    """A row for each indicator and solver: runs, failures, mean, variance, median, quartiles, best and worst."""
    rows: list[list[Cell]] = []
    for indicator, solvers in samples.items():
        for solver, values in solvers.items():
            s = summarise(values, larger=indicator in LARGER)
            rows.append([indicator, solver, s.count, s.failures, s.mean, s.variance, s.median, s.lower, s.upper, s.best, s.worst])
    failed = any(row[3] for row in rows)
    lines = ["Variance with divisor n - 1."]
    lines += ["Mean and variance are of the runs that did not fail; in all other columns failed runs are worse than any."] if failed else []
    heads = [Column(name, digits=4) for name in ("median", "lower quartile", "upper quartile", "best", "worst")]
    first: list[Column | str] = [Column("indicator", grouped=True), "solver", "runs", "failed", Column("mean", digits=4), "variance"]
    return table([*first, *heads], rows, caption, [*lines, *notes])


def pairs_table(samples: Samples, *, caption: str = "") -> Table:
    """A row for each indicator and pair of solvers: p, p after Holm's correction, effect, and which of the two is better if any."""
    rows: list[list[Cell]] = []
    notes: list[str] = []
    for indicator, solvers in samples.items():
        for c in pairwise(solvers, larger=indicator in LARGER):
            rows.append([indicator, c.first, c.second, c.p, c.p_holm, c.a12, c.effect, _better(c)])
            notes += [c.note] if c.note else []
    heads: list[Column | str] = [Column("indicator", grouped=True), Column("first", grouped=True), "second"]
    heads += ["p", "p (Holm)", "A12", "effect", "better"]
    how = (
        "Mann-Whitney U, two-sided; Holm's correction over the pairs of an indicator. "
        "A12: probability that a run of the first is better than one of the second, ties half."
    )
    return table(heads, rows, caption, [how, *dict.fromkeys(notes)])


def overall_table(samples: Samples, *, caption: str = "") -> Table:
    """A row for each indicator: whether any solver differs, and the average rank of each of them."""
    found = {indicator: overall(solvers, larger=indicator in LARGER) for indicator, solvers in samples.items()}
    names = list(dict.fromkeys(name for one in found.values() for name in one.ranks))
    rows = [[indicator, one.statistic, one.p, *(one.ranks.get(name) for name in names)] for indicator, one in found.items()]
    note = "Kruskal-Wallis, with average ranks among all runs; 1 is the best."
    return table(["indicator", "statistic", "p", *(f"rank of {name}" for name in names)], rows, caption, [note])


def _better(c: PairTest, alpha: float = 0.05) -> str:
    return "neither" if c.p_holm > alpha else c.first if c.a12 > 0.5 else c.second
