"""The pages of a front and of a study: points of all runs, comparisons as figures, and tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from macs.front import Front
from macs.io.atomic import check_target, write_whole
from problems.compiled import Objective

from ..batch.store import Store, StoredRun, StudySummary, median_time, reason
from ..measures.attainment import attainment, band, staircase
from ..measures.indicators import minimised, pieces, truth
from ..measures.references import Reference
from ..report.choices import only_single_points
from ..report.comparison import AXES, Comparison, comparisons, histories, in_steps
from ..report.published import with_count
from ..report.report import tables_across, tables_of
from ..report.tables import Table
from .page import packed, page, plotly
from .points import about, columns, curve_data, details, finite, goals_data, samples_of


def write_page(source: str | PathLike[str], out: str | PathLike[str], *, trust: bool = False, progress: bool = False) -> Path:
    """Write the page of a front's file or of a study's folder to one file, whole."""
    plotly()  # or the error that it is not installed, before any work
    check_target(out)
    content = study_page(Store.open(source, trust), progress) if Path(source).is_dir() else front_page(read_front(source))
    write_whole(out, content)
    return Path(out)


def read_front(path: str | PathLike[str]) -> Front:
    """A front from a file, as data: its problem is not loaded. Raises ValueError if there is none."""
    try:
        return Front.load(path)
    except FileNotFoundError:
        raise ValueError(f"there is no file or folder '{path}'") from None


def front_page(front: Front) -> bytes:
    """The page of a front: its data are those of a study with one comparison of one run."""
    name, solver = problem_name(front), solver_name(front)
    comparison = {
        "name": name,
        "goals": goals_data(front.goals),
        "solvers": [solver],
        "runs": [run_data(front, solver, block="0", curve=curve_data(front))],
    }
    data = {"title": name, "kind": "front", "comparisons": [comparison]}
    return page(data, {"0": packed(details(front, samples_of([front])))})


def problem_name(front: Front) -> str:
    """The name of a front's problem."""
    return front.source.name if front.source is not None else "black box"


def solver_name(front: Front) -> str:
    """The name of the solver of a front; "points" if it states none."""
    return str(front.solver.get("name", "")) or "points"


def run_data(front: Front, solver: str, number: int = 1, block: str = "", **more: Any) -> dict[str, Any]:
    """A finished run, with its points as the solver returned them; `block` is the name of their details."""
    return {"solver": solver, "number": number, "block": block, **more, "points": columns(front), "about": about(front)}


def study_page(store: Store, progress: bool = False) -> bytes:
    """The page of a study's folder. Raises ValueError if it has no finished run, or a run's points cannot be verified."""
    summary = store.summary()
    if not summary.finished:
        raise ValueError(f"there is nothing to report on yet: {str(summary).splitlines()[0]}")
    found = comparisons(store, {})
    samples = samples_of([run.front for run in summary.runs if run.finished])
    names = {(run.cell.name, run.number): str(k) for k, run in enumerate(summary.runs)}
    blocks: dict[str, bytes] = {}
    shown = []
    for comparison in in_steps("page", found) if progress else found:
        runs = []
        for run in (run for ones in comparison.runs.values() for run in ones):
            name = names[run.cell.name, run.number]
            if name not in blocks:
                blocks[name] = packed(details(run.front, samples))
            runs.append(run_data(run.front, run.cell.solver, run.number, name, seed=str(run.seed)))
        goals, solvers = goals_data(comparison.known.goals), list(comparison.fronts)
        one = {"name": comparison.name, "goals": goals, "solvers": solvers, "runs": runs}
        shown.append(one | measured_data(comparison, store.definition))
    total = {"total": len(summary.runs), "finished": summary.finished, "failed": summary.failed}
    progressed = {**total, "cells": cells_data(summary, lambda run: run.state), "failures": failures_data(summary)}
    head = {"title": summary.name, "kind": "study", "note": with_count(store.definition.get("note", ""), store.definition)}
    tables = tables_data(tables_across(found, store.definition))
    return page(head | {"progress": progressed, "comparisons": shown, "tables": tables}, blocks)


