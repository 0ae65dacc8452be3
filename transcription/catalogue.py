"""Transcriptions by name: for the command line ("dfet:4x6") and for files. Methods register themselves: see `Transcription.word`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .base import Transcription


def parse(text: str) -> Transcription:
    """A transcription from one word, as on the command line. Raises ValueError that shows how it is written.

    Parameters
    ----------
    text : str
        Such as "dfet:4x6".

    Examples
    --------
    >>> from transcription import DFET, parse
    >>> parse("dfet:4x6") == DFET(4, 6)
    True
    """
    name, mesh, *options = (*text.split(":"), "")[: max(2, text.count(":") + 1)]
    methods = {each: one for one in Transcription.registered.values() for each in ([one.word] if isinstance(one.word, str) else one.word)}
    method = methods.get(name.lower())
    numbers = mesh.split("x")
    if method is None or not all(number.isdecimal() for number in numbers):
        known = [method] if method else Transcription.registered.values()
        raise ValueError(f"unknown transcription '{text}'; write it as {', '.join(one.examples for one in known)}")
    try:
        return method.from_word(name.lower(), tuple(map(int, numbers)), tuple(option for option in options if option))
    except ValueError as error:
        raise ValueError(f"transcription '{text}': {error}") from None


def stated(given: str | Mapping[str, Any]) -> Transcription:
    """A transcription as a case or a study file states it: in one word, or as a table that `from_dict` takes.

    Parameters
    ----------
    given : str or mapping

    Examples
    --------
    >>> from transcription import DFET, stated
    >>> stated("dfet:4x6") == DFET(4, 6)
    True
    """
    return parse(given) if isinstance(given, str) else from_dict(given)


def word(method: Transcription) -> str | None:
    """A transcription in one word, such that `parse` gives it again; None if it has no such word.

    Parameters
    ----------
    method : Transcription

    Examples
    --------
    >>> from transcription import DFET, word
    >>> word(DFET(4, 6))
    'dfet:4x6'
    """
    if type(method).__name__ not in Transcription.registered:
        return None
    text = method.to_word()
    return text if parse(text) == method else None


def from_dict(data: Mapping[str, Any]) -> Transcription:
    """A transcription from what `Transcription.to_dict` gave. Raises ValueError if there is no such method or setting.

    Parameters
    ----------
    data : mapping

    Examples
    --------
    >>> from transcription import DFET, from_dict
    >>> from_dict(DFET(4, 6).to_dict()) == DFET(4, 6)
    True
    """
    method = data.get("method")
    if method not in Transcription.registered:
        raise ValueError(f"unknown transcription {method!r}; there are {', '.join(Transcription.registered)}")
    try:
        return Transcription.registered[method](**data.get("settings", {}))
    except TypeError as error:
        raise ValueError(f"transcription {method}: {error}") from None
