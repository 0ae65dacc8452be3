"""Measured values of each round or seed and their spread, as tables and as a file."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from macs.io.atomic import write_whole
from macs.io.text import text_table

from ..report.tables import short

__all__ = ["Column", "Row", "Target", "save", "short", "table", "verdicts"]


@dataclass
class Row:
    """All that was measured of one contender on one case: a list of numbers for each quantity, one for each round or seed."""

    case: str
    who: str
    values: dict[str, list[float]] = field(default_factory=dict)

    def add(self, **values: float) -> None:
        """Add a value of each quantity; values that are not numbers are left out."""
        for name, value in values.items():
            known = self.values.setdefault(name, [])
            if np.isfinite(value):
                known.append(float(value))

    def of(self, name: str, how: Callable = np.median) -> float:
        """The median of a quantity, or another statistic `how` of its values; NaN if there are none."""
        values = self.values.get(name)
        return float(how(values)) if values else np.nan

    def spread(self, name: str) -> str:
        """Median and quartiles, of few values least and greatest: 12 [10, 15]."""
        values = self.values.get(name)
        if not values:
            return "-"
        if len(values) == 1:
            return short(values[0])
        ends = np.quantile(values, [0.25, 0.75]) if len(values) > 4 else (min(values), max(values))
        return f"{short(np.median(values))} [{', '.join(map(short, ends))}]"


Column = tuple[str, str, Callable[[Row], str]]
"""Two lines of header, and the text of a row."""


def table(rows: Sequence[Row], columns: Sequence[Column]) -> str:
    """A line for each row, the case named once."""
    cells = []
    for i, row in enumerate(rows):
        first = i == 0 or rows[i - 1].case != row.case
        cells.append([row.case if first else "", row.who, *(write(row) for _, _, write in columns)])
    headers = [["case", "", *(column[0] for column in columns)], ["", "", *(column[1] for column in columns)]]
    return text_table(headers, cells, [True, True] + [False] * len(columns))


@dataclass(frozen=True)
class Target:
    """What a benchmark asks, and what it measured: by medians of rounds or seeds, so that neither the best nor the worst one decides."""

    what: str  # of which case, or of what
    asked: str
    measured: str
    met: bool  # false, too, for what could not be measured


def verdicts(targets: Sequence[Target]) -> list[str]:
    """Lines of a table of what is asked; none if nothing is."""
    if not targets:
        return []
    cells = [[one.what, one.asked, one.measured, "met" if one.met else "MISSED"] for one in targets]
    return text_table([["", "asked", "measured", ""]], cells, [True] * 4).splitlines()


def save(path: str | Path, measured: Sequence[tuple[str, Row]]) -> None:
    """Write a CSV file: one number a line, with the benchmark, the case and the contender that it is of."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["benchmark", "case", "contender", "quantity", "repetition", "value"])
    for bench, row in measured:
        for quantity, values in row.values.items():
            writer.writerows([bench, row.case, row.who, quantity, i, repr(value)] for i, value in enumerate(values))
    write_whole(path, text.getvalue().encode())
