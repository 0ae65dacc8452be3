"""The report on a study's folder: tables as text, CSV and LaTeX, figures as PNG and PDF, all from what is in the folder."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from macs.front import Front
from macs.io.atomic import write_whole
from macs.io.console import Steps

from ..batch import file as studyfile
from ..batch.store import Store, summary_text
from ..measures.attainment import attainment
from ..measures.references import Reference, read
from ..measures.scale import Scale
from ..measures.statistics import summarise
from .changed_data import Changed, changes
from .comparison import Comparison, comparisons
from .flights import Flights
from .goal import Attained, attained
from .plots import attainment_figure, convergence_figure, front_figure
from .published import check, published_tables
from .run_measures import AXES, histories, samples, spent
from .statistics_tables import comparison_table, overall_table, summary_table
from .tables import Cell, Column, Table, table
from .verified import claims_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = "report"


@dataclass(frozen=True)
class Report:
    """What was found, and where it was written.

    Attributes
    ----------
    text : str
        All tables, as a terminal shows them.
    files : tuple of Path
    """

    text: str
    files: tuple[Path, ...] = field(repr=False)

    def __str__(self) -> str:
        return self.text


def report(
    out: str | PathLike[str],
    *,
    foreign: Mapping[str, Sequence[str | PathLike[str]]] | None = None,
    figures: bool = True,
    progress: bool = False,
) -> Report:
    """Measure all finished runs of a study, and write tables and figures into the folder `report` in it.

    Parameters
    ----------
    out : path
        The study's folder. Runs that are missing, failed or unreadable are told of, and do not keep the others from being reported.
    foreign : {name: files}, optional
        Fronts of other programs that join in, a file for each run: CSV tables of objectives, or saved fronts; on the problem whose
        objectives they have.
    figures : bool
        Draw, too, which takes most of the time.
    progress : bool
        Tell on the terminal how far it is.

    Raises
    ------
    ValueError
        The folder holds no study, or no finished run; a reference or foreign front cannot be read.
    OSError
        A file cannot be written.
    """
    store = Store.open(out)
    summary = store.summary()
    if not summary.finished:
        raise ValueError(f"there is nothing to report on yet\n{summary_text(summary)}")
    papers = store.definition.get("paper") or []
    with studyfile.told(f"'{out}' holds a study of an earlier MACS, or a damaged one; run the study again, which keeps what is finished"):
        check(papers)
    found = comparisons(store, {})
    others = {name: [_foreign(path, found) for path in paths] for name, paths in (foreign or {}).items()}
    if others:
        found = comparisons(store, others)
    writer = _Writer(Path(out) / FOLDER)
    sections = [summary_text(summary), *([note] if (note := store.definition.get("note")) else [])]
    for comparison in _told(found) if progress else found:
        sections += _section(comparison, store.definition, writer, figures)
    across: list[Attained | Changed] = [
        *attained(found, store.definition.get("goal"), store.definition.get("verify")),
        *changes(found, store.definition.get("nominal"), store.definition.get("verify")),
    ]
    for part in across:
        sections += [writer.table(_plain(name), one) for name, one in part.tables().items()]
        for name, figure in (part.figures() if figures else {}).items():
            writer.figure(_plain(name), figure)
    sections += [writer.table(name, one) for name, one in published_tables(found, papers).items()]
    text = "\n\n".join(sections)
    writer.write("report.txt", text.encode() + b"\n")
    return Report(text, tuple(writer.files))


def _told(found: Sequence[Comparison]) -> Iterator[Comparison]:
    """One after the other, telling on the terminal which."""
    with Steps("report", len(found)) as steps:
        for comparison in found:
            steps.begin(comparison.name)
            yield comparison


def _section(comparison: Comparison, study: Mapping[str, Any], writer: _Writer, drawn: bool) -> list[str]:
    """Write what there is of a comparison of a study with this definition; returns its tables as text."""
    reference, verify = comparison.reference(study.get("reference")), study.get("verify")
    told = [f"{comparison.name}\n{'=' * len(comparison.name)}", *_left_out(comparison)]
    tables, figures = _tables(comparison, reference, verify), _figures(comparison, reference) if drawn else {}
    flights = Flights.of(comparison, reference) if study.get("flights", True) else None
    if flights is not None:
        tables["representatives"] = flights.table()
        figures |= flights.figures() if drawn else {}
    told += [writer.table(f"{_stem(comparison)}-{name}", one) for name, one in tables.items()]
    for name, figure in figures.items():
        writer.figure(f"{_stem(comparison)}-{name}", figure)
    return told


def _foreign(path: str | PathLike[str], found: Sequence[Comparison]) -> Front:
    """A front of another program, of the first problem whose objectives it has."""
    reasons = []
    for comparison in found:
        try:
            return read(path, comparison.known.goals)
        except ValueError as error:
            reasons.append(str(error))
    raise ValueError("; ".join(dict.fromkeys(reasons)))


def _stem(comparison: Comparison) -> str:
    return _plain(f"{comparison.problem}-{comparison.transcription}")


def _plain(name: str) -> str:
    """For a file."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-")


