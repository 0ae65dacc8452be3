"""The transcription of a problem for which none was given."""

from __future__ import annotations

from problems.compiled import CompiledProblem
from problems.problem import Problem
from transcription.base import Transcription
from transcription.catalogue import parse
from transcription.dfet.method import DFET

COARSE = DFET(8, 3, basis="bernstein")
"""The first mesh of a problem that names none."""


def default_transcription(problem: Problem | CompiledProblem) -> Transcription:
    """The problem's own default, or a coarse mesh."""
    word = problem.default_transcription if isinstance(problem, Problem) else None
    return COARSE if word is None else parse(word)
