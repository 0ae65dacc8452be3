"""HTML for notebooks: tables and pictures in one piece of text. All words are escaped: names are the user's."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape

CELL = "padding:1px 8px;white-space:nowrap;text-align:"


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