def _left_out(comparison: Comparison) -> list[str]:
    told = [f"{solver}: {count} failed, which count as worse than any" for solver, count in comparison.failures.items() if count]
    told += [
        f"{solver}: {count} missing, killed or unreadable, which are left out" for solver, count in comparison.left_out.items() if count
    ]
    told += [] if any(map(len, comparison.every)) else ["no run found a point that counts"]
    return ["\n".join(told)] if told else []


def _tables(comparison: Comparison, reference: Reference, verify: float | None) -> dict[str, Table]:
    """Name of a file -> table."""
    found: dict[str, Table] = {}
    if verify is not None:
        found["claims"] = claims_table(comparison.verified, verify, f"{comparison.name}: what was claimed, and what holds.")
    for name, against in {"indicators": reference, "indicators-union": comparison.union()}.items():
        if not len(against.front) or (name != "indicators" and not reference.true):
            continue
        measured = samples(comparison, against)
        scale = Scale.of(against.front, like=comparison.known, what=against.what).describe()
        title = f"{comparison.name}: against {against.what}"
        found[name] = summary_table(measured, caption=f"{title}.", notes=[scale])
        if against is reference and len(measured["GD"]) > 1:
            found["comparisons"] = comparison_table(measured, caption=f"{title}: solvers in pairs.")
            if len(measured["GD"]) > 2:
                found["overall"] = overall_table(measured, caption=f"{title}: all solvers.")
    costs: list[list[Cell]] = [
        [cost, solver, summary.count, summary.mean, summary.median, summary.best, summary.worst]
        for cost, solvers in spent(comparison).items()
        for solver, values in solvers.items()
        for summary in [summarise(values)]
    ]
    heads: list[Column | str] = [
        Column("spent", grouped=True),
        "solver",
        "runs",
        *(Column(name, digits=4) for name in ("mean", "median", "least", "most")),
    ]
    found["spent"] = table(heads, costs, f"{comparison.name}: what a run spent.")
    return found


def _figures(comparison: Comparison, reference: Reference) -> dict[str, Figure]:
    """Name of a file -> figure."""
    name = "truth" if reference.true else "reference"
    found: dict[str, Figure] = {}
    if not len(reference.front):
        return found
    if len(comparison.known.goals) > 1:
        found["fronts"] = front_figure(comparison.fronts, reference=reference.front, truth_name=name)
    # A failed run attains nothing, as an empty front does.
    nothing = comparison.known[:0]
    runs = {solver: [*fronts, *[nothing] * comparison.failures.get(solver, 0)] for solver, fronts in comparison.fronts.items()}
    if len(comparison.known.goals) == 2:
        surfaces = {solver: attainment(fronts) for solver, fronts in runs.items() if any(map(len, fronts))}
        if surfaces:
            found["attainment"] = attainment_figure(surfaces, goals=comparison.known.goals, reference=reference.front, truth_name=name)
    for indicator, larger in (("IGD", False), ("hypervolume", True)):
        for axis, (_, label) in AXES.items():
            told = histories(comparison, reference, indicator, axis)
            if told:
                stem = f"{indicator.lower()}-over-{axis.replace(' ', '-')}"
                found[stem] = convergence_figure(told, xlabel=label, ylabel=f"{indicator} (normalised)", larger=larger, log=not larger)
    return found


class _Writer:
    """Writes into one folder, each file whole."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        self._folder, self.files = folder, list[Path]()
        self._used: Counter[tuple[str, str]] = Counter()

    def table(self, stem: str, one: Table) -> str:
        """Write a table in its three forms; returns its text."""
        stem = self._free("table", stem)
        self.files += one.save(self._folder / stem)
        return one.text()

    def figure(self, stem: str, figure: Figure) -> None:
        """Write a figure, as a picture and for print."""
        stem = self._free("figure", stem)
        for suffix in ("png", "pdf"):
            content = io.BytesIO()
            figure.savefig(content, format=suffix, dpi=200)
            self.write(f"{stem}.{suffix}", content.getvalue())

    def _free(self, kind: str, stem: str) -> str:
        """A name that no other table, or figure, has: labels may differ in what file names do not show."""
        self._used[kind, stem] += 1
        return stem if self._used[kind, stem] == 1 else f"{stem}-{self._used[kind, stem]}"

    def write(self, name: str, content: bytes) -> None:
        """Write a file."""
        write_whole(self._folder / name, content)
        self.files.append(self._folder / name)
