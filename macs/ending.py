"""How MACS makes a front of what its search has found: as it is, polished on another transcription, or with the meshes refined."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from problems.compiled import CompiledProblem
from problems.peaks import refuse_peaks
from transcription.base import Meshed, Transcription
from transcription.catalogue import parse

from .front import Front
from .pareto.dominance import dominates

if TYPE_CHECKING:
    from .search.macs import MACS


def check(settings: MACS) -> None:
    """Raise ValueError where the settings of the end make no sense."""
    if settings.mesh not in ("fixed", "adaptive"):
        raise ValueError(f"MACS: mesh must be 'fixed' or 'adaptive', not {settings.mesh!r}")
    if settings.polish_on is None:
        if settings.verify is not None:
            raise ValueError("MACS: verify makes no sense without polish_on")
        return
    if not isinstance(settings.polish_on, str):
        raise ValueError(f"MACS: polish_on must be a word such as 'dfet:30x3', not {settings.polish_on!r}")
    try:
        parse(settings.polish_on)
    except ValueError as error:
        raise ValueError(f"MACS: polish_on: {error}") from error
    if not settings.refine:
        raise ValueError("MACS: polish_on makes no sense with refine=False, which is to use no derivatives")
    if settings.mesh == "adaptive":
        raise ValueError("MACS: polish_on makes no sense with mesh='adaptive': points are on the mesh that it says")


def check_transcription(settings: MACS, transcription: Transcription, problem: CompiledProblem) -> None:
    """Raise ValueError where they do not suit the transcription of a problem."""
    if settings.mesh == "adaptive" and not isinstance(transcription, Meshed):
        raise ValueError(f"MACS: mesh='adaptive' needs DFET or another method on elements, not {type(transcription).__name__}")
    if settings.polish_on is not None:
        refuse_peaks(problem)


def finish(settings: MACS, front: Front, time_limit: float | None, progress: bool) -> Front:
    """What is to be made of the front of a search that ended by itself."""
    if settings.polish_on is not None:
        solves = front.stats["evaluations"] // settings.polish_every
        return front.polished(
            parse(settings.polish_on),
            solves=solves,
            limit=settings.archive,
            verify=settings.verify,
            time_limit=time_limit,
            progress=progress,
        )
    if settings.mesh == "fixed" or not len(front):
        return front
    refined = front.refine_mesh(tolerance=settings.mesh_tolerance, time_limit=time_limit, progress=progress)
    # A point that did not get there may promise too much: it is not believed to dominate any.
    believed = refined.F[[i for i, point in enumerate(refined) if not point.note]]
    return refined[np.flatnonzero(~np.any(dominates(believed, refined.F[:, None]), axis=1))]
