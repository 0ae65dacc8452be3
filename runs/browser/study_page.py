"""The page of a study: the points of all its runs, its comparisons as figures, and its tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from macs.front import Front
from macs.io.console import Steps
from problems.compiled import Objective

from ..batch.store import MISSING, Store, StoredRun, Summary, reason
from ..measures.attainment import attainment, staircase
from ..measures.convergence import Band, band
from ..measures.indicators import minimised, pieces, truth
from ..measures.references import Reference
from ..report.choices import only_choices
from ..report.comparison import Comparison, comparisons
from ..report.report import tables_across, tables_of
from ..report.run_measures import AXES, histories
from ..report.tables import Table
from .page import packed, page
from .points import about, columns, details, goals_data, samples_of

CONVERGING = (("IGD", False), ("hypervolume", True))
"""Indicators that are drawn over the costs of a run, and whether larger values are better."""
MOST_FAILURES = 200
"""Failed runs of which the page has the traceback."""


def study_page(store: Store, progress: bool = False) -> bytes:
    """The page of a study's folder. Raises ValueError if it has no finished run, or a run's points cannot be verified."""
    summary = store.summary()
    if not summary.finished:
        raise ValueError(f"there is nothing to report on yet: {str(summary).splitlines()[0]}")
    found = comparisons(store, {})
    samples = samples_of([run.front for run in summary.runs if run.finished])
    names = {id_of(run): str(k) for k, run in enumerate(summary.runs)}
    blocks: dict[str, bytes] = {}
    shown = []
    for comparison in _steps(found) if progress else found:
        for run in finished_runs(comparison):
            name = names[id_of(run)]
            if name not in blocks:
                blocks[name] = packed(details(run.front, samples))
        runs = [run_data(run, run.front, names[id_of(run)]) for run in finished_runs(comparison)]
        shown.append(comparison_data(comparison, runs) | measures_data(comparison) | tables_data(comparison, store.definition))
    head = {"title": summary.name, "kind": "study", "note": store.definition.get("note", "")}
    return page(head | {"progress": progress_data(summary), "comparisons": shown, **across_data(found, store.definition)}, blocks)


def _steps(found: Sequence[Comparison]) -> Iterator[Comparison]:
    with Steps("page", len(found), at_once=True) as steps:
        for comparison in found:
            steps.begin(comparison.name)
            yield comparison


def id_of(run: StoredRun) -> tuple[str, int]:
    """What names a run within its study."""
    return run.cell.name, run.number


def finished_runs(comparison: Comparison) -> list[StoredRun]:
    """All of them, solver by solver."""
    return [run for runs in comparison.runs.values() for run in runs]


def run_data(run: StoredRun, front: Front, block: str) -> dict[str, Any]:
    """A finished run: its labels, and its points as the solver returned them."""
    return {
        "solver": run.cell.solver,
        "number": run.number,
        "seed": str(run.seed),
        "block": block,
        "points": columns(front),
        "about": about(front),
    }


def comparison_data(comparison: Comparison, runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Names, objectives and runs of a comparison."""
    return {"name": comparison.name, "goals": goals_data(comparison.known.goals), "solvers": list(comparison.fronts), "runs": list(runs)}


def measures_data(comparison: Comparison) -> dict[str, Any]:
    """The reference of a comparison, and its solvers' attainment surfaces and convergence, from the points that count."""
    reference = comparison.against
    if not len(reference.front):
        return {}
    found: dict[str, Any] = {"reference": reference_data(reference, comparison.known.goals)}
    if only_choices(comparison):
        return found
    return found | {"attainment": attainment_data(comparison), "convergence": convergence_data(comparison, reference)}


def reference_data(reference: Reference, goals: Sequence[Objective]) -> dict[str, Any]:
    """A reference as lines, where it is a curve, else as points; parts with a column for each objective."""
    signs = np.array([goal.sign for goal in goals])
    F = truth(reference.front, goals)
    lines = pieces(F)
    return {"name": reference.what, "curves": bool(lines), "parts": [(part * signs).T.tolist() for part in (lines or [F])]}


