"""Plain text, JSON and HTML: tables, numbers with their units, counts and durations."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np


def text_table(headers: Sequence[Sequence[str]], rows: Sequence[Sequence[str]], left: Sequence[bool]) -> str:
    """A text table with aligned columns and a rule under the headers."""
    cells = [*headers, *rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(left))]
    lines = [
        "  ".join((str.ljust if flush else str.rjust)(cell, w) for cell, w, flush in zip(row, widths, left, strict=True)) for row in cells
    ]
    lines.insert(len(headers), "  ".join("-" * w for w in widths))
    return "\n".join(line.rstrip() for line in lines)


def numbers(values: Any, tolerance: float = np.nan, among: Any = None) -> list[str]:
    """A column of numbers with the same number of decimals: those within which they are known, and at least four digits of their range.
    Some `among` others, such as one of a front, have as many as these.

    Without a `tolerance` in the column's unit, or where the numbers differ by no more, there are six significant digits and at least four
    of the column's range; one that would have fewer than five has more decimals, unless it is less than a millionth of the largest. The
    decimal points stay below each other.
    """
    values = np.asarray(values, dtype=float) + 0.0
    column = values if among is None else np.asarray(among, dtype=float)
    finite = column[np.isfinite(column)]
    largest = np.abs(finite).max(initial=0.0)
    if largest and not 1e-3 <= largest < 1e8:
        return [f"{value:.5e}" for value in values]
    span = np.ptp(finite) if len(finite) else 0.0
    known = span > tolerance > 0
    digits = -_decade(tolerance) if known else 5 - _decade(largest)
    if span > max(1e-9 * largest, np.nan_to_num(tolerance)):
        digits = max(digits, 3 - _decade(span))
    digits = int(np.clip(digits, 0, 11 - _decade(largest)))
    small = np.isfinite(values) & (np.abs(values) >= 1e-6 * largest) & (values != 0) & (not known)
    own = [max(digits, 4 - _decade(abs(value))) if more else digits for value, more in zip(values, small.tolist(), strict=True)]
    width = max(own, default=0)
    shown = [f"{value:.{n}f}{' ' * (width - n + (n == 0 < width))}" for value, n in zip(values, own, strict=True)]
    return [text.replace("-", "", 1) if not float(text) else text for text in shown]


def counted(number: int, what: str) -> str:
    """A number with its noun: 1 evaluation, 10 000 evaluations."""
    return f"{number:,} {what}{'' if number == 1 else 's'}".replace(",", " ")


def call(name: str, settings: Mapping[str, Any]) -> str:
    """A method with its settings as in Python code: `DFET(elements=4, order=6)`."""
    return f"{name}({', '.join(f'{key}={value!r}' for key, value in settings.items() if value is not None)})"


def duration(seconds: float) -> str:
    """A duration in words: 0.25 s, 3.6 s, 4 min 05 s, 2 h 03 min."""
    if not 60 <= seconds < np.inf:
        return f"{seconds:.2g} s" if seconds < 9.95 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def _decade(value: float) -> int:
    return int(np.floor(np.log10(value))) if value else 0


def label(name: str, unit: str) -> str:
    """Name of a column or a line: `name [unit]`."""
    return f"{name} [{unit}]" if unit else name


def per(unit: str) -> str:
    """Unit of what is per unit of something, such as a costate; empty if it has none."""
    return f"per {unit}" if unit else ""


def document(value: Any, strict: bool = False) -> str:
    """JSON, numpy's numbers and arrays included. What is not data is written as its `repr`; if strict, it raises TypeError."""

    def plain(item: Any) -> Any:
        if isinstance(item, np.ndarray):
            return item.tolist()
        if isinstance(item, np.generic):
            return item.item()
        if strict:
            raise TypeError(f"{type(item).__name__} is not data")
        return repr(item)

    return json.dumps(value, default=plain)


CELL = "padding:1px 8px;white-space:nowrap;text-align:"


# For notebooks. All words are escaped: names are the user's.


def html_table(headers: Sequence[Sequence[str]], rows: Sequence[Sequence[str]], left: Sequence[bool], dim: Sequence[int] = ()) -> str:
    """A table."""
    sides = ["left" if flush else "right" for flush in left]

    def line(cells: Sequence[str], tag: str, style: str = "") -> str:
        content = "".join(f'<{tag} style="{CELL}{side}">{escape(cell)}</{tag}>' for cell, side in zip(cells, sides, strict=True))
        return f'<tr style="{style}">{content}</tr>' if style else f"<tr>{content}</tr>"

    body = "".join(line(row, "td", "color:#888888" if i in dim else "") for i, row in enumerate(rows))
    return f"<table><thead>{''.join(line(row, 'th') for row in headers)}</thead><tbody>{body}</tbody></table>"


def html_block(title: str, table: str, notes: Sequence[str] = (), picture: bytes = b"", what: str = "") -> str:
    """A title, a table, notes and a picture."""
    lines = "".join(f"<div>{escape(note)}</div>" for note in notes)
    image = ""
    if picture:
        source = b64encode(picture).decode("ascii")
        image = f'<img alt="{escape(what, quote=True)}" style="max-width:100%" src="data:image/png;base64,{source}"/>'
    return f"<div><div><b>{escape(title)}</b></div>{table}{lines}{image}</div>"
