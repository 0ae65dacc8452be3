"""Refusal of derivatives that would not fit into memory: by single shooting, their number grows with the square of the number of nodes."""

from __future__ import annotations

from ..base import NLP

BYTES = 120
"""Memory that a derivative takes until a program is ready, measured on ascents with 800 and 1600 nodes."""
MOST = 2.0
"""GB that the derivatives of one NLP may take."""


def too_dense(nlp: NLP) -> bool:
    """Whether the derivatives of an NLP would take more memory than `MOST`."""
    return _gigabytes(nlp) > MOST


def refuse_dense(nlp: NLP) -> None:
    """Raise ValueError if the derivatives of an NLP would take more memory than `MOST`: how much, and what to use instead."""
    if too_dense(nlp):
        raise ValueError(
            f"problem '{nlp.problem.name}', {nlp.transcription!r}: derivatives would take about {_gigabytes(nlp):.3g} GB, more than "
            f"{MOST:g} GB, since the states depend on all controls before them: use MultipleShooting with as many intervals, whose "
            "derivatives are sparse, or fewer nodes, or a search without derivatives, inner='propagate'"
        )


def _gigabytes(nlp: NLP) -> float:
    return BYTES * nlp.dense / 1e9
