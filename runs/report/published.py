"""Published tables beside ours: the `[[paper]]` sections of a study, row by row, and the same figures of our runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from macs.baselines.population import PopulationSolver

from ..files import check_known, checked, errors_begin_with
from .comparison import Comparison
from .published_designs import Designs
from .published_kinds import (
    STATISTIC,
    Degrees,
    Ends,
    Feasibility,
    Hypervolume,
    Indicators,
    Objectives,
    PayoffTable,
    Published,
    figures_of,
)
from .tables import Cell, Column, Table, table

if TYPE_CHECKING:
    from macs.solvers.solver import Solver
    from problems.compiled import CompiledProblem
    from problems.vector import CompiledVectorProblem

KINDS = Indicators | Hypervolume | Objectives | Ends | Feasibility | PayoffTable | Degrees | Designs


def papers(given: Any) -> list[Published]:
    """The published tables that a study states. Raises ValueError that names the section, the row and the key that is wrong."""
    if isinstance(given, str | Mapping) or not isinstance(given, Sequence):
        raise ValueError(f"paper must be a list of tables, [[paper]], not a {type(given).__name__}")
    found = []
    for number, paper in enumerate(given, 1):
        with errors_begin_with(_section(number, paper)):
            found.append(checked(paper, KINDS))
    return found


def check_against(given: Any, problems: Mapping[str, CompiledProblem | CompiledVectorProblem], solvers: Mapping[str, Solver]) -> None:
    """Raise ValueError unless published tables are of problems, objectives and solvers that a study has."""
    for number, paper in enumerate(papers(given), 1):
        with errors_begin_with(_section(number, given[number - 1])):
            if paper.population and not any(isinstance(solver, PopulationSolver) for solver in solvers.values()):
                raise ValueError(f"it is of solvers with a population, and none of the study's has one: {', '.join(solvers)}")
            for place, row in enumerate(paper.rows, 1):
                with errors_begin_with(f"row {place}"):
                    check_known("problem", [row["problem"]], problems)
                    if paper.columns is None:
                        check_known("objective", figures_of(row), [goal.name for goal in problems[row["problem"]].goals])
            for label in dict.fromkeys(row["problem"] for row in paper.rows):
                with errors_begin_with(f"problem '{label}'"):
                    paper.check_problem(problems[label])


def published_tables(comparisons: Sequence[Comparison], papers: Sequence[Published]) -> dict[str, Table]:
    """{name of a file: table} of the paper's rows and ours, problem by problem. Problems without finished runs are left out."""
    found: dict[str, Table] = {}
    for number, paper in enumerate(papers, 1):
        together = _beside(comparisons, paper)
        if together is not None:
            found["published" if len(papers) == 1 else f"published-{number}"] = together
    return found


def _section(number: int, paper: Any) -> str:
    """Name of a section in messages."""
    of = paper.get("of") if isinstance(paper, Mapping) else None
    return f"[[paper]] {number}{f', of {of}' if isinstance(of, str) else ''}"


def _beside(comparisons: Sequence[Comparison], paper: Published) -> Table | None:
    """One published table and ours; None if there are no runs of its problems."""
    columns = paper.columns
    keys = [*(columns or dict.fromkeys(key for row in paper.rows for key in figures_of(row))), *paper.further]
    rows: list[list[Cell]] = []
    notes: list[str] = []
    for problem in dict.fromkeys(row["problem"] for row in paper.rows):
        here = [comparison for comparison in comparisons if comparison.problem == problem]
        theirs = [row for row in paper.rows if row["problem"] == problem]
        if not here:
            continue
        seconds = max((row["seconds"] for row in theirs if "seconds" in row), default=None)
        rows += [[problem, row["by"], None, *_cells(paper.theirs(row), keys, None, paper.statistics)] for row in theirs]
        seen = set[tuple[str, str]]()
        for comparison in here:
            for solver, figures in paper.ours(comparison).items():
                if (solver, comparison.place(solver)) in seen:
                    continue  # it works apart, and is on each of the others' comparisons
                seen.add((solver, comparison.place(solver)))
                runs = len(comparison.fronts[solver]) + comparison.failures.get(solver, 0)
                by = f"{solver}, {comparison.place(solver)}"
                rows += [[problem, by, runs, *_cells(one, keys, seconds, paper.statistics)] for one in figures]
        remarks = {comparison.transcription: paper.remark(comparison) for comparison in here}
        if len(set(remarks.values())) == 1:
            notes.append(f"{problem}: {remarks[here[0].transcription]}")
        else:
            notes += [f"{problem}, {place}: {note}" for place, note in remarks.items()]
    if not rows:
        return None
    heads: list[Column | str] = [Column("problem", grouped=True)]
    heads += [Column(name, grouped=paper.statistics) for name in ("by", "runs")]
    heads += [paper.statistic_head] if paper.statistics else []
    units = {goal.name: goal.unit for comparison in comparisons for goal in comparison.known.goals}
    known = {**(columns or {}), **paper.further}
    heads += [known.get(key) or Column(key, units.get(key, ""), digits=4) for key in keys]
    heads += [Column("the paper's time / ours", digits=2)] if "seconds" in keys else []
    caption = f"Beside {paper.source}" if paper.source else "Beside published figures"
    words = [f"{word}: {text}." for word, text in (("The paper", paper.note), ("What differs", paper.differs)) if text]
    return table(heads, rows, f"{caption}.", [*notes, *words])


def _cells(figures: Mapping[str, Any], keys: Sequence[str], theirs: float | None, statistics: bool) -> list[Cell]:
    """A row's figures, after its statistic in tables that have `statistics`; `theirs` are the seconds that the paper's took."""
    cells: list[Cell] = [figures.get(STATISTIC)] if statistics else []
    cells += [figures.get(key) for key in keys]
    if "seconds" in keys:
        cells.append(theirs / figures["seconds"] if theirs and figures.get("seconds") else None)
    return cells
