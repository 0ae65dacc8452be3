"""The report on a study's folder: tables as text, CSV and LaTeX, figures as PNG and PDF, computed from the files in the folder."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from macs.front import Front
from macs.io.atomic import write_whole
from macs.io.text import counted

from ..batch.store import Store
from ..files import Flag, Text, check_trusted, checked, errors_begin_with
from ..measures.attainment import attainment
from ..measures.references import ReferenceKey, read, reference_addresses
from .choices import choices_figures, choices_tables, only_single_points
from .comparison import AXES, CHARGED, Charge, Comparison, comparisons, histories, in_steps
from .comparison_tables import claims_tables, cost_tables, indicator_tables
from .flights import Flights, VariablesAlongFront
from .goal import GoalAttainment, StatedGoal, goal_attainments
from .page import Page
from .plots import attainment_figure, convergence_figure, front_figure
from .published import papers, published_tables, with_count
from .sensitivity import ChangedData, DispersedFront, changed_data, dispersed_fronts
from .tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = "report"
TABLES: Sequence[Callable[[Comparison, Mapping[str, Any]], dict[str, Table]]] = (
    *(claims_tables, choices_tables),
    *(indicator_tables, cost_tables),
)
"""The tables of each comparison: (comparison, definition of the study) -> {name of a file: table}. A new table is one more here."""
OF_FRONTS = (indicator_tables,)
"""Those left out where solvers return single points, or there is nothing to compare."""


class ReportKeys(msgspec.Struct):
    """The keys of a study that only its report reads; those with rules of their own are checked where they are used."""

    reference: ReferenceKey = None
    nominal: Text | None = None
    flights: Flag = True
    note: Text = ""


@dataclass(frozen=True, repr=False)
class Report:
    """The text of a report, and the files that were written."""

    text: str  # all tables, as a terminal shows them
    files: tuple[Path, ...]

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<Report: {counted(len(self.files), 'file')}>"


def report(
    out: str | PathLike[str],
    *,
    foreign: Mapping[str, Sequence[str | PathLike[str]]] | None = None,
    figures: bool = True,
    progress: bool = False,
    trust: bool = False,
    page: Page | None = None,
) -> Report:
    """The report on all finished runs of a study: its tables and figures are written into the folder `report` in the study's folder."""
    store = Store.open(out, trust)
    summary, study = store.summary(), store.definition
    if not summary.finished:
        raise ValueError(f"there is nothing to report on yet: {str(summary).splitlines()[0]}")
    if page is not None:
        page.check(store)
    with errors_begin_with(f"'{store.path / 'study.json'}'"):
        keys = checked({key: study[key] for key in ReportKeys.__struct_fields__ if key in study}, ReportKeys)
        papers(study.get("paper") or [])
        if study.get("goal") is not None:
            StatedGoal.of(study["goal"], {})
        for address in reference_addresses(keys.reference):
            check_trusted(address, trust, "it")
    found = comparisons(store, {})
    others = {name: [_foreign(path, found) for path in paths] for name, paths in (foreign or {}).items()}
    if others:
        found = comparisons(store, others)
    writer = _Writer(Path(out) / FOLDER, page)
    sections = [str(summary), *([with_count(keys.note, study)] if keys.note else [])]
    for comparison in in_steps("report", found) if progress else found:
        sections += _section(comparison, study, writer, figures)
    for number, part in enumerate(_across(found, study)):
        if number == 0:
            writer.heading("All together", [])
        sections += [writer.table(name, one) for name, one in part.tables().items()]
        for name, figure in (part.figures() if figures else {}).items():
            writer.figure(name, figure)
    sections += [writer.table(name, one, first=True) for name, one in published_tables(found, study).items()]
    text = "\n\n".join(sections)
    writer.write("report.txt", text.encode() + b"\n")
    if page is not None:
        page.measured(found)
        writer.files += page.save(summary, study)
    return Report(text, tuple(writer.files))


def _section(comparison: Comparison, study: Mapping[str, Any], writer: _Writer, drawn: bool) -> list[str]:
    """The tables of a comparison as text, written to files with its figures."""
    tables = tables_of(comparison, study)
    figures = _figures(comparison, study) if drawn else {}
    shown: Flights | VariablesAlongFront | None = None
    if study.get("flights", True):
        shown = Flights.of(comparison) or VariablesAlongFront.of(comparison)
    if shown is not None:
        tables["representatives"] = shown.table()
        figures |= shown.figures() if drawn else {}
    stem = f"{comparison.problem}-{comparison.transcription}"
    left_out = _left_out(comparison)
    writer.heading(comparison.name, left_out)
    texts = [writer.table(f"{stem}-{name}", one) for name, one in tables.items()]
    for name, figure in figures.items():
        writer.figure(f"{stem}-{name}", figure)
    return [f"{comparison.name}\n{'=' * len(comparison.name)}", *left_out, *texts]


def tables_of(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Table]:
    """{name of a file: table} of a comparison, but that of the flights that stand for each front."""
    compared = not comparison.against.alone and not only_single_points(comparison)
    kinds = [kind for kind in TABLES if compared or kind not in OF_FRONTS]
    return {name: one for kind in kinds for name, one in kind(comparison, study).items()}


def _across(found: Sequence[Comparison], study: Mapping[str, Any]) -> list[GoalAttainment | ChangedData | DispersedFront]:
    """What is said of several comparisons together."""
    return [*goal_attainments(found, study), *changed_data(found, study), *dispersed_fronts(found, study)]


