"""Published tables beside ours: what a study's `[[paper]]` sections say of them, row by row, and the same figures of our runs.

A section has `of`, one of `kinds.KINDS`, and `rows`: {problem, by, figures by key}. Beside them there may be `source`, `note` (how the
paper's figures came about), `differs` (what is not the same here), and whatever the kind needs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from macs.baselines.population import PopulationSolver
from problems.checks import unknown

from ..batch.file import is_number, told
from .comparison import Comparison
from .published_kinds import KINDS, STATISTICS, Kind
from .tables import Cell, Column, Table, table

if TYPE_CHECKING:
    from macs.solvers.solver import Solver
    from problems.compiled import CompiledProblem

TEXTS = ("source", "note", "differs")
SECTION = ("of", "rows", *TEXTS)
ROW = ("problem", "by")
STATISTIC = "statistic"


def check(papers: Any) -> None:
    """Raise ValueError that names what a study's `[[paper]]` sections hold and should not, or lack; whatever the study is of."""
    if isinstance(papers, str | Mapping) or not isinstance(papers, Sequence):
        raise ValueError(f"paper must be a list of tables, [[paper]], not a {type(papers).__name__}")
    for number, paper in enumerate(papers, 1):
        with told(_section(number, paper)):
            _check_section(paper)


def check_against(papers: Sequence[Mapping[str, Any]], problems: Mapping[str, CompiledProblem], solvers: Mapping[str, Solver]) -> None:
    """Raise ValueError that names what `[[paper]]` sections, which `check` has seen, say of things that a study does not have.

    Parameters
    ----------
    problems, solvers : mapping
        The study's, by label.
    """
    for number, paper in enumerate(papers, 1):
        kind = KINDS[paper["of"]]
        with told(_section(number, paper)):
            if kind.population and not any(isinstance(solver, PopulationSolver) for solver in solvers.values()):
                raise ValueError(f"it is of solvers with a population, and none of the study's has one: {', '.join(solvers)}")
            for place, row in enumerate(paper["rows"], 1):
                with told(f"row {place}"):
                    if row["problem"] not in problems:
                        raise ValueError(unknown("problem", row["problem"], problems))
                    if kind.columns(paper) is None:
                        _check_keys(row, "objective", [goal.name for goal in problems[row["problem"]].goals])
            for label in dict.fromkeys(row["problem"] for row in paper["rows"]):
                with told(f"problem '{label}'"):
                    kind.fits(paper, problems[label])


def published_tables(comparisons: Sequence[Comparison], papers: Sequence[Mapping[str, Any]]) -> dict[str, Table]:
    """Name of a file -> table: the paper's rows and ours, problem by problem. Those of problems that there are no runs of are left out."""
    found: dict[str, Table] = {}
    for number, paper in enumerate(papers, 1):
        together = _beside(comparisons, paper, KINDS[paper["of"]])
        if together is not None:
            found["published" if len(papers) == 1 else f"published-{number}"] = together
    return found


def _section(number: int, paper: Any) -> str:
    """How a section is called in errors."""
    of = paper.get("of") if isinstance(paper, Mapping) else None
    return f"[[paper]] {number}{f', of {of}' if isinstance(of, str) else ''}"


def _check_section(paper: Any) -> None:
    if not isinstance(paper, Mapping):
        raise ValueError(f"it must be a table, not {paper!r}")
    if not isinstance(paper.get("of"), str) or paper["of"] not in KINDS:
        raise ValueError(f"of must be one of {', '.join(KINDS)}, not {paper.get('of')!r}")
    kind = KINDS[paper["of"]]
    for key in paper:
        if key not in (*SECTION, *kind.needs):
            raise ValueError(unknown("key", key, (*SECTION, *kind.needs)))
    for key, checked in kind.needs.items():
        if key not in paper:
            raise ValueError(f"it needs {key}")
        checked(paper[key])
    for key in TEXTS:
        if not isinstance(paper.get(key, ""), str):
            raise ValueError(f"{key} must be a text, not {paper[key]!r}")
    if not isinstance(paper.get("rows"), Sequence) or not paper["rows"]:
        raise ValueError("rows must be a list of tables")
    seen: list[tuple[str, ...]] = []
    for place, row in enumerate(paper["rows"], 1):
        with told(f"row {place}"):
            _check_row(row, kind, kind.columns(paper))
            name = tuple(row[key] for key in (*ROW, STATISTIC) if key in row)
            if name in seen:
                raise ValueError(f"it is of the same as row {seen.index(name) + 1}: {', '.join(name)}")
            seen.append(name)


