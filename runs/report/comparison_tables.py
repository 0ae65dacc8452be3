"""Tables of one comparison: points claimed and verified, indicators with their statistics, and costs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..measures.scale import Scale
from ..measures.statistics import summarise
from .comparison import Comparison
from .run_measures import samples, spent
from .statistics_tables import overall_table, pairs_table, summary_table
from .tables import Cell, Column, Table, table


def claims_tables(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Table]:
    """A row for each solver: the points it claims to be feasible, and those feasible when simulated. Empty if a study does not verify."""
    tolerance = study.get("verify")
    if tolerance is None:
        return {}
    rows: list[list[Cell]] = []
    for solver, found in comparison.verified.items():
        if not found:
            continue
        claimed, feasible = sum(one.claimed for one in found), sum(one.feasible for one in found)
        counts = summarise([len(one.front) for one in found], larger=True)
        share = 100.0 * feasible / claimed if claimed else None
        rows.append([solver, len(found), claimed, feasible, share, counts.mean, counts.median])
    heads = ["solver", "runs", "points claimed", "feasible as simulated", "%", "of these not dominated, mean of a run", "median"]
    note = (
        "All points were simulated by DOP853. A point is feasible as simulated if it violates no state bound, final condition, path or "
        f"other constraint by more than {tolerance:g} of its scale. Indicators and published statistics are of these points alone, with "
        "their objectives as simulated, without those that others of their run dominate. Figures over evaluations, iterations or time are "
        "of the points as claimed."
    )
    return {"claims": table(heads, rows, f"{comparison.name}: points claimed, and points feasible as simulated.", [note])}


def indicator_tables(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Table]:
    """Indicators against the study's reference with the statistics of their differences, and against the union of all runs."""
    found: dict[str, Table] = {}
    reference = comparison.against
    for name, against in {"indicators": reference, "indicators-union": comparison.union()}.items():
        if not len(against.front) or (name != "indicators" and not reference.true):
            continue
        measured = samples(comparison, against)
        scale = Scale.of(against.front, what=against.what).describe()
        title = f"{comparison.name}: against {against.what}"
        found[name] = summary_table(measured, caption=f"{title}.", notes=[scale])
        if against is reference and len(measured["GD"]) > 1:
            found["comparisons"] = pairs_table(measured, caption=f"{title}: solvers in pairs.")
            if len(measured["GD"]) > 2:
                found["overall"] = overall_table(measured, caption=f"{title}: all solvers.")
    return found


def cost_tables(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Table]:
    """A row for each cost and solver: evaluations, inner iterations, gradient solves and time of a run."""
    rows: list[list[Cell]] = [
        [cost, solver, summary.count, summary.mean, summary.median, summary.best, summary.worst]
        for cost, solvers in spent(comparison).items()
        for solver, values in solvers.items()
        for summary in [summarise(values)]
    ]
    heads: list[Column | str] = [Column("cost", grouped=True), "solver", "runs"]
    heads += [Column(name, digits=4) for name in ("mean", "median", "least", "most")]
    return {"spent": table(heads, rows, f"{comparison.name}: costs of a run.")}
