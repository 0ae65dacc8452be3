"""The searches of a contest, as studies: in a folder that is kept, the same command makes only those that are missing."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from macs.front import Front

from ...report.page_header import DIGITS, code
from ...study import Study
from .cases import Function, solvers

SEED = 2026
"""The one that the seeds of all searches are spawned from."""

Fronts = dict[str, list[Front]]
"""By solver, one for each seed that all solvers have finished."""


def studies(
    name: str, rivals: Sequence[str], functions: Sequence[Function], seeds: int, evaluations: int | None = None
) -> dict[str, Study]:
    """Studies of all functions that have as many points, by the names of their folders, with fewer evaluations than the functions' own if
    that is said. Searches that other code or other versions of the packages made are in other folders."""
    groups: dict[int, list[Function]] = {}
    for one in functions:
        groups.setdefault(one.points, []).append(one)
    return {
        f"{name}-{points}-{code()}": Study(
            f"{name}, {points} points",
            problems={one.name: one.stated() for one in group},
            solvers=solvers(rivals, points),
            evaluations={one.name: min(evaluations or one.evaluations, one.evaluations) for one in group},
            runs=seeds,
            seed=SEED,
            verify=None,
        )
        for points, group in groups.items()
    }


@contextmanager
def place(keep: str | None) -> Iterator[Path]:
    """The folder of the studies: one that is kept, or else one that is gone afterwards."""
    if keep is not None:
        yield Path(keep)
        return
    with TemporaryDirectory(prefix="macs_") as folder:
        yield Path(folder)


def search(batch: Study, folder: Path, jobs: int, only: Sequence[str] | None = None) -> None:
    """Make the searches that a study's folder lacks, of all solvers or only some."""
    others = sorted(one.name for one in folder.parent.glob(f"{folder.name[:-DIGITS]}*") if one != folder)
    if others and not folder.exists():
        print(f"{batch.name}: searches in {', '.join(others)} are of other code, and are not used", file=sys.stderr)
    summary = batch.run(folder, jobs=jobs, solvers=only, progress=True)
    if summary.failed:
        raise RuntimeError(f"searches failed, so there is nothing to compare:\n{summary}")


def finished(batch: Study, folder: Path, only: Sequence[str] | None = None) -> dict[str, Fronts]:
    """By function: the fronts of the seeds that all solvers have finished, or all of these."""
    runs = {(run.cell.problem, run.cell.solver, run.number): run for run in batch.status(folder).runs if run.finished}
    who = batch.chosen(only)
    fronts: dict[str, Fronts] = {}
    for function in dict.fromkeys(cell.problem for cell in batch.cells):
        numbers = [n for n in range(1, batch.runs + 1) if all((function, one, n) in runs for one in who)]
        fronts[function] = {one: [runs[function, one, n].front for n in numbers] for one in who}
    return fronts