def tables_across(found: Sequence[Comparison], study: Mapping[str, Any]) -> dict[str, Table]:
    """{name of a file: table} of several comparisons together: a goal, changed data, dispersions, and published tables beside ours."""
    parts = [part.tables() for part in _across(found, study)]
    return {name: one for tables in (*parts, published_tables(found, study)) for name, one in tables.items()}


def _foreign(path: str | PathLike[str], found: Sequence[Comparison]) -> Front:
    """A front of another program, with the objectives of the first problem that they fit. Its problem is never loaded."""
    reasons = []
    for comparison in found:
        try:
            return read(path, comparison.known.goals)
        except ValueError as error:
            reasons.append(str(error))
    raise ValueError("; ".join(dict.fromkeys(reasons)))


def _left_out(comparison: Comparison) -> list[str]:
    lines = [f"{solver}: {count} failed, which count as worse than any" for solver, count in comparison.failures.items() if count]
    lines += [
        f"{solver}: {count} missing, killed or unreadable, which are left out" for solver, count in comparison.left_out.items() if count
    ]
    lines += [] if any(map(len, comparison.every)) else ["no run found a point that counts"]
    return ["\n".join(lines)] if lines else []


def _figures(comparison: Comparison, study: Mapping[str, Any]) -> dict[str, Figure]:
    """{name of a file: figure} of a comparison; "means" has the mean objectives of the front of each run."""
    reference = comparison.against
    name = "truth" if reference.true else "reference"
    found: dict[str, Figure] = choices_figures(comparison)
    if len(reference.front) < 2:
        return found
    goals, against = comparison.known.goals, None if reference.alone else reference.front
    printed = [point for paper in papers(study.get("paper") or []) for point in paper.printed(comparison)]
    if len(goals) > 1 and (printed or not only_single_points(comparison)):
        found["fronts"] = front_figure(comparison.fronts, goals=goals, reference=against, printed=printed, truth_name=name)
    if reference.alone or only_single_points(comparison):
        return found
    if len(goals) == 2:
        means = {solver: [one.objectives.mean(axis=0)[None] for one in fronts if len(one)] for solver, fronts in comparison.fronts.items()}
        found["means"] = front_figure(means, goals=[replace(goal, name=f"mean {goal.name}") for goal in goals])
        surfaces = {solver: attainment(fronts) for solver, fronts in comparison.attaining().items()}
        if surfaces:
            found["attainment"] = attainment_figure(surfaces, goals=goals, reference=reference.front, truth_name=name)
    charge = Charge.of(comparison)
    for indicator, larger in (("IGD", False), ("hypervolume", True)):
        for axis, (_, label) in AXES.items():
            runs_so_far = histories(comparison, reference, indicator, axis, charge)
            if axis == "evaluations":
                runs_so_far = {_with_solves(comparison, solver): runs for solver, runs in runs_so_far.items()}
            elif axis == CHARGED and charge is not None:
                label = f"{CHARGED}, of {charge.solver}"
            if runs_so_far:
                stem = f"{indicator.lower()}-over-{axis.replace(' ', '-')}"
                ylabel = f"{indicator} (normalised), as claimed"
                found[stem] = convergence_figure(runs_so_far, xlabel=label, ylabel=ylabel, larger=larger, log=not larger)
    return found


def _with_solves(comparison: Comparison, solver: str) -> str:
    """The name of a solver in a figure over evaluations, which do not count its gradient solves: with their number, if it makes any."""
    solves = [run.front.stats["gradient_solves"] for run in comparison.runs[solver]]
    return f"{solver} + {counted(int(np.median(solves)), 'gradient solve')}" if any(solves) else solver


class _Writer:
    """Writes into one folder, each file whole, and what is on a page to that."""

    def __init__(self, folder: Path, page: Page | None = None) -> None:
        folder.mkdir(exist_ok=True)
        self._folder, self._page, self.files = folder, page, list[Path]()
        self._used: Counter[tuple[str, str]] = Counter()

    def table(self, name: str, one: Table, first: bool = False) -> str:
        """Write a table in its three forms, on the page among what comes first if it is to be; returns its text."""
        if self._page is not None:
            self._page.table(one, first)
        self.files += one.save(self._folder / self._free("table", name))
        return one.text()

    def figure(self, name: str, figure: Figure) -> None:
        """Write a figure, as a picture and for print."""
        stem = self._free("figure", name)
        if self._page is not None:
            self._page.figure(stem, figure)
        for suffix in ("png", "pdf"):
            content = io.BytesIO()
            figure.savefig(content, format=suffix, dpi=200)
            # To lay it out takes as long as to draw it, and once does.
            figure.set_layout_engine("none")
            self.write(f"{stem}.{suffix}", content.getvalue())

    def _free(self, kind: str, name: str) -> str:
        """The stem of a file that no other table, or figure, has: labels may differ only in characters that file names do not have."""
        stem = re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-")
        self._used[kind, stem] += 1
        return stem if self._used[kind, stem] == 1 else f"{stem}-{self._used[kind, stem]}"

    def heading(self, title: str, lines: Sequence[str]) -> None:
        """Begin a part of the page."""
        if self._page is not None:
            self._page.heading(title, lines)

    def write(self, name: str, content: bytes) -> None:
        """Write a file."""
        write_whole(self._folder / name, content)
        self.files.append(self._folder / name)
