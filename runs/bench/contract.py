"""The contract of a benchmark: cases measured round by round, values of each contender, their table, and what is asked beside them.

A new benchmark is a `Bench` in a module of its own and a line in the table of `command`. Its `prepare` makes a case ready and returns a
function of the number of the round, which measures once and returns a `Row` for each contender.
"""

from __future__ import annotations

import csv
import inspect
import io
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import fill
from types import ModuleType
from typing import Any, TypeVar
from unittest.mock import patch

import numpy as np

from macs import Front
from macs.io.atomic import write_whole
from macs.io.console import Steps
from macs.io.interrupts import Stopped
from macs.io.text import text_table
from macs.solvers.solver import SOLVERS

from ..batch.code import code_of, code_of_method, imported, merged
from ..report.tables import short

Result = TypeVar("Result")

ASKED = {
    "beyond": 0.05,  # largest share of its runs' time that a study takes beyond it
    "exponent": 1.1,  # largest one of what grows linearly: caches, and what is measured, make some hundredths of it
    "front": 1.3,  # times the time of the better other inner level, at most
    "generation": 0.15,  # what noise may add to the median of exponents
    "MB": 1500.0,  # most memory of a process that solves a published problem
    "peers": 1.5,  # times YAPSS's time, at most
    "population": 4.0,  # times as fast as one by one, without a compiler; candidates a second would depend on the machine
    "study": 1.7,  # least ratio of speeds of two processes to one
    "16": 0.45,  # time of equal tasks on sixteen workers, at most, as a part of that on four
}
"""Limits of what is measured, by benchmark or quantity; those of single cases stand with the cases."""


@dataclass
class Row:
    """All that was measured of one contender on one case: a list of numbers for each quantity, one for each round or seed."""

    case: str
    who: str
    values: dict[str, list[float]] = field(default_factory=dict)

    @classmethod
    def once(cls, case: str, who: str, **values: float) -> Row:
        """The row of one round. Values that are not finite numbers are left out."""
        return cls(case, who, {name: [float(value)] if np.isfinite(value) else [] for name, value in values.items()})

    def of(self, name: str, how: Callable = np.median) -> float:
        """The median of a quantity, or another statistic `how` of its values; NaN if there are none."""
        values = self.values.get(name)
        return float(how(values)) if values else np.nan

    def short(self, name: str, how: Callable = np.median) -> str:
        """The same in three digits; "-" if there are none."""
        return short(self.of(name, how))

    def spread(self, name: str) -> str:
        """Median and quartiles, of at most four values least and greatest: 12 [10, 15]."""
        values = self.values.get(name)
        if not values:
            return "-"
        if len(values) == 1:
            return short(values[0])
        ends = np.quantile(values, [0.25, 0.75]) if len(values) > 4 else (min(values), max(values))
        return f"{short(np.median(values))} [{', '.join(map(short, ends))}]"


Column = tuple[str, str, Callable[[Row], str]]
"""Two lines of header, and the text of a row."""


@dataclass(frozen=True)
class Target:
    """What a benchmark asks, and what it measured: by medians of rounds or seeds, so that neither the best nor the worst one decides."""

    what: str  # of which case, or of what
    asked: str
    measured: str
    met: bool  # false, too, for what could not be measured


@dataclass(frozen=True)
class Effort:
    """How much is measured."""

    cases: tuple[Any, ...] = ()  # each is its name, or has one
    rounds: int = 1  # of each case; rounds are seeds 1, 2, ... where a benchmark says so
    seconds: float = np.inf  # after which a case gets no further round, once it had three; of a process of its own, its limit
    evaluations: int | None = None  # most of a run; None: the case's own
    # Of searches on plain functions: runs at the same time, the folder that keeps them, and the solvers that are compared (all if none).
    jobs: int = 1
    keep: str | None = None
    solvers: tuple[str, ...] = ()


