"""One optimum on a mesh that is found: from a coarse mesh on, refined by what simulation shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from transcription import DFET
from transcription.base import NLP, Meshed
from transcription.nlp.scalarized import Solved
from transcription.stopping import Stopped

from ..evaluation.evaluator import CONVERGED
from .mesh_loop import MeshLoop, Refinement
from .multistart import MultistartSolver
from .tasks import Along

COARSE: tuple[Meshed, ...] = (
    DFET(8, 3),
    DFET(12, 3, basis="bernstein"),
    DFET(4, 4),
    DFET(20, 3),
    DFET(20, 3, basis="bernstein", control_order=1),
)
"""Meshes to begin on, in the order in which they are tried: where one leads nowhere, another often does."""


@dataclass(frozen=True, eq=False)
class Found:
    """An optimum on a mesh that was found.

    Attributes
    ----------
    nlp : NLP
        Of its mesh.
    solved : Solved
        On the coarse mesh that it came from; where no solve converged, the least infeasible result.
    refinement : Refinement or None
        What became of it; None where no solve on a coarse mesh converged.
    """

    nlp: NLP
    solved: Solved
    refinement: Refinement | None

    @property
    def z(self) -> np.ndarray:
        """The vector (n,) of `nlp`."""
        return self.solved.z if self.refinement is None else self.refinement.best.z

    @property
    def good(self) -> bool:
        """Whether simulations agree with it as well as is wanted."""
        return self.refinement is not None and not self.refinement.complaints()

    @property
    def note(self) -> str:
        """Why it is not good, or what else is to be said of it."""
        return "" if self.refinement is None else self.refinement.note


def found_optimum(
    loop: MeshLoop,
    reference: np.ndarray,
    weights: np.ndarray,
    given: Callable[[NLP], np.ndarray | None],
    starts: int,
    rng: np.random.Generator,
    coarse: Sequence[Meshed] = COARSE,
) -> Found:
    """The optimum of a scalarised problem, from coarse meshes on.

    Parameters
    ----------
    loop : MeshLoop
        Has what is wanted, the limits, and makes and counts all solves.
    reference, weights : arrays (m,)
        See `scalarize`.
    given : callable
        Vectors (k, n) of an NLP that are known at the beginning; None if there are none.
    starts : int
        Number of starts on a coarse mesh: the best known vector, the others random.
    rng : numpy.random.Generator
        Of the random starts.
    coarse : sequence of Meshed
        The meshes to begin on. The next one is tried only where the one before leads to no good point.

    Raises
    ------
    Stopped
        If the work is to end before there is any result.
    """
    found: list[Found] = []
    for method in coarse:
        try:
            nlp = loop.programs(method)
        except Stopped:
            if not found:
                raise
            break
        solver = MultistartSolver(nlp, given(nlp), starts, rng, loop.solves)
        solved = solver.solve(reference, weights)
        found.append(Found(nlp, solved, None))
        if solved.status == CONVERGED:
            units = loop.units(solved.F[None], nlp, solved.z)
            with suppress(Stopped):
                begun = loop.on_mesh(method, solved.z, solved.F, nlp.unpack(solved.z), units, True)
                refinement = loop.refine(begun, Along(reference, weights, units))
                found[-1] = Found(loop.programs(refinement.best.method), solved, refinement)
        if found[-1].good or loop.ended:
            break
    return min(found, key=_rank)


def _rank(one: Found) -> tuple[bool, float]:
    """Those that were refined first, by their errors; then the others by their violation."""
    refined = one.refinement is not None
    return not refined, one.refinement.best.error if one.refinement is not None else one.solved.violation