def attainment_data(comparison: Comparison) -> dict[str, Any] | None:
    """{solver: {"runs", "best", "median", "worst"}} of two objectives; each surface as its two columns, None where it is not attained."""
    goals = comparison.known.goals
    if len(goals) != 2:
        return None
    # A failed run attains nothing, as an empty front does.
    nothing = comparison.known[:0]
    runs = {solver: [*fronts, *[nothing] * comparison.failures.get(solver, 0)] for solver, fronts in comparison.fronts.items()}
    surfaces = {solver: attainment(fronts) for solver, fronts in runs.items() if any(map(len, fronts))}
    every = np.vstack([minimised(front, goals) for fronts in runs.values() for front in fronts if len(front)])
    signs = np.array([goal.sign for goal in goals])
    low, high = every.min(axis=0), every.max(axis=0)
    ends = (high + 0.04 * np.where(high > low, high - low, 1.0)) * signs
    return {
        solver: {
            "runs": surface.runs,
            **{
                name: staircase(corners, surface.signs, ends).T.tolist() if len(corners) else None
                for name, corners in (("best", surface.best), ("median", surface.median), ("worst", surface.worst))
            },
        }
        for solver, surface in surfaces.items()
    }


def convergence_data(comparison: Comparison, reference: Reference) -> list[dict[str, Any]]:
    """Of each indicator over each cost the median and quartiles of every solver's runs; None where so many runs have nothing."""
    found = []
    for name, larger in CONVERGING:
        for axis, (_, label) in AXES.items():
            bands = {solver: band(runs, larger=larger) for solver, runs in histories(comparison, reference, name, axis).items()}
            if bands:
                solvers = {solver: _band_data(one) for solver, one in bands.items()}
                found.append({"indicator": name, "larger": larger, "axis": label, "solvers": solvers})
    return found


def _band_data(one: Band) -> dict[str, Any]:
    return {"runs": one.runs, **{name: _finite(getattr(one, name)) for name in ("x", "lower", "median", "upper")}}


def _finite(values: Any) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]


def tables_data(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of a comparison, as the report in the terminal has them."""
    return {"tables": [table_data(one) for one in tables_of(comparison, study).values()]}


def across_data(found: Sequence[Comparison], study: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of several comparisons together, published ones among them."""
    return {"tables": [table_data(one) for one in tables_across(found, study).values()]}


def table_data(one: Table) -> dict[str, Any]:
    """A table: heads, cells as text, which columns are of words, caption and notes."""
    heads, cells, left = one.shown()
    return {"caption": one.caption, "heads": heads, "rows": cells, "words": left, "notes": list(one.notes)}


def progress_data(summary: Summary) -> dict[str, Any]:
    """How many runs of each cell there are, and why others failed."""
    cells = []
    for cell, runs in summary.cells.items():
        times = [run.wall_time for run in runs if run.finished and run.wall_time]
        finished, missing = sum(run.finished for run in runs), sum(run.status == MISSING for run in runs)
        counts = {"runs": len(runs), "finished": finished, "missing": missing, "failed": len(runs) - finished - missing}
        cells.append({"labels": list(cell.labels), **counts, "time": float(np.median(times)) if times else None})
    total = {"total": len(summary.runs), "finished": summary.finished, "failed": summary.failed}
    return {**total, "cells": cells, "failures": failures_data(summary)}


def failures_data(summary: Summary) -> list[dict[str, str]]:
    """Why runs failed, of which not too many are named."""
    failed = [run for run in summary.runs if not run.finished and run.status != MISSING]
    return [
        {"name": f"run {run.number} of {run.cell.name}", "reason": reason(run.status, run.message), "traceback": run.traceback}
        for run in failed[:MOST_FAILURES]
    ]