@dataclass(frozen=True)
class Bench:
    """A benchmark, see the module."""

    title: str  # of the display of its progress
    about: str | Callable[[Sequence[Row]], str]  # first lines of its report: what is measured, and what the columns are
    full: Effort
    quick: Effort
    prepare: Callable[[Any, Effort, Steps], Callable[[int], Iterable[Row]]] | None = None
    whole: Callable[[list[Row], Effort], None] | None = None  # measures all cases, where rounds are runs of studies
    columns: Sequence[Column] | Callable[[Sequence[Row]], Sequence[Column]] = ()
    targets: Callable[[Sequence[Row]], list[Target]] = lambda rows: []
    notes: Callable[[Sequence[Row]], list[str]] = lambda rows: []  # lines below the table
    modules: tuple[ModuleType, ...] = ()  # others that state what is measured
    seeded: bool = False  # whether rounds are seeds
    kept: bool = False  # whether its runs are those of studies, which can be made at the same time, and kept

    def measure(self, rows: list[Row], effort: Effort) -> None:
        """Measure all cases; `rows` are filled round by round, also if `Stopped` ends it."""
        if self.whole is not None:
            self.whole(rows, effort)
            return
        assert self.prepare is not None
        with Steps(self.title, len(effort.cases) * effort.rounds) as steps:
            for case in effort.cases:
                began = np.inf
                for number in range(1, effort.rounds + 1):
                    if number > 3 and time.perf_counter() - began > effort.seconds:
                        break
                    steps.begin(f"{getattr(case, 'name', case)}, {'seed' if self.seeded else 'round'} {number}")
                    if number == 1:
                        measured, began = self.prepare(case, effort, steps), time.perf_counter()
                    merge(rows, measured(number))

    def report(self, rows: Sequence[Row]) -> str:
        """The measured values, and the targets."""
        columns = self.columns(rows) if callable(self.columns) else self.columns
        about = self.about(rows) if callable(self.about) else self.about
        lines = [fill(about, 140), "", table(rows, columns), ""]
        return "\n".join([*lines, *self.notes(rows), *verdicts(self.targets(rows))])

    @property
    def sources(self) -> list[Path]:
        """The files that state what is measured."""
        own = inspect.getfile(self.prepare or self.whole)  # type: ignore[arg-type]
        return [Path(own), *(Path(str(module.__file__)) for module in self.modules), Path(__file__)]

    @property
    def code(self) -> dict[str, str]:
        """The code that what is measured depends on, see `batch.code`."""
        searches = [code_of_method("", "", SOLVERS[name].partition(":")[0]) for name in ("macs", "nsga2")]
        return merged(searches) if self.kept else code_of(imported(self.sources))


def merge(rows: list[Row], found: Iterable[Row]) -> None:
    """Add the values of a round to the rows of the same case and contender."""
    known = {(row.case, row.who): row for row in rows}
    for row in found:
        own = known.setdefault((row.case, row.who), row)
        if own is row:
            rows.append(row)
            continue
        for name, values in row.values.items():
            own.values.setdefault(name, []).extend(values)


def side_by_side(
    contenders: Mapping[str, Callable[[], Result]], number: int, clock: Callable[[], float] = time.perf_counter
) -> dict[str, tuple[float, Result]]:
    """Seconds and result of each contender, one after the other. Each round begins with another one: none always follows the slow one."""
    names = list(contenders)
    turn, found = number % len(names), {}
    for who in names[turn:] + names[:turn]:
        began = clock()
        result = contenders[who]()
        found[who] = clock() - began, result
    return {who: found[who] for who in names}


def compiling(when: str) -> AbstractContextManager[Any]:
    """A context in which Functions that are made are compiled at once ("always"), or never ("0")."""
    return patch.dict(os.environ, MACS_COMPILE=when)


def finished(front: Front) -> Front:
    """A front, unless Ctrl-C ended its search: then `Stopped` is raised."""
    if front.stats.get("stopped") == "interrupted":
        raise Stopped("interrupted")
    return front


def table(rows: Sequence[Row], columns: Sequence[Column]) -> str:
    """A line for each row, the case named once."""
    cells = []
    for i, row in enumerate(rows):
        first = i == 0 or rows[i - 1].case != row.case
        cells.append([row.case if first else "", row.who, *(write(row) for _, _, write in columns)])
    headers = [["case", "", *(column[0] for column in columns)], ["", "", *(column[1] for column in columns)]]
    return text_table(headers, cells, [True, True] + [False] * len(columns))


def verdicts(targets: Sequence[Target]) -> list[str]:
    """Lines of a table of what is asked; none if nothing is."""
    if not targets:
        return []
    cells = [[one.what, one.asked, one.measured, "met" if one.met else "MISSED"] for one in targets]
    return text_table([["", "asked", "measured", ""]], cells, [True] * 4).splitlines()


def column(head: str, below: str, name: str, how: Callable = np.median, form: str = "") -> Column:
    """A column of medians, or another statistic, in three digits or by a format."""
    return head, below, lambda row: row.short(name, how) if not form or not row.values.get(name) else format(row.of(name, how), form)


def rounds_of(name: str, below: str = "rounds") -> Column:
    """The column of the number of values of a quantity."""
    return "", below, lambda row: str(len(row.values.get(name, ())))


SECONDS = column("s", "", "seconds")


def save(path: str | Path, measured: Sequence[tuple[str, Row]]) -> None:
    """Write a CSV file: one number a line, with the benchmark, the case and the contender that it is of."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["benchmark", "case", "contender", "quantity", "repetition", "value"])
    for kind, row in measured:
        for quantity, values in row.values.items():
            writer.writerows([kind, row.case, row.who, quantity, i, repr(value)] for i, value in enumerate(values))
    write_whole(path, text.getvalue().encode())
