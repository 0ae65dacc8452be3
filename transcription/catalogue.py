"""Transcriptions by name: for the command line ("dfet:4x6") and for files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Transcription
from .dfet import DFET

METHODS: dict[str, type[Transcription]] = {"DFET": DFET}
EXAMPLES = "dfet:4x6 (4 elements of order 6), dfet:4x6:bernstein"


def parse(text: str) -> Transcription:
    """A transcription from one word, as on the command line. Raises ValueError that shows how it is written."""
    method, _, rest = text.partition(":")
    mesh, _, basis = rest.partition(":")
    elements, _, order = mesh.partition("x")
    if method.lower() != "dfet" or not elements.isdecimal() or not order.isdecimal():
        raise ValueError(f"unknown transcription '{text}'; write it as {EXAMPLES}")
    return DFET(int(elements), int(order), basis=basis or "lobatto")


def from_dict(data: Mapping[str, Any]) -> Transcription:
    """A transcription from what `Transcription.to_dict` gave. Raises ValueError if there is no such method or setting."""
    method = data.get("method")
    if method not in METHODS:
        raise ValueError(f"unknown transcription {method!r}; there are {', '.join(METHODS)}")
    try:
        return METHODS[method](**data.get("settings", {}))
    except TypeError as error:
        raise ValueError(f"transcription {method}: {error}") from None
