"""Tables, written as text for terminals, as CSV for programs, as LaTeX (booktabs) for papers and as Markdown for pages."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from macs.io.atomic import write_whole
from macs.io.text import label, text_table

Cell = str | float | int | None
"""An entry of a table: text, a number, or None if there is none."""

ESCAPES: dict[str, str] = {character: f"\\{character}" for character in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "²": r"\textsuperscript{2}",
    "³": r"\textsuperscript{3}",
    "±": r"\ensuremath{\pm}",
    "×": r"\ensuremath{\times}",
    "°": r"\ensuremath{^\circ}",
    "−": r"\ensuremath{-}",
    "≤": r"\ensuremath{\le}",
    "≥": r"\ensuremath{\ge}",
}


@dataclass(frozen=True)
class Head:
    """The head of a column."""

    title: str
    unit: str = ""
    digits: int = 3  # significant digits of its numbers; whole numbers (`int`) are written in full
    grouped: bool = False  # whether a cell that repeats the one above is left blank, in text and LaTeX


@dataclass(frozen=True)
class Table:
    """Columns and rows of cells, with a caption above and notes below."""

    columns: tuple[Head, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for i, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise ValueError(f"row {i} has {len(row)} cells, the table {len(self.columns)} columns")

    def text(self) -> str:
        """Columns of equal width under a rule."""
        headers = [[column.title for column in self.columns]]
        if any(column.unit for column in self.columns):
            headers.append([f"[{column.unit}]" if column.unit else "" for column in self.columns])
        _, cells, left = self.shown()
        below = ["", *self.notes] if self.notes else []
        return "\n".join([*([self.caption, ""] if self.caption else []), text_table(headers, cells, left), *below])

    def shown(self) -> tuple[list[str], list[list[str]], list[bool]]:
        """Heads with units, cells as text, and whether each column is flush left."""
        cells = [[_text(cell, column.digits) for cell, column in zip(row, self.columns, strict=True)] for row in self._shown()]
        return [label(column.title, column.unit) for column in self.columns], cells, self._left()

    def csv(self) -> str:
        """CSV: one header line, numbers in full, empty cells only where there is no value; without caption and notes."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow([label(column.title, column.unit) for column in self.columns])
        writer.writerows([[_full(cell) for cell in row] for row in self.rows])
        return out.getvalue()

    def latex(self, name: str = "") -> str:
        """A `table` environment for the package booktabs; `name` is its label."""
        heads = [escaped(label(column.title, column.unit)) for column in self.columns]
        cells = [[_latex(cell, column.digits) for cell, column in zip(row, self.columns, strict=True)] for row in self._shown()]
        lines = [r"\begin{table}", r"  \centering"]
        lines += [rf"  \caption{{{escaped(self.caption)}}}"] if self.caption else []
        lines += [rf"  \label{{{name}}}"] if name else []
        lines += [rf"  \begin{{tabular}}{{{''.join('l' if left else 'r' for left in self._left())}}}", r"    \toprule"]
        lines += [f"    {' & '.join(heads)} \\\\", r"    \midrule"]
        lines += [f"    {' & '.join(row)} \\\\" for row in cells]
        lines += [r"    \bottomrule", r"  \end{tabular}"]
        lines += [rf"  \par\smallskip\footnotesize {escaped(note)}" for note in self.notes]
        return "\n".join([*lines, r"\end{table}", ""])

    def markdown(self) -> str:
        """A table in Markdown, with its caption above and its notes below."""
        heads, cells, left = self.shown()
        rule = [":---" if flush else "---:" for flush in left]
        rows = [heads, rule, *cells]
        lines = ["| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |" for row in rows]
        above = [f"**{self.caption}**", ""] if self.caption else []
        return "\n".join([*above, *lines, *(line for note in self.notes for line in ("", note))]) + "\n"

    def save(self, stem: str | PathLike[str]) -> list[Path]:
        """Write `stem`.txt, .csv and .tex, each whole or not at all; the label of the last is `tab:` and the file's name."""
        base = Path(stem)
        written = {".txt": self.text() + "\n", ".csv": self.csv(), ".tex": self.latex(f"tab:{base.name}")}
        paths = [base.with_name(base.name + suffix) for suffix in written]
        for path, content in zip(paths, written.values(), strict=True):
            write_whole(path, content.encode())
        return paths

    def _left(self) -> list[bool]:
        """Whether each column is flush left: columns with text are."""
        return [any(isinstance(row[i], str) for row in self.rows) for i in range(len(self.columns))]

    def _shown(self) -> list[list[Cell]]:
        """The rows with the blanks of grouped columns. A column is only blank where those grouped before it are."""
        shown: list[list[Cell]] = []
        for i, row in enumerate(self.rows):
            cells, same = list(row), i > 0
            for k, column in enumerate(self.columns):
                if column.grouped:
                    same = same and row[k] == self.rows[i - 1][k]
                    cells[k] = "" if same else row[k]
            shown.append(cells)
        return shown


class PrintedNumber(float):
    """A number that a paper prints: it is shown with the digits that it has there."""


def short(value: float, digits: int = 3) -> str:
    """A number with significant digits; large whole numbers, usually counts, in full; NaN is a dash."""
    if isinstance(value, PrintedNumber):
        return f"{value:.9g}"
    if np.isnan(value):
        return "-"
    if np.isinf(value):
        return "inf" if value > 0 else "-inf"
    if value == 0.0:
        return "0"
    if 1e5 <= abs(value) < 1e9 and value == np.rint(value):
        return f"{value:.0f}"
    rounded = float(f"{value:.{digits - 1}e}")
    if not 1e-3 <= abs(rounded) < 1e5:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(0, digits - 1 - int(np.floor(np.log10(abs(rounded)))))}f}"


def escaped(text: str) -> str:
    """Words for LaTeX, with its special characters as characters."""
    return "".join(ESCAPES.get(character, character) for character in text)


def latex_number(value: float, digits: int = 3) -> str:
    r"""As `short`, in mathematics: $1.23 \times 10^{-4}$, $\infty$; NaN is a dash."""
    written = short(value, digits)
    if written == "-":
        return "--"
    if written.endswith("inf"):
        return r"$-\infty$" if written.startswith("-") else r"$\infty$"
    mantissa, _, exponent = written.partition("e")
    return rf"${mantissa} \times 10^{{{int(exponent)}}}$" if exponent else f"${mantissa}$"


def _full(cell: Cell) -> str:
    if cell is None or isinstance(cell, str):
        return cell or ""
    return repr(int(cell) if isinstance(cell, int | np.integer) else float(cell))


def _text(cell: Cell, digits: int) -> str:
    if cell is None or isinstance(cell, str):
        return "-" if cell is None else cell
    return str(cell) if isinstance(cell, int | np.integer) else short(cell, digits)


def _latex(cell: Cell, digits: int) -> str:
    if cell is None or isinstance(cell, str):
        return "--" if cell is None else escaped(cell)
    return f"${cell}$" if isinstance(cell, int | np.integer) else latex_number(cell, digits)


def table(columns: Sequence[Head | str], rows: Sequence[Sequence[Cell]], caption: str = "", notes: Sequence[str] = ()) -> Table:
    """A `Table` of lists; a column may be its title alone."""
    heads = tuple(Head(column) if isinstance(column, str) else column for column in columns)
    return Table(heads, tuple(tuple(row) for row in rows), caption, tuple(notes))