def cells_data(summary: StudySummary, state: Callable[[StoredRun], str]) -> list[dict[str, Any]]:
    """How many runs of each cell there are in which state, a function of the run, and their median time."""
    cells = []
    for cell, runs in summary.cells.items():
        states = {**dict.fromkeys(("finished", "missing", "running", "waiting", "failed"), 0), **Counter(map(state, runs))}
        cells.append({"labels": list(cell.labels), **states, "time": median_time(runs)})
    return cells


def failures_data(summary: StudySummary) -> list[dict[str, str]]:
    """Why runs failed, with the traceback of at most 200 of them."""
    failed = [run for run in summary.runs if run.state == "failed"]
    return [{"name": f"run {run.number} of {run.cell.name}", "reason": reason(run), "traceback": run.traceback} for run in failed[:200]]


def measured_data(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Any]:
    """The reference of a comparison, attainment surfaces and convergence of its solvers, from the points that count, and its tables."""
    reference = comparison.against
    found: dict[str, Any] = {"tables": tables_data(tables_of(comparison, study))}
    if len(reference.front):
        found["reference"] = _reference_data(reference, comparison.known.goals)
        if not only_single_points(comparison):
            found |= {"attainment": _attainment_data(comparison), "convergence": _convergence_data(comparison, reference)}
    return found


def _reference_data(reference: Reference, goals: Sequence[Objective]) -> dict[str, Any]:
    """A reference as lines, where it is a curve, else as points; parts with a column for each objective."""
    signs = np.array([goal.sign for goal in goals])
    lines = pieces(reference.front, goals)
    parts = [(part * signs).T.tolist() for part in lines or [truth(reference.front, goals)]]
    return {"name": reference.what, "curves": bool(lines), "parts": parts}


def _attainment_data(comparison: Comparison) -> dict[str, Any] | None:
    """{solver: {"runs", "best", "median", "worst"}} of two objectives; each surface as its two columns, None where it is not attained."""
    goals, attaining = comparison.known.goals, comparison.attaining()
    if len(goals) != 2 or not attaining:
        return None
    every = np.vstack([minimised(front, goals) for front in comparison.every if len(front)])
    low, high = every.min(axis=0), every.max(axis=0)
    ends = (high + 0.04 * np.where(high > low, high - low, 1.0)) * [goal.sign for goal in goals]
    found: dict[str, Any] = {}
    for solver, fronts in attaining.items():
        surface = attainment(fronts)
        corners = {"best": surface.best, "median": surface.median, "worst": surface.worst}
        lines = {name: staircase(one, surface.signs, ends).T.tolist() if len(one) else None for name, one in corners.items()}
        found[solver] = {"runs": surface.runs, **lines}
    return found


def _convergence_data(comparison: Comparison, reference: Reference) -> list[dict[str, Any]]:
    """Of each indicator over each cost the median and quartiles of every solver's runs; None where so many runs have nothing."""
    found = []
    for name, larger in (("IGD", False), ("hypervolume", True)):
        for axis, (_, label) in AXES.items():
            bands = {solver: band(runs, larger=larger) for solver, runs in histories(comparison, reference, name, axis).items()}
            solvers = {
                solver: {"runs": one.runs, **{key: finite(getattr(one, key)) for key in ("x", "lower", "median", "upper")}}
                for solver, one in bands.items()
            }
            if solvers:
                found.append({"indicator": name, "larger": larger, "axis": label, "solvers": solvers})
    return found


def tables_data(tables: Mapping[str, Table]) -> list[dict[str, Any]]:
    """Tables as the report in the terminal has them: heads, cells as text, which columns are of words, caption and notes."""
    found = []
    for one in tables.values():
        heads, cells, left = one.shown()
        found.append({"caption": one.caption, "heads": heads, "rows": cells, "words": left, "notes": list(one.notes)})
    return found