def _check_row(row: Any, kind: Kind, columns: Mapping[str, Column] | None) -> None:
    if not isinstance(row, Mapping) or not all(isinstance(row.get(key), str) for key in ROW):
        raise ValueError(f"it must be a table with problem and by, not {row!r}")
    if kind.statistics and (not isinstance(row.get(STATISTIC), str) or row[STATISTIC] not in STATISTICS):
        raise ValueError(f"{STATISTIC} must be one of {', '.join(STATISTICS)}, not {row.get(STATISTIC)!r}")
    if STATISTIC in row and not kind.statistics:
        raise ValueError(f"{STATISTIC}: this kind of table has none")
    if columns is not None:
        _check_keys(row, "key", list(columns))
    for key in _figures(row):
        if not is_number(row[key]):
            raise ValueError(f"{key} must be a finite number, not {row[key]!r}")
    if not _figures(row):
        raise ValueError(f"it holds no figure: {', '.join(columns) if columns else 'there must be some objective'}")


def _check_keys(row: Mapping[str, Any], what: str, known: Sequence[str]) -> None:
    """Raise ValueError if a row holds a figure of something else than those known."""
    for key in _figures(row):
        if key not in known:
            raise ValueError(unknown(what, key, known))


def _figures(row: Mapping[str, Any]) -> list[str]:
    return [key for key in row if key not in (*ROW, STATISTIC)]


def _beside(comparisons: Sequence[Comparison], paper: Mapping[str, Any], kind: Kind) -> Table | None:
    """One published table and ours; None if there are no runs of its problems."""
    columns = kind.columns(paper)
    keys = list(columns or dict.fromkeys(key for row in paper["rows"] for key in _figures(row)))
    rows: list[list[Cell]] = []
    notes: list[str] = []
    for problem in dict.fromkeys(row["problem"] for row in paper["rows"]):
        here = [comparison for comparison in comparisons if comparison.problem == problem]
        theirs = [row for row in paper["rows"] if row["problem"] == problem]
        if not here:
            continue
        seconds = max((row["seconds"] for row in theirs if "seconds" in row), default=None)
        rows += [[problem, row["by"], None, *_cells(row, keys, kind, None)] for row in theirs]
        seen = set[tuple[str, str]]()
        for comparison in here:
            for solver, figures in kind.ours(comparison, paper).items():
                if (solver, comparison.place(solver)) in seen:
                    continue  # it works apart, and is on each of the others' comparisons
                seen.add((solver, comparison.place(solver)))
                runs = len(comparison.fronts[solver]) + comparison.failures.get(solver, 0)
                rows += [[problem, f"{solver}, {comparison.place(solver)}", runs, *_cells(one, keys, kind, seconds)] for one in figures]
        said = {comparison.transcription: kind.note(comparison, paper) for comparison in here}
        if len(set(said.values())) == 1:
            notes.append(f"{problem}: {said[here[0].transcription]}")
        else:
            notes += [f"{problem}, {place}: {note}" for place, note in said.items()]
    if not rows:
        return None
    heads: list[Column | str] = [
        Column("problem", grouped=True),
        Column("by", grouped=kind.statistics),
        Column("runs", grouped=kind.statistics),
    ]
    heads += [STATISTIC] if kind.statistics else []
    units = {goal.name: goal.unit for comparison in comparisons for goal in comparison.known.goals}
    heads += [columns[key] if columns else Column(key, units.get(key, ""), digits=4) for key in keys]
    heads += [Column("times as fast", digits=2)] if "seconds" in keys else []
    caption = f"Beside {paper['source']}" if "source" in paper else "Beside published figures"
    words = [f"{word}: {paper[key]}." for key, word in (("note", "The paper"), ("differs", "What differs")) if key in paper]
    return table(heads, rows, f"{caption}.", [*notes, *words])


def _cells(figures: Mapping[str, Any], keys: Sequence[str], kind: Kind, theirs: float | None) -> list[Cell]:
    """A row's figures; `theirs` are the seconds that the paper's took."""
    cells: list[Cell] = [figures[STATISTIC]] if kind.statistics else []
    cells += [figures.get(key) for key in keys]
    if "seconds" in keys:
        cells.append(theirs / figures["seconds"] if theirs and figures.get("seconds") else None)
    return cells
