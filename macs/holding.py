"""Points that hold when they are flown: what misses a limit between its nodes is solved once more, further inside by what it missed.

A finer mesh would do it, too, at many times the cost: where the misses are small, so is what keeping away from the limits takes of the
objectives. To keep away from constraints by what is known to be missed of them is called back-off: Figueroa, Bahri, Bandoni and Romagnoli,
"Economic impact of disturbances and uncertain parameters in chemical processes - a dynamic back-off analysis", Computers and Chemical
Engineering 20(4), 1996.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from transcription.base import NLP
from transcription.trajectories.simulate import simulate_all

from .evaluation.bilevel import Bilevel
from .evaluation.evaluator import CONVERGED
from .pareto.dominance import nondominated

if TYPE_CHECKING:
    from .front import Front

ROUNDS = 3
"""How often a point is moved further inside, at most."""
MORE = 1.2
"""How many times what was missed it is moved: where it moves to, it may miss a little more."""
PART = 1e-4
"""Errors of the integrator are this part of what may be missed, at most."""


def hold(evaluator: Bilevel, Z: np.ndarray, ranges: np.ndarray, verify: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vectors that hold, in place of such as do not.

    Parameters
    ----------
    evaluator : Bilevel
        It makes the solves, and counts them.
    Z : array (k, D)
        Feasible vectors.
    ranges : array (m,)
        What counts as much in each objective.
    verify : float
        By how much, in their scales, constraints may be missed in flight.

    Returns
    -------
    Z : array (k, D)
    holds : array (k,) of bool
        Which do, in the end.
    moved : array (k,) of bool
        Which are not what they were.
    """
    nlp, Z = evaluator.nlp, Z.copy()
    F = nlp.evaluate(Z)[0] if len(Z) else np.empty((0, len(ranges)))
    margins = np.zeros((len(Z), len(nlp.g_scale)))
    holds, moved = np.zeros((2, len(Z)), dtype=bool)
    waiting = np.arange(len(Z))
    for _ in range(ROUNDS):
        waiting = _missing(nlp, Z, waiting, margins, holds, verify)
        if not len(waiting):
            return Z, holds, moved
        found = evaluator.refine(Z[waiting], F[waiting], np.tile(ranges, (len(waiting), 1)), margins[waiting])
        good = found.status == CONVERGED
        waiting = waiting[: len(good)][good]
        Z[waiting], moved[waiting] = found.Z[good], True
    _missing(nlp, Z, waiting, margins, holds, verify)
    return Z, holds, moved


def _missing(nlp: NLP, Z: np.ndarray, waiting: np.ndarray, margins: np.ndarray, holds: np.ndarray, verify: float) -> np.ndarray:
    """Fly the rows that are waiting: which of them miss something. Their `margins` grow by that; the others hold."""
    rtol, atol = _accuracy(verify)
    flights = simulate_all(nlp.problem, [nlp.unpack(z) for z in Z[waiting]], rtol=rtol, atol=atol)
    holds[waiting] = [flight.violation <= verify for flight in flights]
    for row, flight in zip(waiting, flights, strict=True):
        margins[row] += MORE * _by_row(flight.violations, nlp.g_labels)
    return waiting[~holds[waiting]]


def _by_row(violations: Mapping[str, float], labels: Sequence[str]) -> np.ndarray:
    """What was missed, in each row of the constraints; 0 where a row is none of a constraint that can be missed in flight."""
    missed = np.array([violations.get(label, 0.0) for label in labels])
    return np.where(np.isfinite(missed), np.maximum(missed, 0.0), 0.0)


def believable(found: np.ndarray, known: Front, verify: float) -> Front:
    """Of a front's points those that hold when flown, as far as it matters: what points `found` (k, m) dominate is not flown."""
    holds, seen = np.ones(len(known), dtype=bool), np.zeros(len(known), dtype=bool)
    while True:
        rows = np.flatnonzero(holds)
        apart = nondominated(np.vstack([found, known.F[rows]]))[len(found) :]
        look = rows[apart & ~seen[rows]]
        if not len(look):
            return known[rows]
        seen[look] = True
        rtol, atol = _accuracy(verify)
        holds[look] = known[look].flown(tolerance=verify, rtol=rtol, atol=atol).status == CONVERGED


def _accuracy(verify: float) -> tuple[float, float]:
    """rtol and atol of an integrator that is as exact as the question whether something is missed by more than `verify`."""
    accuracy = min(PART * verify, PART)
    return accuracy, 0.1 * accuracy
