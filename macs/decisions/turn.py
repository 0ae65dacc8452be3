"""Turn: what was asked for and what was chosen by it."""

from __future__ import annotations

from dataclasses import dataclass

from ..preferences import Preference
from .choice import Choice


@dataclass(frozen=True, eq=False)
class Turn:
    """One turn of a dialogue.

    Attributes
    ----------
    asked : str
        What the person asked for, in words.
    preference : Preference
        What it means.
    choice : Choice or None
        What was chosen by it; None: nothing yet.
    alternatives : tuple of Choice
        Others about it.

    Examples
    --------
    >>> from macs import sweep
    >>> from problems import load
    >>> from transcription import DFET
    >>> front = sweep(load("goddard"), DFET(6, 6, basis="bernstein"), points=3, starts=1)
    >>> from macs.decisions import Dialogue, ReferencePoint
    >>> dialogue = Dialogue(front)  # without the problem, points are ranked
    >>> choice = dialogue.prefer(ReferencePoint({"flight time": 180.0}))
    >>> choice = dialogue.choose()
    >>> turn = dialogue.history[-1]
    >>> turn.choice is None
    False
    """

    asked: str
    preference: Preference
    choice: Choice | None = None
    alternatives: tuple[Choice, ...] = ()
