"""Tables of one comparison: points claimed and verified, indicators with their statistics, and costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..measures.indicators import Scale
from ..measures.statistics import ALPHA, PairTest, overall, pairwise, summarise
from .choices import only_single_points
from .comparison import CHARGED, Charge, Comparison, samples, spent
from .tables import Cell, Head, Table, table


def claims_tables(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Table]:
    """A row for each solver: the points it claims to be feasible, and those that are when simulated. Empty if a study does not verify."""
    tolerance = study.get("verify")
    if tolerance is None:
        return {}
    rows: list[list[Cell]] = []
    for solver, found in comparison.counting.items():
        if not found:
            continue
        claimed, verified, feasible = (sum(getattr(one, name) for one in found) for name in ("claimed", "verified", "feasible"))
        counts = summarise([len(one.front) for one in found], larger=True)
        share = 100.0 * feasible / claimed if claimed else None
        fronts = [run.front for run in comparison.runs[solver]]
        misses = [_median([getattr(front, name) for front in fronts]) for name in ("defect", "simulated_violation")]
        rows.append([solver, len(found), claimed, verified, feasible, share, *misses, counts.mean, counts.median])
    heads: list[Head | str] = ["solver", "runs", "points claimed", "verified", "feasible when simulated", "%"]
    heads += [Head("median defect of a claim", digits=2), Head("median violation, simulated", digits=2)]
    heads += ["of the feasible not dominated, mean of a run", "median"]
    dynamic = any(run.front.dynamic for runs in comparison.runs.values() for run in runs)
    how = (
        f"All points were simulated by DOP853. A point is verified if nothing differs by more than {tolerance:g}: its states, in spans of "
        "their bounds; its bounds, final values, paths and constraints, in their scales; its objectives, in ranges of its front. It is "
        "feasible when simulated if that holds of all but its objectives. "
        if dynamic
        else f"All points were evaluated again. A point is verified if nothing differs by more than {tolerance:g}: its constraints, in "
        "their scales; its objectives, in ranges of its front. It is feasible if that holds of all but its objectives. "
    )
    note = how + (
        "Indicators and published statistics are of the feasible points alone, with the objectives found there, without those that "
        "others of their run dominate. Figures over evaluations, iterations or time are of the points as claimed."
    )
    return {"claims": table(heads, rows, f"{comparison.name}: points claimed, and points verified.", [note])}


def _median(columns: Sequence[np.ndarray]) -> float | None:
    """The median of all numbers in some columns; None if there are none."""
    values = np.concatenate([np.empty(0), *columns])
    values = values[~np.isnan(values)]
    return float(np.median(values)) if len(values) else None


def indicator_tables(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Table]:
    """Indicators against the study's reference with the statistics of their differences, and against the union of all runs."""
    found: dict[str, Table] = {}
    reference = comparison.against
    for name, against in {"indicators": reference, "indicators-union": comparison.union()}.items():
        if not len(against.front) or (name != "indicators" and (against.alone or not reference.true)):
            continue
        measured = samples(comparison, against)
        scale = Scale.of(against.front, what=against.what).describe()
        title = f"{comparison.name}: against {against.what}"
        found[name] = summary_table(measured, caption=f"{title}.", notes=[scale])
        # From one run of a solver nothing follows.
        several = {key: {solver: values for solver, values in own.items() if len(values) > 1} for key, own in measured.items()}
        if against is reference and len(several["GD"]) > 1:
            found["comparisons"] = pairs_table(several, caption=f"{title}: solvers in pairs.")
            if len(several["GD"]) > 2:
                found["overall"] = overall_table(several, caption=f"{title}: all solvers.")
    return found


def cost_tables(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Table]:
    """A row for each cost and solver: evaluations, inner iterations, gradient solves, work, charged evaluations and times of a run."""
    charge = Charge.of(comparison)
    rows: list[list[Cell]] = [
        [cost, solver, summary.count, summary.mean, summary.median, summary.best, summary.worst]
        for cost, solvers in spent(comparison, charge).items()
        for solver, values in solvers.items()
        for summary in [summarise(values)]
    ]
    heads: list[Head | str] = [Head("cost", grouped=True), "solver", "runs"]
    heads += [Head(name, digits=4) for name in ("mean", "median", "least", "most")]
    notes = ["Work: iterations of IPOPT times variables, or what takes about as long; the same on all machines."]
    if charge is not None:
        notes.append(
            f"{CHARGED.capitalize()}: all work of a run, gradient solves included, divided by what an evaluation of {charge.solver} takes, "
            "which takes least of the solvers without gradient solves. Each kind of work has a price from counts and sizes, in time of a "
            "processor, which `macs bench charges` measures."
        )
    return {"spent": table(heads, rows, f"{comparison.name}: costs of a run.", notes)}


def runs_table(found: Sequence[Comparison]) -> Table:
    """A row for each finished run of some comparisons, by the first that it is in: costs, number of points that count, indicators."""
    rows: dict[Any, list[Cell]] = {}
    for comparison in found:
        known = comparison.against
        measured = samples(comparison, known) if len(known.front) and not known.alone and not only_single_points(comparison) else {}
        for solver, runs in comparison.runs.items():
            for i, run in enumerate(runs):
                stats, cpu, points = run.front.stats, run.history.get("cpu") or [None], len(comparison.fronts[solver][i])
                costs = [stats["evaluations"], stats["gradient_solves"], cpu[-1], run.wall_time]
                # A run without a point that counts is as far away as can be, by GD, too.
                values = [np.fmin(measured[name][solver][i], np.inf) if measured else None for name in ("GD", "IGD", "hypervolume")]
                rows.setdefault(run.path, [comparison.shown, run.cell.transcription, solver, run.number, *costs, points, *values])
    heads: list[Head | str] = [*(Head(name, grouped=True) for name in ("problem", "transcription")), "solver", "run"]
    heads += ["evaluations", "gradient solves", Head("processor", "s"), Head("time", "s"), "points", "GD", "IGD", "hypervolume"]
    return table(heads, list(rows.values()))


def medians_table(runs: Table) -> Table:
    """The medians of the runs of each solver, from a table of all."""
    rows: list[list[Cell]] = []
    for key in dict.fromkeys(row[:3] for row in runs.rows):
        columns = np.array([row[4:] for row in runs.rows if row[:3] == key], dtype=float).T
        rows.append([*key, columns.shape[1], *(_median([column]) for column in columns)])
    note = "Points that count. GD and IGD: less is better, hypervolume: more, by the reference that is named below."
    return table([*runs.columns[:3], "runs", *runs.columns[4:]], rows, "Medians of a run.", [note])


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
    heads = [Head(name, digits=4) for name in ("median", "lower quartile", "upper quartile", "best", "worst")]
    first: list[Head | str] = [Head("indicator", grouped=True), "solver", "runs", "failed", Head("mean", digits=4), "variance"]
    return table([*first, *heads], rows, caption, [*lines, *notes])


def pairs_table(samples: Samples, *, caption: str = "") -> Table:
    """A row for each indicator and pair of solvers: p, p after Holm's correction, effect, and which of the two is better if any."""
    rows: list[list[Cell]] = []
    notes: list[str] = []
    for indicator, solvers in samples.items():
        for c in pairwise(solvers, larger=indicator in LARGER):
            rows.append([indicator, c.first, c.second, c.p, c.p_holm, c.a12, c.effect, _better(c)])
            notes += [c.note] if c.note else []
    heads: list[Head | str] = [Head("indicator", grouped=True), Head("first", grouped=True), "second"]
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


def _better(c: PairTest) -> str:
    return "neither" if c.p_holm > ALPHA else c.first if c.a12 > 0.5 else c.second
